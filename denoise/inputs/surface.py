"""What a frame's guides say about the surface in each pixel, in camera space.

Symbols: u = (x + 1/2, y + 1/2, 1) a pixel's centre on the screen; z camera-space depth; X
position; n unit normal; B = camera_from_screen (3x3), so that X = z B u.

Positions are rebuilt from the depth, relative to the camera: float32 world positions of a scene
1e6 units from the origin are 0.06 units apart. Filters only use differences of positions and
angles between normals, which are the same in camera space as in world space.

A pixel has a surface where its object ID is not negative, its depth is positive and its normal
has a direction; where one of these is missing or not finite it counts as background, with n = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.geometry.cameras import camera_from_screen
from onespp.denoise.jit.arrays import Bool, Color, Float, Matrix3, Vector3
from onespp.denoise.jit.grid import Stencil
from onespp.render.errors import InputError
from onespp.render.frame import Frame

GUIDES = ("normal", "depth", "id")
LUMINANCE = (0.2126, 0.7152, 0.0722)
_FARTHEST = 1e15  # a greater depth counts as background: its square would overflow


class SurfaceSample(NamedTuple):
    """What a pixel of another frame must agree with: object ID, -1 for none; n; z."""

    id: Float
    normal: Vector3
    depth: Float


class InverseDepthSlope(NamedTuple):
    """Change of the tangent plane's 1/z a column and a row."""

    dx: Float
    dy: Float


class TangentPlane(NamedTuple):
    """1/z of a surface's tangent plane on the screen, and how far from it a pixel may lie.

    Attributes:
        inverse_depth: 1/z at the pixel. dx, dy: its change a column and a row.
        scale: of a difference of 1/z, to the distance from the plane in tolerated ones.
    """

    inverse_depth: Float
    dx: Float
    dy: Float
    scale: Float


@dataclass(frozen=True)
class Surface:
    """Arrays of lanes, traced and not yet evaluated.

    Attributes:
        is_valid: mask, whether there is a surface.
        normal: n. position: X. depth: z. id: object ID, -1 for none.
        inverse_depth: 1 / z, 0 where there is no surface. slope: of the tangent plane's 1 / z.
        plane_distance: n . X, the (negative) distance of the camera from the tangent plane.
    """

    is_valid: Bool
    normal: Vector3
    position: Vector3
    depth: Float
    id: Float
    inverse_depth: Float
    slope: InverseDepthSlope
    plane_distance: Float

    @property
    def sample(self) -> SurfaceSample:
        return SurfaceSample(self.id, self.normal, self.depth)


def read_surface(frame: Frame, stencil: Stencil) -> Surface:
    """The guides of a frame on the lanes of a stencil.

    Raises:
        InputError: the frame lacks a guide, has another size, or its matrices don't project.
    """
    check_size(frame, stencil)
    (id_,) = stencil.load(np.ascontiguousarray(frame["id"], np.int32))
    (depth,) = stencil.load(np.asarray(frame["depth"], np.float32))
    world_normal = Vector3(*stencil.load(np.asarray(frame["normal"], np.float32)))
    normal = transform(opaque_matrix(stencil, frame.camera_from_world[:3, :3]), world_normal)
    length2 = dot(normal, normal)
    is_valid = (id_ >= 0) & (depth > 0) & (depth < _FARTHEST) & (length2 > 0.01) & (length2 < 100)
    scale = dr.rsqrt(dr.select(is_valid, length2, 1))
    normal = Vector3(*[dr.select(is_valid, n * scale, 0) for n in normal])
    depth = dr.select(is_valid, depth, 1)
    b = opaque_matrix(stencil, camera_from_screen(frame))
    row, column = stencil.pixel()
    ray = transform(b, Vector3(stencil.Float(column) + 0.5, stencil.Float(row) + 0.5,
                               stencil.Float(1)))
    position = Vector3(*[dr.select(is_valid, depth * r, 0) for r in ray])
    distance = dot(normal, position)
    safe = dr.select(dr.abs(distance) > 1e-3 * depth, distance, -1e-3 * depth)  # grazing: not 0
    dx, dy, _ = (dr.select(is_valid, dot(normal, Vector3(*column)) / safe, 0)
                 for column in zip(*b))
    return Surface(is_valid, normal, position, depth, dr.select(is_valid, id_, -1),
                   dr.select(is_valid, 1 / depth, 0), InverseDepthSlope(dx, dy), safe)


def check_size(frame: Frame, stencil: Stencil) -> None:
    if (frame.height, frame.width) != (stencil.height, stencil.width):
        raise InputError(f"frame {frame.index} is {frame.width}x{frame.height}, the denoiser's "
                         f"state was made for {stencil.width}x{stencil.height}: make a new one")


def read_color(frame: Frame, stencil: Stencil) -> Color:
    """The frame's colour, repaired (see `repair`)."""
    check_size(frame, stencil)
    return Color(*stencil.load(repair(np.asarray(frame["color"], np.float32), frame["id"])))


LARGEST = 1e18       # radiance beyond this is taken for a bad pixel: its square would overflow
_REPAIR_RADIUS = 8   # pixels


def repair(color: np.ndarray, id_: np.ndarray) -> np.ndarray:
    """Replace each bad pixel by the mean of the good ones around it.

    Bad: a component that is not finite, or beyond 1e18. The mean is over pixels of the same
    object in a 3x3 window, or 5x5, 7x7, up to 17x17 until there is one; 0 if there is none.
    A bad pixel so stays one pixel, and no kernel needs to know of it.
    """
    flat = color.ravel()
    with np.errstate(over="ignore", invalid="ignore"):
        if np.dot(flat, flat) <= LARGEST**2:  # false for NaN; quicker than to compare
            return color
    good = np.asarray((np.abs(color) <= LARGEST).all(axis=2))
    repaired = np.where(good[..., None], color, 0)
    y, x = np.nonzero(~good)
    for radius in range(1, _REPAIR_RADIUS + 1):
        total, count = _sums_around(repaired, good, id_, y, x, radius)
        found = count > 0
        repaired[y[found], x[found]] = total[found] / count[found, None]
        y, x = y[~found], x[~found]
    return repaired


def _sums_around(color: np.ndarray, good: np.ndarray, id_: np.ndarray, y: np.ndarray, x: np.ndarray,
                 radius: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, c) sum and (n,) number of good pixels of the same object around pixels (y, x)."""
    total, count = np.zeros((len(y), color.shape[2])), np.zeros(len(y))
    height, width = good.shape
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            ty, tx = y + dy, x + dx
            inside = (ty >= 0) & (ty < height) & (tx >= 0) & (tx < width)
            there = np.where(inside, ty, 0), np.where(inside, tx, 0)
            usable = inside & good[there] & (id_[there] == id_[y, x])
            total += np.where(usable[:, None], color[there], 0)
            count += usable
    return total, count


def dot(a: Vector3, b: Vector3) -> Float:
    return dr.fma(a.x, b.x, dr.fma(a.y, b.y, a.z * b.z))


def cross(a: Vector3, b: Vector3) -> Vector3:
    return Vector3(*[dr.fma(a[i], b[j], -(a[j] * b[i])) for i, j in ((1, 2), (2, 0), (0, 1))])


def transform(matrix: Matrix3, vector: Vector3) -> Vector3:
    return Vector3(*[dot(row, vector) for row in matrix])


def opaque_matrix(stencil: Stencil, matrix: np.ndarray) -> Matrix3:
    """A (3, 3) matrix that a kernel takes as an argument."""
    return Matrix3(*[Vector3(*[stencil.opaque(x) for x in row]) for row in matrix])


def luminance(color: Sequence[Float]) -> Float:
    """Relative luminance of linear Rec. 709 radiance."""
    red, green, blue = LUMINANCE
    return dr.fma(color[0], red, dr.fma(color[1], green, color[2] * blue))
