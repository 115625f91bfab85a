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

from dataclasses import dataclass

import drjit as dr
import numpy as np

from render.errors import InputError
from render.frame import Frame

from .stencil import Float, Stencil
from .view import camera_from_screen

GUIDES = ("normal", "depth", "id")
LUMINANCE = (0.2126, 0.7152, 0.0722)
_FARTHEST = 1e15  # a greater depth counts as background: its square would overflow


@dataclass(frozen=True)
class Surface:
    """Arrays of lanes, traced and not yet evaluated.

    Attributes:
        exists: mask, whether there is a surface.
        normal: n, three arrays. position: X, three arrays. depth: z. id: object ID, -1 for none.
        inverse_depth: 1 / z, 0 where nothing exists.
        plane: 1 / z of the tangent plane changes by plane[0] a column and plane[1] a row.
        plane_distance: n . X, the (negative) distance of the camera from the tangent plane.
    """

    exists: Float
    normal: list[Float]
    position: list[Float]
    depth: Float
    id: Float
    inverse_depth: Float
    plane: tuple[Float, Float]
    plane_distance: Float


def read_surface(frame: Frame, stencil: Stencil) -> Surface:
    """The guides of a frame on the lanes of a stencil.

    Raises:
        InputError: the frame lacks a guide, has another size, or its matrices don't project.
    """
    check_size(frame, stencil)
    (id_,) = stencil.load(np.ascontiguousarray(frame["id"], np.int32))
    (depth,) = stencil.load(np.asarray(frame["depth"], np.float32))
    world_normal = stencil.load(np.asarray(frame["normal"], np.float32))
    normal = transform(_opaque(stencil, frame.camera_from_world[:3, :3]), world_normal)
    length2 = dot(normal, normal)
    exists = (id_ >= 0) & (depth > 0) & (depth < _FARTHEST) & (length2 > 0.01) & (length2 < 100)
    scale = dr.rsqrt(dr.select(exists, length2, 1))
    normal = [dr.select(exists, n * scale, 0) for n in normal]
    depth = dr.select(exists, depth, 1)
    b = _opaque(stencil, camera_from_screen(frame))
    row, column = stencil.pixel()
    ray = transform(b, [stencil.Float(column) + 0.5, stencil.Float(row) + 0.5, stencil.Float(1)])
    position = [dr.select(exists, depth * r, 0) for r in ray]
    distance = dot(normal, position)
    safe = dr.select(dr.abs(distance) > 1e-3 * depth, distance, -1e-3 * depth)  # grazing: not 0
    plane = [dr.select(exists, dot(normal, [b[r][c] for r in range(3)]) / safe, 0) for c in (0, 1)]
    return Surface(exists, normal, position, depth, dr.select(exists, id_, -1),
                   dr.select(exists, 1 / depth, 0), (plane[0], plane[1]), safe)


def check_size(frame: Frame, stencil: Stencil) -> None:
    if (frame.height, frame.width) != (stencil.height, stencil.width):
        raise InputError(f"frame {frame.index} is {frame.width}x{frame.height}, the denoiser's "
                         f"state was made for {stencil.width}x{stencil.height}: make a new one")


def read_color(frame: Frame, stencil: Stencil) -> list[Float]:
    """The frame's colour as three arrays of lanes, repaired (see `repair`)."""
    check_size(frame, stencil)
    return stencil.load(repair(np.asarray(frame["color"], np.float32), frame["id"]))


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


def dot(a: list[Float], b: list[Float]) -> Float:
    return dr.fma(a[0], b[0], dr.fma(a[1], b[1], a[2] * b[2]))


def cross(a: list[Float], b: list[Float]) -> list[Float]:
    return [dr.fma(a[i], b[j], -(a[j] * b[i])) for i, j in ((1, 2), (2, 0), (0, 1))]


def transform(matrix: list[list[Float]], vector: list[Float]) -> list[Float]:
    return [dot(row, vector) for row in matrix]


def _opaque(stencil: Stencil, matrix: np.ndarray) -> list[list[Float]]:
    return [[stencil.opaque(x) for x in row] for row in matrix]


def luminance(color: list[Float]) -> Float:
    """Relative luminance of linear Rec. 709 radiance."""
    red, green, blue = LUMINANCE
    return dr.fma(color[0], red, dr.fma(color[1], green, color[2] * blue))
