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
from typing import NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.geometry.cameras import camera_from_screen
from onespp.denoise.jit.arrays import Bool, Float, Vector3
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.vector import dot, opaque_matrix, transform
from onespp.render.errors import InputError
from onespp.render.frame import Frame

GUIDES = ("normal", "depth", "id")
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
