"""The one statistical test: do two Monte Carlo estimates have the same mean?

The chance that a correct renderer fails a whole image is ERROR_RATE; it is shared out over the
pixels and components compared (Sidak).
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np

ERROR_RATE = 1e-3


def mean_and_variance(replicates: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Mean of independent replicates, and the variance of that mean."""
    stack = np.asarray(replicates, np.float64)
    return stack.mean(0), stack.var(0, ddof=1) / len(stack)


def blocks(image: np.ndarray, size: int) -> np.ndarray:
    """Means over size x size blocks of an (h, w, c) image: nearly normal, and fewer tests."""
    h, w, c = image.shape
    whole = image[: h - h % size, : w - w % size]
    return whole.reshape(h // size, size, w // size, size, c).mean((1, 3))


def assert_same_mean(mean_a, variance_a, mean_b, variance_b: np.ndarray | float = 0.0) -> None:
    """z-test of every component; fails for a difference that chance does not explain."""
    difference = np.asarray(mean_a, np.float64) - mean_b
    deviation = np.sqrt(np.asarray(variance_a, np.float64) + variance_b)
    # Components without variance (unlit, or known exactly) must agree to rounding.
    z = np.abs(difference) / np.maximum(deviation, 1e-6 * (1 + np.abs(mean_b)))
    limit = -NormalDist().inv_cdf(0.5 * (1 - (1 - ERROR_RATE) ** (1 / z.size)))
    worst = np.unravel_index(z.argmax(), z.shape)
    assert z.max() < limit, (f"z = {z.max():.1f} at {worst} (limit {limit:.1f}): "
                             f"{np.broadcast_to(mean_a, z.shape)[worst]:.6g} against "
                             f"{np.broadcast_to(mean_b, z.shape)[worst]:.6g}; "
                             f"overall {np.mean(mean_a):.6g} against {np.mean(mean_b):.6g}")
