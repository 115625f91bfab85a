"""Where each pixel's surface was in the previous frame, and what was seen there.

Symbols: ' the previous frame; u = (x + 1/2, y + 1/2, 1) a pixel's centre; z camera-space depth;
X position and n normal in camera space; S screen_from_camera, B = S^-1 (both 3x3, rows x, y,
depth); M world_from_object.

The assignment's P' V' M'_id M_id^-1 X, in three steps that keep the digits:

1. Per object, in float64: T = V' M'_id M_id^-1 V^-1, previous_camera_from_camera (A its 3x3
   part, t its translation). Coordinates of 1e6 units cancel here, before float32.
2. S' T X - S X = z (E u + S' t / z), with E = S' A B - I. It is exactly 0 for what does not move.
3. Per pixel, in float32, the motion d = E u + S' t / z, and
       x' - x = (d_x - u_x d_w) / (1 + d_w),  z' = z (1 + d_w).

A pixel of the previous frame (a tap) counts if its object is the same, its normal is near the
expected n' = A^-T n, and it lies near the expected tangent plane:
|n' . (X'_tap - X')| < plane_tolerance z'. Bilinear reprojection weighs the taps that pass and
renormalises; with less than `LEAST_WEIGHT` there is no history.

Where a frame has a channel `motion` (of a renderer that knows more than matrices tell), x' - x is
what that says, and z' and n' are as above. For frames without matrices those are of a camera that
fits the guides, and of objects at rest (`Frame.from_arrays`).

Departure from the assignment: it takes the one nearest pixel and tests the object alone;
`nearest=True` does the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.geometry.cameras import camera_from_screen, screen_from_camera
from onespp.denoise.geometry.motion import world_motions
from onespp.denoise.inputs.surface import SurfaceSample
from onespp.denoise.jit.arrays import Bool, Color, Float, Matrix3, UInt, Vector3
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.vector import cross, dot, opaque_matrix, transform
from onespp.render.errors import InputError
from onespp.render.frame import Frame

LEAST_WEIGHT = 0.01
WORDS = 8            # a pixel of packed history: colour 3, object ID, normal 3, depth
_ROW = 16            # floats an object in the motion table: E | S' t (3x4), row by row, padded
_FEWEST_OBJECTS = 64


class ReprojectionTests(NamedTuple):
    """What a pixel of the previous frame must pass.

    Attributes:
        min_cosine: of the angle between normals.
        plane_tolerance: distance from the tangent plane over depth.
    """

    min_cosine: Float
    plane_tolerance: Float


class ScreenTransforms(NamedTuple):
    """From a normal to its tangent plane on the screen, and back: B^T of the current frame and S'^T
    of the previous one."""

    plane_from_normal: Matrix3
    normal_from_plane: Matrix3


class ScreenShift(NamedTuple):
    """Pixels on the screen, along a row and along a column."""

    dx: Float
    dy: Float


class Motion(NamedTuple):
    """How surfaces moved between two frames: `motion_table` on the device, and transforms; x' - x
    of a frame that has it."""

    table: Float
    transforms: ScreenTransforms
    pixels: ScreenShift | None = None


def motion_table(previous: Frame, current: Frame) -> np.ndarray:
    """(objects, 16) float32: E | S' t of each object, see the module's header; then whether it is
    at rest, 1 or 0, and zeros.

    An object whose matrix is singular, or that only one of the frames has, gets NaN: no history.
    """
    s_previous = screen_from_camera(previous)
    motion = world_motions(previous, current)
    t = previous.camera_from_world @ motion @ np.linalg.inv(current.camera_from_world)
    e = s_previous @ t[:, :3, :3] @ camera_from_screen(current) - np.eye(3)
    table = np.zeros((len(t), _ROW))
    table[:, :12] = np.concatenate([e, (t[:, :3, 3] @ s_previous.T)[..., None]], 2).reshape(-1, 12)
    rests = (motion == np.eye(4)).all((1, 2))
    if _same_view(previous, current):
        table[rests] = 0
    table[:, 12] = rests
    return table.astype(np.float32)


def _same_view(previous: Frame, current: Frame) -> bool:
    return (np.array_equal(previous.camera_from_world, current.camera_from_world)
            and np.array_equal(previous.screen_from_world, current.screen_from_world))


def load_table(table: np.ndarray, stencil: Stencil) -> Float:
    """The table on the device, with room for 64 objects, 128, 256, ... (one recording each)."""
    room = max(_FEWEST_OBJECTS, 1 << len(table).bit_length())
    padded = np.full((room, _ROW), np.nan, np.float32)
    padded[:len(table)] = table
    return stencil.table(padded)


def motion_between(previous: Frame, current: Frame, stencil: Stencil) -> Motion:
    """What `locate` asks for.

    Raises:
        InputError: the frames cannot follow one another, or their matrices do not project.
    """
    pixels = None
    if "motion" in current:
        pixels = ScreenShift(*stencil.load(np.asarray(current["motion"], np.float32)))
        evaluate(pixels)
    elif len(previous.world_from_object) != len(current.world_from_object):
        raise InputError(
            f"frame {current.index} has {len(current.world_from_object)} objects, the frame "
            f"before it {len(previous.world_from_object)}: they are not of one sequence")
    return Motion(load_table(motion_table(previous, current), stencil),
                  ScreenTransforms(opaque_matrix(stencil, camera_from_screen(current).T),
                                   opaque_matrix(stencil, screen_from_camera(previous).T)), pixels)


def without_images(frame: Frame) -> Frame:
    """What the next frame must know of one: its matrices."""
    return replace(frame, images={"id": frame["id"]})


def pack(stencil: Stencil, color: Color, surface: SurfaceSample) -> Float:
    """History of a frame: 8 words a lane, colour, ID, normal, depth."""
    return stencil.pack([*color, stencil.Float(surface.id), *surface.normal, surface.depth])


def _unpack(stencil: Stencil, history: Float, lane: UInt) -> tuple[Color, SurfaceSample]:
    """A record of `pack`."""
    red, green, blue, id_, nx, ny, nz, depth = stencil.unpack(history, lane, WORDS)
    return Color(red, green, blue), SurfaceSample(id_, Vector3(nx, ny, nz), depth)


@dataclass(frozen=True)
class Place:
    """Where each pixel's surface was: what a pixel of the previous frame must agree with.

    Attributes:
        x, y: screen position in the previous frame. inside: whether it is on that screen.
        id: object ID. normal: expected there. rough: whether there is no normal.
        plane, offset, nearness: a pixel at u' with depth z' is near the expected tangent plane
            if |z' plane . u' - offset| < nearness. rests: 1 where the object is at rest, else 0.
    """

    x: Float
    y: Float
    inside: Bool
    id: Float
    normal: Vector3
    rough: Bool
    plane: Vector3
    offset: Float
    nearness: Float
    rests: Float


def locate(stencil: Stencil, surface: SurfaceSample, motion: Motion, plane_tolerance: Float,
           shift: ScreenShift | None = None) -> Place:
    """Follow each surface back.

    Args:
        motion: of `motion_between`.
        shift: follow the point of the surface that far away on the screen, at that depth.
    """
    float_t, table = stencil.Float, motion.table
    id_, normal, depth = surface
    known = (id_ >= 0) & (id_ < dr.width(table) // _ROW)
    words = stencil.unpack(table, dr.select(known, id_, 0), _ROW, 13)
    e, translation = Matrix3(*[Vector3(*words[at:at + 3]) for at in (0, 4, 8)]), words[3:12:4]
    row, column = stencil.pixel()
    u = Vector3(float_t(column) + 0.5, float_t(row) + 0.5, float_t(1))
    if shift is not None:
        u = Vector3(u.x + shift.dx, u.y + shift.dy, u.z)
    inverse_depth = 1 / depth
    dx, dy, dw = (dr.fma(t, inverse_depth, dot(row, u)) for row, t in zip(e, translation))
    scale = 1 + dw
    shrink = 1 / scale
    x, y = dr.fma(dx - u.x * dw, shrink, u.x), dr.fma(dy - u.y * dw, shrink, u.y)
    if motion.pixels is not None:
        x, y = u.x + motion.pixels.dx, u.y + motion.pixels.dy
    inside = (known & (scale > 1e-6) & (x >= 0) & (x < stencil.width)
              & (y >= 0) & (y < stencil.height))
    x, y = dr.select(inside, x, 0.5), dr.select(inside, y, 0.5)
    is_known = dr.isfinite(scale)  # the table has NaN, and the background reads of it, too
    expected, plane = (Vector3(*[dr.select(is_known, c, 0) for c in v])
                       for v in _turned(e, normal, motion.transforms))
    depth = depth * scale
    return Place(x, y, inside, float_t(id_), expected, dot(normal, normal) <= 0.25, plane,
                 depth * dot(plane, Vector3(x, y, float_t(1))), plane_tolerance * depth,
                 dr.select(known & (words[12] > 0), float_t(1), 0))


class Reprojected(NamedTuple):
    """Colour of the previous frame, and the mask of pixels that have a history."""

    color: Color
    is_valid: Bool


def reproject(stencil: Stencil, surface: SurfaceSample, motion: Motion, history: Float,
              tests: ReprojectionTests, nearest: bool = False) -> Reprojected:
    """Colour of the previous frame where each pixel's surface was.

    Args:
        surface: of the current frame. motion: of `motion_between`.
        history: `pack` of the previous frame. nearest: one tap, tested by object alone.
    """
    at = locate(stencil, surface, motion, tests.plane_tolerance)
    if nearest:
        color, there = _unpack(stencil, history,
                               stencil.UInt(at.y) * stencil.stride + stencil.UInt(at.x))
        return Reprojected(color, at.inside & (there.id == at.id))

    left, top = dr.floor(at.x - 0.5), dr.floor(at.y - 0.5)
    columns, x_weights = _pair(left, at.x - 0.5 - left, stencil.width)
    rows, y_weights = _pair(top, at.y - 0.5 - top, stencil.height)
    at_corner = dot(at.plane, Vector3(left + 0.5, top + 0.5, stencil.Float(1)))
    sums, total = [stencil.Float(0)] * 3, stencil.Float(0)
    for i in (0, 1):
        for j in (0, 1):
            color, there = _unpack(stencil, history, stencil.UInt(rows[i]) * stencil.stride
                                   + stencil.UInt(columns[j]))
            at_tap = at_corner + (at.plane.x * j + at.plane.y * i)
            near = dr.abs(dr.fma(there.depth, at_tap, -at.offset)) < at.nearness
            turned = dot(at.normal, there.normal) > tests.min_cosine
            passes = (there.id == at.id) & (at.rough | (near & turned))
            weight = dr.select(passes, x_weights[j] * y_weights[i], 0)
            sums = [dr.fma(weight, c, s) for c, s in zip(color, sums)]
            total += weight
    valid = at.inside & (total >= LEAST_WEIGHT)
    scale = 1 / dr.select(valid, total, 1)
    return Reprojected(Color(*[s * scale for s in sums]), valid)


def _turned(e: Matrix3, normal: Vector3,
            transforms: ScreenTransforms) -> tuple[Vector3, Vector3]:
    """n', and B'^T n' with which n' . X' = z' (B'^T n') . u'.

    With F = I + E, a surface's B^T n turns by F^-T: its cofactors over its determinant, of which
    the sign matters alone.
    """
    f = Matrix3(*[Vector3(*[row[c] + 1 if c == r else row[c] for c in range(3)])
                  for r, row in enumerate(e)])
    flat = transform(transforms.plane_from_normal, normal)
    cofactors = Matrix3(cross(f.y, f.z), cross(f.z, f.x), cross(f.x, f.y))
    plane = Vector3(*[dr.mulsign(x, dot(f.x, cofactors.x)) for x in transform(cofactors, flat)])
    turned = transform(transforms.normal_from_plane, plane)
    length2 = dot(turned, turned)
    scale = dr.rsqrt(dr.select(length2 > 0, length2, 1))
    return Vector3(*[x * scale for x in turned]), Vector3(*[x * scale for x in plane])


def _pair(first: Float, fraction: Float, size: int) -> tuple[list[Float], list[Float]]:
    """Indices `first` and the next one, and their weights: 0, and another index, off the screen."""
    last = float(size - 1)
    return ([dr.select(first > 0, first, 0), dr.select(first < last, first + 1, last)],
            [dr.select(first >= 0, 1 - fraction, 0), dr.select(first < last, fraction, 0)])
