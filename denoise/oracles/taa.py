"""Temporal anti-aliasing in float64 NumPy, a pixel at a time; see denoise/methods/antialiasing/."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from onespp.denoise.geometry.cameras import screen_from_camera
from onespp.render.frame import Frame

from .filters import previous_screen

YCOCG = np.array([[0.25, 0.5, 0.25], [0.5, 0, -0.5], [-0.25, 0.5, -0.25]])


def taa(frames: Sequence[Frame], colors: Sequence[np.ndarray] | None = None, alpha: float = 0.2,
        k: float = 1.0) -> np.ndarray:
    """(h, w, 3) of the last frame; colors: what is blended, instead of the frames' own."""
    images = [np.asarray(c, np.float64) for c in colors or [f["color"] for f in frames]]
    history = images[0]
    for previous, frame, color in zip(frames, frames[1:], images[1:]):
        history = resolve(previous, frame, color, history, alpha, k)
    return history


def resolve(previous: Frame, frame: Frame, color: np.ndarray, history: np.ndarray, alpha: float,
            k: float) -> np.ndarray:
    h, w, _ = color.shape
    centers = [np.array(screen_from_camera(f)[:2, 2]) / screen_from_camera(f)[2, 2]
               for f in (previous, frame)]
    screen, result = previous_screen(previous, frame), color.copy()
    inside = ((screen[..., 2] > 0) & (screen[..., 0] >= 0) & (screen[..., 0] < w)
              & (screen[..., 1] >= 0) & (screen[..., 1] < h))
    for y in range(h):
        for x in range(w):
            around = [(y, x), *[(y + dy, x + dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)
                                if (dy or dx) and 0 <= y + dy < h and 0 <= x + dx < w]]
            moved = [q for q in around if inside[q]]
            if not moved:
                continue
            q = min(moved, key=lambda q: frame["depth"][q])
            motion = screen[q][:2] - (q[1] + 0.5, q[0] + 0.5) + centers[1] - centers[0]
            at = np.array((x + 0.5, y + 0.5)) + motion
            if not (0 <= at[0] < w and 0 <= at[1] < h):
                continue
            old = YCOCG @ catmull_rom(history, *at)
            near = color[max(y - 1, 0):y + 2, max(x - 1, 0):x + 2].reshape(-1, 3) @ YCOCG.T
            mean, reach = near.mean(0), k * near.std(0)
            excess = max(1, *(abs(old - mean) / np.maximum(reach, 1e-20)))
            clipped = np.linalg.solve(YCOCG, mean + (old - mean) / excess)
            result[y, x] = alpha * color[y, x] + (1 - alpha) * clipped
    return result


def catmull_rom(image: np.ndarray, x: float, y: float) -> np.ndarray:
    """The image at a screen position, along rows, then along columns, held between the two values
    around it each time."""
    h, w, _ = image.shape
    left, top = int(np.floor(x - 0.5)), int(np.floor(y - 0.5))
    columns = np.clip(np.arange(left - 1, left + 3), 0, w - 1)
    rows = np.clip(np.arange(top - 1, top + 3), 0, h - 1)
    taps = image[np.ix_(rows, columns)]
    along_rows = np.einsum("j,ijc->ic", _kernel(x - 0.5 - np.arange(left - 1, left + 3)), taps)
    along_rows = along_rows.clip(taps[:, 1:3].min(1), taps[:, 1:3].max(1))
    value = np.einsum("i,ic->c", _kernel(y - 0.5 - np.arange(top - 1, top + 3)), along_rows)
    return np.clip(value, along_rows[1:3].min(0), along_rows[1:3].max(0))


def _kernel(distance: np.ndarray) -> np.ndarray:
    """The Catmull-Rom spline at a distance from a pixel."""
    d = np.abs(distance)
    return np.where(d < 1, 1.5 * d**3 - 2.5 * d**2 + 1,
                    np.where(d < 2, -0.5 * d**3 + 2.5 * d**2 - 4 * d + 2, 0))
