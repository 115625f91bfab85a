"""Where surfaces were on the screen of the frame before, in pixels, as the matrices say.

Symbols: u = (x + 1/2, y + 1/2, 1) a pixel's centre, z its depth, S rows x, y and depth of
screen_from_world, ' the frame before, M world_from_object of the pixel's object. The surface is at
P, S P = z u; it was at M' M^-1 P, and seen at S' M' M^-1 P. What is seen where there is no surface
is infinitely far: S_3 d = u, and it was seen at S'_3 d, of the first three columns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from onespp.denoise.geometry.motion import inverses


@dataclass(frozen=True)
class Matrices:
    """Of a frame: camera_from_world, screen_from_world (4, 4), world_from_object (n, 4, 4)."""

    camera_from_world: np.ndarray
    screen_from_world: np.ndarray
    world_from_object: np.ndarray


def motion_in_pixels(before: Matrices, now: Matrices, depth: np.ndarray, id: np.ndarray,
                     origin: tuple[int, int] = (0, 0), step: int = 1) -> np.ndarray:
    """(h, w, 2) float32 from each pixel's centre to where its surface was, x right and y down.

    0 where that cannot be told: behind the camera, or of an object that had no size.

    Args:
        depth, id: (h, w). origin: row and column of their first pixel on the matrices' screen.
        step: of that many pixels each of them is the first.
    """
    s, s_before = (m.screen_from_world[[0, 1, 3]] for m in (now, before))
    world_from_screen = np.linalg.inv(s[:, :3])
    y, x = step * np.indices(depth.shape) + 0.5
    u = np.stack([x + origin[1], y + origin[0], np.ones_like(x)], axis=-1)
    surface = (id >= 0) & (depth > 0)
    seen = u @ (s_before[:, :3] @ world_from_screen).T
    moved = before.world_from_object @ inverses(now.world_from_object)
    for i in np.unique(id[surface]):
        at = surface & (id == i)
        point = (u[at] * depth[at, None].astype(np.float64) - s[:, 3]) @ world_from_screen.T
        still = np.array_equal(before.world_from_object[i], now.world_from_object[i])
        to_screen = s_before if still else s_before @ moved[i]
        seen[at] = point @ to_screen[:, :3].T + to_screen[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        motion = seen[..., :2] / seen[..., 2:] - u[..., :2]
    told = (seen[..., 2:] > 0) & np.isfinite(motion).all(axis=-1, keepdims=True)
    return np.where(told, motion, 0).astype(np.float32)
