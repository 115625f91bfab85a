"""Bad pixels of the input replaced before anything is filtered."""

from __future__ import annotations

import numpy as np

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
