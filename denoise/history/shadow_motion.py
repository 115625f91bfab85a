"""Where the shadow on a surface was in the previous frame, which need not be where the surface was.

Symbols: X a surface point, n its normal, Y the point of a light that its shadow ray asked for, B
what stopped the ray, all in camera space; T_i previous_camera_from_camera of object i (r of the
surface, b of the blocker, l of the light); ' the previous frame; u = (x + 1/2, y + 1/2) a pixel.

As the surface saw it, light and blocker were at Y' = T_r^-1 T_l Y and B' = T_r^-1 T_b B, and the
same shadow fell where their line meets the tangent plane:

    X' = X + d,   d = y - (n . y / n . (b - y)) (b - y),   y = Y' - X,  b = B' - X.

There visibility has another history. A pixel takes the mean of u' - u over a few pixels around it
whose shadow moves (one level of the smoothing of `innovation.py`), for one sample that is lit tells
nothing. Which history is the right one is not known beforehand (shadows of several objects cross,
or one turns): it is the one whose squared innovation, smoothed, is smaller.

Source: Zeng et al. 2021, "Temporally Reliable Motion Vectors for Real-time Ray Tracing", section
4.1. It leaves lit pixels where the surface was, and clamps the history to the neighbours' colours
instead of choosing between two.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr

from onespp.denoise.inputs.shadow_rays import MATRIX_WORDS, ShadowRays, stopped
from onespp.denoise.inputs.surface import SurfaceSample, TangentPlane
from onespp.denoise.jit.arrays import Bool, Float, Vector3
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.masked import weighted_sums
from onespp.denoise.jit.vector import dot, transform

from .records import WORDS, look_up
from .reprojection import Motion, Place, ReprojectionTests, ScreenShift, locate

SPREAD_LEVEL = 2  # of the smoothing by which motion spreads
CHOICE_LEVELS = 5  # of the smoothing of squared innovations
MIN_MOTION = 0.05  # pixels a frame: a shadow that moves less stands still
MIN_SHARE = 1e-3  # of the pixels around, below which nothing moves
MAX_MOTION = 0.25  # of the screen's width: history could not follow what is quicker


class ShadowMotion(NamedTuple):
    """Whether each pixel's shadow moves, 1 or 0, and u' - u where it does; or means of these."""

    moves: Float
    dx: Float
    dy: Float


class ShadowHistory(NamedTuple):
    """The history of visibility where a shadow was, and where a shadow moves and has one."""

    visibility: Float
    variance: Float
    is_valid: Bool


def shadow_motion(stencil: Stencil, rays: ShadowRays, surface: SurfaceSample,
                  position: Vector3) -> tuple[ShadowMotion, Float]:
    """How each pixel's shadow moved, and whether there is one that stands still, 1 or 0 (one that
    is too quick to follow does neither); position: X."""
    light = transform(rays.camera_from_world, rays.ray.light)
    id_, normal, depth = surface
    blocked, scale = stopped(rays, id_)
    share = rays.ray.blocker_distance * scale
    light_id = dr.select(rays.ray.light_id >= 0, rays.ray.light_id, rays.objects)
    row, column = stencil.pixel()

    def follow(_: Any) -> tuple[Float, list[Float]]:
        def matrix(object_: Float, inverse: int) -> list[Float]:
            row = 2 * stencil.UInt(dr.select(blocked, object_, 0)) + inverse
            return stencil.unpack(rays.table, row, MATRIX_WORDS)

        back = matrix(stencil.Float(id_), 1)

        def seen(object_: Float, offset: Vector3) -> Vector3:
            """Where a point was as the surface saw it, from the surface."""
            point = Vector3(*[p + o for p, o in zip(position, offset)])
            there = moved(back, moved(matrix(object_, 0), point))
            return Vector3(*[q - p for p, q in zip(position, there)])

        y = seen(light_id, light)
        b = seen(rays.ray.blocker_id, Vector3(*[share * o for o in light]))
        line = Vector3(*[p - q for p, q in zip(b, y)])
        rise = dot(normal, line)
        along = dot(normal, y) / dr.select(dr.abs(rise) > 0, rise, 1)
        dx, dy, dz = transform(rays.screen_from_camera,
                               Vector3(*[dr.fma(-along, p, q) for p, q in zip(line, y)]))
        nearness = 1 / (depth + dz)
        du = [dr.fma(-(stencil.Float(at) + 0.5), dz, d) * nearness
              for at, d in ((column, dx), (row, dy))]
        length = dr.abs(du[0]) + dr.abs(du[1])
        known = (along < -1) & (nearness > 0)  # these are false for NaN
        moves = known & (length > MIN_MOTION) & (length < MAX_MOTION * stencil.width)
        rests = dr.select(known & (length <= MIN_MOTION), stencil.Float(1), 0)
        return stencil.Float(1), [dr.select(moves, stencil.Float(1), 0),
                                  *(dr.select(moves, x, 0) for x in du), rests]

    _, (moves, dx, dy, rests) = weighted_sums(stencil, blocked, 1, 4, follow)
    return ShadowMotion(moves, dx, dy), rests


def moved(matrix: list[Float], point: Vector3) -> Vector3:
    """A point by the first three rows of a 4x4 matrix."""
    return Vector3(*[dr.fma(matrix[r], point.x, dr.fma(matrix[r + 1], point.y, dr.fma(
        matrix[r + 2], point.z, matrix[r + 3]))) for r in (0, 4, 8)])


def look_up_shadow(stencil: Stencil, surface: SurfaceSample, plane: TangentPlane, motion: Motion,
                   records: Float, shadow: ShadowMotion, tests: ReprojectionTests, at: int = 0,
                   words: int = WORDS) -> ShadowHistory:
    """Two values of the records where each pixel's shadow was.

    Args:
        at: which. words: of a record. The others are those of `shadow_place`.
    """
    place, moves = shadow_place(stencil, surface, plane, motion, shadow, tests)
    values, is_valid, _ = look_up(stencil, place, records, at + 2, tests.min_cosine, active=moves,
                                  words=words)
    return ShadowHistory(values[at], values[at + 1], moves & is_valid)


def shadow_unrest(rests: Float, blocked: Float) -> Float:
    """From 0, where the shadows around a pixel stand still, to 1, where a quarter of what stops
    rays does not, or nothing stops any.

    Args:
        rests: shadows that stand still, of `shadow_motion`. blocked: rays that were stopped. Both
            are shares of the pixels around.
    """
    there = blocked > MIN_SHARE
    share = rests / dr.select(there, blocked, 1)
    return dr.select(there, dr.clip(4 * (1 - share), 0, 1), 1)


def shadow_place(stencil: Stencil, surface: SurfaceSample, plane: TangentPlane, motion: Motion,
                 shadow: ShadowMotion, tests: ReprojectionTests,
                 min_share: float = MIN_SHARE) -> tuple[Place, Bool]:
    """Where each pixel's shadow was, and the mask of those whose shadow moves.

    Args:
        plane: of the surface; its `scale` is not used. motion: of `motion_between`.
        shadow: of `shadow_motion`, smoothed. min_share: of the pixels around that tell of one.
    """
    moves = shadow.moves > min_share
    norm = 1 / dr.select(moves, shadow.moves, 1)
    shift = ScreenShift(*[dr.select(moves, x * norm, 0) for x in (shadow.dx, shadow.dy)])
    inverse_depth = dr.fma(plane.dx, shift.dx, dr.fma(plane.dy, shift.dy, plane.inverse_depth))
    moves &= inverse_depth > 0
    there = surface._replace(depth=dr.select(moves, 1 / inverse_depth, surface.depth))
    return locate(stencil, there, motion, tests.plane_tolerance, shift), moves
