"""Primary rays and the camera's matrices.

One ray a pixel, through the pixel's centre: frames, G-buffers and references that pass through
the same points agree exactly, so that a score measures denoising and not anti-aliasing.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import numpy as np

from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi
from onespp.scenes.description import Camera


@dataclass(frozen=True)
class CameraMatrices:
    """A camera at one frame, float64, world space."""

    camera_from_world: np.ndarray
    screen_from_world: np.ndarray


def camera_matrices(camera: Camera, frame: float, height: int, width: int) -> CameraMatrices:
    camera_from_world = np.linalg.inv(camera.world_from_camera_at(frame))
    screen_from_camera = camera.screen_from_camera(height, width)
    return CameraMatrices(camera_from_world, screen_from_camera @ camera_from_world)


@dataclass
class PixelRays:
    """Rays through points of the image plane; all members are opaque (no new kernel a frame).

    The unnormalised direction of the ray through screen point (x, y) is
    `columns @ (x, y, 1)`; its camera-space z is 1. `unit`: world units in one of the stage's.
    """

    unit: mi.Float
    origin: mi.Point3f
    columns: tuple[mi.Vector3f, mi.Vector3f, mi.Vector3f]

    def at(self, x: mi.Float, y: mi.Float) -> tuple[mi.Ray3f, mi.Float]:
        """The ray, and the camera-space depth, in world units, of one unit of its length."""
        cx, cy, c1 = self.columns
        direction = dr.fma(cx, x, dr.fma(cy, y, c1))
        scale = dr.rcp(dr.norm(direction))
        return mi.Ray3f(self.origin, direction * scale), scale * self.unit


def pixel_rays(stage: MitsubaScene, height: int, width: int) -> PixelRays:
    """The camera's rays at the stage's frame, in the stage's space."""
    camera = stage.description.camera
    world_from_camera = camera.world_from_camera_at(stage.frame)
    projection = camera.screen_from_camera(height, width)[np.ix_([0, 1, 3], [0, 1, 2])]
    direction_from_screen = world_from_camera[:3, :3] @ np.linalg.inv(projection)
    origin = (world_from_camera[:3, 3] - stage.origin) / stage.unit
    columns = [_opaque(column) for column in direction_from_screen.T]
    return PixelRays(dr.opaque(mi.Float, stage.unit), mi.Point3f(_opaque(origin)),
                     (columns[0], columns[1], columns[2]))


def _opaque(vector: np.ndarray) -> mi.Vector3f:
    return mi.Vector3f(*(dr.opaque(mi.Float, float(value)) for value in vector))
