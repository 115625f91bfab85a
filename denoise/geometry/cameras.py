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
