"""What crops, flips and quarter turns of the picture do to images and to matrices.

A turn of the picture is a turn (or a mirror) C of the camera's x and y axes. The world is turned
with it, about the view of the clip's first frame: W = V_0^-1 C V_0, V camera_from_world. So cameras
are C V W^-1, which only turn and move (of the first frame: as before), objects are W M, normals are
turned by W, and the clip is what a camera would see in a turned, or mirrored, world. A crop shifts
the screen. Transforms of the screen are A; screen_from_world becomes A S W^-1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .motion import Matrices

DIRECTIONS, POINTS, ON_SCREEN = ("normal", "light", "layer_normal"), ("position",), ("motion",)
"""Channels of vectors in the world, of places in it, and of vectors in pixels."""


@dataclass(frozen=True)
class Turn:
    """One of the eight turns of a picture: transposed first, then flipped along x and along y."""

    transposed: bool = False
    flipped_x: bool = False
    flipped_y: bool = False

    @classmethod
    def number(cls, i: int) -> Turn:
        """The i-th of eight; the first four keep the shape, 0 everything."""
        return cls(bool(i & 4), bool(i & 1), bool(i & 2))

    @property
    def camera(self) -> np.ndarray:
        """C, (4, 4)."""
        matrix = np.eye(4)
        if self.transposed:
            matrix[:2] = matrix[1::-1]
        return np.diag([1 - 2 * self.flipped_x, 1 - 2 * self.flipped_y, 1, 1]) @ matrix

    def image(self, image: np.ndarray, axis: int) -> np.ndarray:
        """An image whose rows are along `axis`, its columns along the next."""
        if self.transposed:
            image = image.swapaxes(axis, axis + 1)
        flips = (axis,) * self.flipped_y + (axis + 1,) * self.flipped_x
        return np.flip(image, flips) if flips else image

    def screen(self, height: int, width: int) -> np.ndarray:
        """A, (4, 4), for a picture of that size before the turn."""
        if self.transposed:
            height, width = width, height
        matrix = self.camera
        matrix[0, 3], matrix[1, 3] = width * self.flipped_x, height * self.flipped_y
        return matrix

    def world(self, first: Matrices) -> np.ndarray:
        """W, (4, 4); of no turn exactly the identity."""
        if self == Turn():
            return np.eye(4)
        return np.linalg.inv(first.camera_from_world) @ self.camera @ first.camera_from_world

    def vectors(self, name: str, image: np.ndarray, world: np.ndarray) -> np.ndarray:
        """The values of a channel, which are as they were where they are no vectors."""
        if name in ON_SCREEN:
            return (image @ self.camera[:2, :2].T).astype(image.dtype)
        if name in DIRECTIONS:
            return (image @ world[:3, :3].T).astype(image.dtype)
        if name in POINTS:
            return (image @ world[:3, :3].T + world[:3, 3]).astype(image.dtype)
        return image


def seen_through(matrices: Matrices, origin: tuple[int, int], size: tuple[int, int], turn: Turn,
                 world: np.ndarray) -> Matrices:
    """The matrices of a crop that is turned.

    Args:
        origin: row and column of the crop's first pixel. size: its (height, width), before the
            turn. world: W.
    """
    shift = np.eye(4)
    shift[0, 3], shift[1, 3] = -origin[1], -origin[0]
    on_screen = matrices.screen_from_world.copy()
    # Homogeneous: x and y move by multiples of the depth, row 3.
    for a in (shift, turn.screen(*size)):
        on_screen = np.stack([a[0, :2] @ on_screen[:2] + a[0, 3] * on_screen[3],
                              a[1, :2] @ on_screen[:2] + a[1, 3] * on_screen[3],
                              on_screen[2], on_screen[3]])
    back = np.linalg.inv(world)
    return Matrices(turn.camera @ matrices.camera_from_world @ back, on_screen @ back,
                    world @ matrices.world_from_object)
