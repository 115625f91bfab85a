"""The camera that saw a frame's world positions: matrices for renderers that write none.

Symbols: X a pixel's position in world space, (u, v) its centre; P the 3x4 matrix with
w (u, v, 1) = P (X, 1), w the depth once its third row has length 1.

P is that of least algebraic error over some of the pixels (direct linear transform, Hartley and
Zisserman 2003, section 7.1, of normalized points), and again of those that it fits to `_NEAR`
pixels: silhouettes and filtered edges fit nothing. Positions in one plane leave P open.
"""

from __future__ import annotations

import numpy as np

_SAMPLES = 4000
FEWEST = 32
_NEAR = 2.0   # pixels
_FITS = 1.0   # median, of samples anywhere in their pixels
_OPEN = 1e-5  # of the largest: a second solution's error
_ROUNDS = 4


def camera_of_positions(position: np.ndarray,
                        shown: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """camera_from_world and screen_from_world, (4, 4) float64; None where they do not follow.

    Args:
        position: (h, w, 3). shown: (h, w) mask of pixels that show a surface.
    """
    h, w = shown.shape
    at = np.flatnonzero(shown & np.isfinite(position).all(-1))
    if at.size < FEWEST:
        return None
    at = at[np.linspace(0, at.size - 1, min(at.size, _SAMPLES)).astype(np.int64)]
    u = np.stack([at % w + 0.5, at // w + 0.5], -1)
    x = position.reshape(-1, 3)[at].astype(np.float64)
    near = np.ones(at.size, bool)
    p = np.zeros((3, 4))
    for _ in range(_ROUNDS):
        if near.sum() < FEWEST or (found := _fitted(x[near], u[near], (h, w))) is None:
            return None
        p = found
        off = _off(p, x, u)
        near = off < max(_NEAR, 2 * float(np.median(off)))
    if not np.median(_off(p, x, u)) < _FITS:
        return None
    return _camera(p, x)


def _fitted(x: np.ndarray, u: np.ndarray, size: tuple[int, int]) -> np.ndarray | None:
    """P of (n, 3) points at (n, 2) pixels, up to a factor; None where it is open."""
    middle, scale = x.mean(0), float(np.abs(x - x.mean(0)).mean()) or 1.0
    half = np.array([size[1], size[0]]) / 2
    points = np.concatenate([(x - middle) / scale, np.ones((len(x), 1))], -1)
    seen = u / half.max() - half / half.max()
    rows = np.zeros((2, len(x), 12))
    for axis in range(2):
        rows[axis, :, 4 * axis:4 * axis + 4] = points
        rows[axis, :, 8:] = -seen[:, axis, None] * points
    rows = rows.reshape(-1, 12)
    values, vectors = np.linalg.eigh(rows.T @ rows / len(x))
    if values[1] < max(_OPEN * values[-1], 4 * values[0]):
        return None
    p = vectors[:, 0].reshape(3, 4)
    unscale = np.diag([1 / scale] * 3 + [1.0])
    unscale[:3, 3] = -middle / scale
    screen = np.array([[half.max(), 0, half[0]], [0, half.max(), half[1]], [0, 0, 1]])
    return screen @ p @ unscale


def _off(p: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """How far off its pixel each point is, pixels."""
    at = x @ p[:, :3].T + p[:, 3]
    with np.errstate(all="ignore"):
        off = np.abs(at[:, :2] / at[:, 2:] - u).max(-1)
    return np.where(np.isfinite(off), off, np.inf)


def _camera(p: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """P with depth as w, as two matrices; camera space has x right, y down, z forward."""
    p = p / np.linalg.norm(p[2, :3])
    if np.median(x @ p[2, :3] + p[2, 3]) < 0:
        p = -p
    z = p[2, :3]
    axes = [z]
    for row in p[:2, :3]:
        axis = row - sum((row @ other) * other for other in axes)
        axes.append(axis / np.linalg.norm(axis))
    rotation = np.stack([axes[1], axes[2], z])
    origin = -np.linalg.solve(p[:, :3], p[:, 3])
    camera, screen = np.eye(4), np.eye(4)
    camera[:3, :3], camera[:3, 3] = rotation, -rotation @ origin
    screen[0], screen[1], screen[2], screen[3] = p[0], p[1], (0, 0, 0, 1), p[2]
    return camera, screen
