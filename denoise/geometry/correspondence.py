"""Which pixel of the previous frame shows the surface of each pixel, for scoring: exact, float64.

Symbols as in `reprojection.py`: ' the previous frame, u a pixel's centre, z depth, B
camera_from_screen, M world_from_object; X' = V' M'_id M_id^-1 V^-1 (z B u) is where the surface
was, in camera space, and it was seen in the pixel that X' falls into.

Where a frame has a channel `motion`, it was seen where that says, at the depth of X'.

Nearest pixel, not interpolation: a mean of four pixels has less noise than one, and would flatter
a noisy method wherever something moves.

That pixel counts if it shows the same object, with a normal within 26 degrees of the expected and
within 2 % of the depth of its tangent plane.
"""

from __future__ import annotations

import numpy as np

from onespp.render.frame import Frame

from .cameras import camera_from_screen
from .motion import world_motions

GUIDES = ("normal", "depth", "id")
MIN_COSINE, PLANE_TOLERANCE = 0.9, 0.02
NOWHERE = -1


def has_surface(frame: Frame) -> np.ndarray:
    """(h, w) mask of pixels with an object, a positive depth and a normal."""
    depth, normal = frame["depth"], frame["normal"]
    with np.errstate(invalid="ignore"):
        return ((frame["id"] >= 0) & (depth > 0) & np.isfinite(depth)
                & (np.abs(normal).sum(axis=-1) > 0.1) & np.isfinite(normal).all(axis=-1))


def previous_pixel(previous: Frame, current: Frame) -> np.ndarray:
    """(h, w) int64: row * w + column in `previous` of each pixel's surface; `NOWHERE` if unseen.

    Raises:
        InputError: a guide is missing, or matrices that do not project.
    """
    h, w = current.height, current.width
    source, motions = np.full(h * w, NOWHERE), world_motions(previous, current)
    if "motion" not in current and len(previous.world_from_object) != len(motions):
        return source.reshape(h, w)
    ids = np.where(has_surface(current), current["id"], -1).ravel()
    b = camera_from_screen(current)
    for i in np.unique(ids[ids >= 0]):
        motion = motions[i]
        if np.isnan(motion).any() or np.linalg.det(motion[:3, :3]) == 0:  # to or from no size
            continue
        at = np.flatnonzero(ids == i)
        u = np.stack([at % w + 0.5, at // w + 0.5, np.ones(at.size)], axis=-1)
        position = current["depth"].ravel()[at, None] * (u @ b.T)
        source[at] = _seen(previous, current, int(i), motion, position, at)
    return source.reshape(h, w)


def _seen(previous: Frame, current: Frame, i: int, motion: np.ndarray, position: np.ndarray,
          at: np.ndarray) -> np.ndarray:
    """Where the points `position` (n, 3) of object i, in current camera space, were seen."""
    h, w = previous.height, previous.width
    still = np.array_equal(previous.camera_from_world, current.camera_from_world)
    t = previous.camera_from_world @ motion @ np.linalg.inv(current.camera_from_world)
    t = np.eye(4) if still and np.array_equal(motion, np.eye(4)) else t
    was = position @ t[:3, :3].T + t[:3, 3]
    b = camera_from_screen(previous)
    screen = was @ np.linalg.inv(b).T
    with np.errstate(divide="ignore", invalid="ignore"):
        seen_at = screen[:, :2] / screen[:, 2:]
        if "motion" in current:
            u = np.stack([at % w + 0.5, at // w + 0.5], axis=-1)
            seen_at = u + current["motion"].reshape(-1, 2)[at]
            was = was[:, 2:] * (np.pad(seen_at, ((0, 0), (0, 1)), constant_values=1) @ b.T)
        x, y = np.floor(seen_at).T
    inside = (was[:, 2] > 0) & (x >= 0) & (x < w) & (y >= 0) & (y < h)
    x, y = (np.where(inside, c, 0).astype(np.int64) for c in (x, y))
    tap = y * w + x
    there = previous["depth"].ravel()[tap, None] * (np.stack(
        [x + 0.5, y + 0.5, np.ones(x.size)], axis=-1) @ b.T)
    normal = np.nan_to_num(previous["normal"].reshape(-1, 3)[tap].astype(np.float64), posinf=0)
    expected = current["normal"].reshape(-1, 3)[at] @ np.linalg.inv(motion[:3, :3])
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    off_plane = np.abs(np.sum(normal @ previous.camera_from_world[:3, :3].T * (there - was), -1))
    same = ((previous["id"].ravel()[tap] == i) & (np.sum(expected * normal, -1) > MIN_COSINE)
            & (off_plane < PLANE_TOLERANCE * was[:, 2]))
    return np.where(inside & same & has_surface(previous).ravel()[tap], tap, NOWHERE)


def carry(image: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The previous frame's (h, w) or (h, w, c) image at each pixel's source; nowhere: anything."""
    flat = image.reshape(-1, *image.shape[2:])
    return flat[np.maximum(source, 0)]
