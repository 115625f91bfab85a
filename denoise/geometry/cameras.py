"""What a frame's matrices say about its view and its objects' motion, in NumPy alone.

Symbols: u = (x + 1/2, y + 1/2, 1) a pixel's centre on the screen; B = camera_from_screen (3x3);
M and M' world_from_object of an object, now and in the frame before.

Apart from the kernels, so that scores, which need no Dr.Jit, do not load it.
"""

from __future__ import annotations

import math

import numpy as np

from onespp.render.errors import InputError
from onespp.render.frame import Frame


def camera_from_screen(frame: Frame) -> np.ndarray:
    """B: (3, 3) float64 that maps a pixel's u to its camera-space position at depth 1.

    Raises:
        InputError: the frame's matrices are not those of a pinhole camera.
    """
    try:
        return np.linalg.inv(screen_from_camera(frame))
    except np.linalg.LinAlgError:
        raise InputError(f"the matrices of frame {frame.index} do not project to a screen: "
                         "screen_from_world is singular") from None


def screen_from_camera(frame: Frame) -> np.ndarray:
    """B^-1, (3, 3) float64: rows x, y and depth of u.

    A pinhole at the camera's origin has no fourth column.
    """
    try:
        world_from_camera = np.linalg.inv(frame.camera_from_world)
    except np.linalg.LinAlgError:
        raise InputError(f"camera_from_world of frame {frame.index} is singular") from None
    return (frame.screen_from_world @ world_from_camera)[[0, 1, 3], :3]


def pixel_angle(frame: Frame) -> float:
    """Width of a pixel at depth 1; its height and width differ little, this is their mean.

    Raises:
        InputError: as `camera_from_screen`.
    """
    (a, b), (c, d) = camera_from_screen(frame)[:2, :2]
    return math.sqrt(abs(a * d - b * c))


def every(frame: Frame, count: int) -> slice:
    """Rows, and columns, of about so many pixels, evenly spread."""
    step = max(1, round((frame.height * frame.width / count) ** 0.5))
    return slice(step // 2, None, step)


def camera_points(frame: Frame, some: slice) -> np.ndarray:
    """(rows, columns, 3) float64 camera-space positions of some rows and columns, not finite where
    the depth is not.

    Raises:
        InputError: as `camera_from_screen`.
    """
    b, depth = camera_from_screen(frame), frame["depth"][some, some]
    y, x = (np.arange(some.start, size, some.step)[:, None] + 0.5 for size in frame["id"].shape)
    ray = (y * b[:, 1])[:, None] + x * b[:, 0] + b[:, 2]
    with np.errstate(invalid="ignore", over="ignore"):
        return depth[..., None] * ray
