"""Primary rays and the camera's matrices.

One ray a pixel, through the pixel's centre: frames, G-buffers and references that pass through
the same points agree exactly, so that a score measures denoising and not anti-aliasing.

With jitter, all rays of a frame are moved by one offset (x, y) within the pixel. Its matrices then
say where a point lies on the screen *less that offset*: what a pixel shows projects to its centre,
and who reprojects by the matrices of two frames finds the right place without knowing of jitter.

Source of the offsets: Halton 1960, bases 2 and 3, as in Karis 2014, "High-quality temporal
supersampling" (SIGGRAPH course on advances in real-time rendering).
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import numpy as np

from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi
from onespp.scenes.description import Camera

Offset = tuple[float, float]
NO_JITTER: Offset = (0.0, 0.0)
PERIOD = 16  # frames after which offsets repeat: what went before weighs little then


def halton(frame: int) -> Offset:
    """The offset of a frame from pixels' centres, pixels, in [-1/2, 1/2) each."""
    index = frame % PERIOD + 1
    return _radical_inverse(index, 2) - 0.5, _radical_inverse(index, 3) - 0.5


def _radical_inverse(index: int, base: int) -> float:
    """The digits of a number mirrored at the point."""
    value, digit = 0.0, 1.0 / base
    while index:
        index, rest = divmod(index, base)
        value, digit = value + rest * digit, digit / base
    return value


@dataclass(frozen=True)
class CameraMatrices:
    """A camera at one frame, float64, world space."""

    camera_from_world: np.ndarray
    screen_from_world: np.ndarray


def camera_matrices(camera: Camera, frame: float, height: int, width: int,
                    jitter: Offset = NO_JITTER) -> CameraMatrices:
    camera_from_world = np.linalg.inv(camera.world_from_camera_at(frame))
    return CameraMatrices(camera_from_world,
                          _screen_from_camera(camera, height, width, jitter) @ camera_from_world)


def _screen_from_camera(camera: Camera, height: int, width: int, jitter: Offset) -> np.ndarray:
    moved = np.eye(4)
    moved[:2, 3] = -jitter[0], -jitter[1]
    return moved @ camera.screen_from_camera(height, width)


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


def pixel_rays(stage: MitsubaScene, height: int, width: int,
               jitter: Offset = NO_JITTER) -> PixelRays:
    """The camera's rays at the stage's frame, in the stage's space."""
    camera = stage.description.camera
    world_from_camera = camera.world_from_camera_at(stage.frame)
    screen_from_camera = _screen_from_camera(camera, height, width, jitter)
    projection = screen_from_camera[np.ix_([0, 1, 3], [0, 1, 2])]
    direction_from_screen = world_from_camera[:3, :3] @ np.linalg.inv(projection)
    origin = (world_from_camera[:3, 3] - stage.origin) / stage.unit
    columns = [_opaque(column) for column in direction_from_screen.T]
    return PixelRays(dr.opaque(mi.Float, stage.unit), mi.Point3f(_opaque(origin)),
                     (columns[0], columns[1], columns[2]))


def _opaque(vector: np.ndarray) -> mi.Vector3f:
    return mi.Vector3f(*(dr.opaque(mi.Float, float(value)) for value in vector))
