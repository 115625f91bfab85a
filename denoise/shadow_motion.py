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

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from render.channels import SHADOW
from render.frame import Frame

from .history import look_up
from .penumbra import light_sizes, sharpness
from .reprojection import locate
from .sparse import weighted_sums
from .stencil import Float, Stencil
from .surface import dot, transform
from .view import inverses, screen_from_camera, world_motions

AROUND = (2,)     # levels of the smoothing by which motion spreads
CHOICE = 5        # levels of the smoothing of squared innovations
SLOWEST = 0.05    # pixels a frame: a shadow that moves less stands still
FEWEST = 1e-3     # share of the pixels around, below which nothing moves
FASTEST = 0.25    # of the screen's width: what is quicker is no motion that history could follow
_MATRIX = 16      # floats


def has_shadow_rays(frame: Frame) -> bool:
    return all(name in frame for name in SHADOW)


def shadow_table(previous: Frame, current: Frame) -> np.ndarray:
    """(objects + 1, 2, 16) float32: T and T^-1 of each object and, last, of what stands still."""
    motions = np.concatenate([world_motions(previous, current), np.eye(4)[None]])
    t = previous.camera_from_world @ motions @ np.linalg.inv(current.camera_from_world)
    return np.stack([t, inverses(t)], 1).astype(np.float32).reshape(-1, 2, _MATRIX)


@dataclass(frozen=True)
class ShadowRays:
    """What `shadow_motion` follows: arrays of lanes, traced and not yet evaluated, and tables.

    Attributes:
        hits: light from the surface (3, world axes), its object ID, distance and ID of the blocker.
        table: of `shadow_table`. sizes: of `penumbra.light_sizes`. matrices: camera_from_world and
            screen_from_camera, 3x3 each, row by row; number of objects.
    """

    hits: list[Float]
    table: list[Float]
    sizes: list[Float]
    matrices: list[Float]


def read_shadow_rays(frame: Frame, previous: Frame, stencil: Stencil) -> ShadowRays:
    """The shadow rays of a frame; of the frame before, the matrices alone are read."""
    hits = [plane for name in SHADOW
            for plane in stencil.load(np.ascontiguousarray(frame[name], np.float32))]
    matrices = [*frame.camera_from_world[:3, :3].ravel(), *screen_from_camera(frame).ravel(),
                len(frame.world_from_object)]
    return ShadowRays(hits, [stencil.table(shadow_table(previous, frame))],
                      [stencil.table(light_sizes(frame))],
                      [stencil.opaque(x) for x in matrices])


def shadow_motion(stencil: Stencil, hits: list[Float], surface: list[Float], position: list[Float],
                  table: list[Float], matrices: list[Float]) -> list[Float]:
    """Whether each pixel's shadow moves, 1 or 0, and u' - u where it does.

    Args:
        hits, table, matrices: of `ShadowRays`. surface: ID, normal (3), depth. position: X.
    """
    rows = [matrices[i:i + 3] for i in range(0, 18, 3)]
    light_id, distance, blocker_id = hits[3:]
    light = transform(rows[:3], hits[:3])
    id_, *normal, depth = surface
    objects = matrices[18]
    blocked, scale = stopped(hits, id_, objects)
    share = distance * scale
    light_id = dr.select(light_id >= 0, light_id, objects)
    row, column = stencil.pixel()

    def follow(_: Any) -> tuple[Float, list[Float]]:
        def matrix(object_: Float, inverse: int) -> list[Float]:
            row = 2 * stencil.UInt(dr.select(blocked, object_, 0)) + inverse
            return stencil.unpack(table[0], row, _MATRIX)

        back = matrix(stencil.Float(id_), 1)

        def seen(object_: Float, offset: list[Float]) -> list[Float]:
            """Where a point was as the surface saw it, from the surface."""
            point = [p + o for p, o in zip(position, offset)]
            there = _moved(back, _moved(matrix(object_, 0), point))
            return [q - p for p, q in zip(position, there)]

        y, b = seen(light_id, light), seen(blocker_id, [share * o for o in light])
        line = [p - q for p, q in zip(b, y)]
        rise = dot(normal, line)
        along = dot(normal, y) / dr.select(dr.abs(rise) > 0, rise, 1)
        dx, dy, dz = transform(rows[3:], [dr.fma(-along, p, q) for p, q in zip(line, y)])
        nearness = 1 / (depth + dz)
        du = [dr.fma(-(stencil.Float(at) + 0.5), dz, d) * nearness
              for at, d in ((column, dx), (row, dy))]
        length = dr.abs(du[0]) + dr.abs(du[1])
        moves = ((along < -1) & (length > SLOWEST) & (length < FASTEST * stencil.width)
                 & (nearness > 0))  # false for NaN
        return dr.select(moves, stencil.Float(1), 0), [dr.select(moves, x, 0) for x in du]

    moves, du = weighted_sums(stencil, blocked, 1, 2, follow)
    return [moves, *du]


def follow_shadows(stencil: Stencil, hits: list[Float], surface: list[Float],
                   position: list[Float], table: list[Float], sizes: list[Float],
                   matrices: list[Float]) -> list[Float]:
    """`shadow_motion` (3) and `penumbra.sharpness` (2) of each pixel; arguments as of those."""
    id_, *normal, depth = surface
    blocked, scale = stopped(hits, id_, matrices[18])
    light = transform([matrices[i:i + 3] for i in (0, 3, 6)], hits[:3])
    cosine = dr.abs(dot(normal, light)) * scale
    focal = dr.abs(matrices[9])  # of screen_from_camera
    return [*shadow_motion(stencil, hits, surface, position, table, matrices),
            *sharpness(stencil, blocked, hits[4] * scale, cosine, hits[3], depth, focal, sizes[0])]


def stopped(hits: list[Float], id_: Float, objects: Float) -> tuple[Any, Float]:
    """Whether an object stopped each shadow ray, and 1 over the whole ray's length."""
    light, (light_id, distance, blocker_id) = hits[:3], hits[3:]
    length2 = dot(light, light)
    blocked = ((id_ >= 0) & (id_ < objects) & (distance > 0) & (length2 > 0) & (blocker_id >= 0)
               & (blocker_id < objects) & (light_id < objects))
    return blocked, dr.rsqrt(dr.select(blocked, length2, 1))


def _moved(matrix: list[Float], point: list[Float]) -> list[Float]:
    return [dr.fma(matrix[r], point[0], dr.fma(matrix[r + 1], point[1],
            dr.fma(matrix[r + 2], point[2], matrix[r + 3]))) for r in (0, 4, 8)]


def look_up_shadow(stencil: Stencil, surface: list[Float], guides: list[Float],
                   motion: list[Float], dual: list[Float], records: Float, shadows: list[Float],
                   tests: list[Float]) -> tuple[list[Float], Any]:
    """The first two values of the records where each pixel's shadow was.

    Args:
        surface: ID, normal (3), depth. guides: 1/z and its slopes (2). shadows: of
            `shadow_motion`, smoothed. tests: min_cosine, plane_tolerance. The rest as of
            `locate`.
    Returns:
        two arrays, and the mask of pixels whose shadow moves and has a history.
    """
    min_cosine, tolerance = tests
    share = shadows[0]
    moves = share > FEWEST
    norm = 1 / dr.select(moves, share, 1)
    shift = [dr.select(moves, x * norm, 0) for x in shadows[1:3]]
    inverse_depth = dr.fma(guides[1], shift[0], dr.fma(guides[2], shift[1], guides[0]))
    moves &= inverse_depth > 0
    there = [*surface[:4], dr.select(moves, 1 / inverse_depth, surface[4])]
    place = locate(stencil, there, motion[0], dual, tolerance, shift)
    values, found = look_up(stencil, place, records, 2, min_cosine, wanted=moves)
    return values, moves & found
