"""Errors of one image against its reference, pixel by pixel."""

from __future__ import annotations

import numpy as np

PSNR_CAP = 150.0
"""dB of identical images, whose PSNR is infinite. A float32 image with values up to 1 is itself
uncertain by 144 dB, so nothing real reaches it, and means, files and plots stay finite."""
RELMSE_FLOOR = SMAPE_FLOOR = 0.01


def mse(a: np.ndarray, b: np.ndarray) -> float:
    """Mean squared error, mean((a - b)^2), of any space.

    Example:
        >>> mse(np.zeros((2, 2, 3)), np.full((2, 2, 3), 0.5))
        0.25
    """
    return float(np.mean(np.square(np.subtract(a, b, dtype=np.float64))))


def decibels(error: float) -> float:
    """-10 log10(error), the PSNR of a mean squared error with peak 1, at most `PSNR_CAP`.

    Example:
        >>> decibels(0.001), decibels(0.0)
        (30.0, 150.0)
    """
    return float(min(PSNR_CAP, -10 * np.log10(error))) if error > 0 else PSNR_CAP


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB, peak 1: 10 log10(1 / mse(a, b)).

    Args:
        a, b: (h, w, 3) display values in [0, 1].
    Example:
        >>> round(psnr(np.full((4, 4, 3), 0.5), np.full((4, 4, 3), 0.6)), 6)
        20.0
    """
    return decibels(mse(a, b))


def relmse(a: np.ndarray, b: np.ndarray) -> float:
    """Relative mean squared error, mean((a - b)^2 / (b^2 + 0.01)), of linear radiance.

    Source: Rousselle et al. 2011, "Adaptive sampling and reconstruction using greedy error
    minimization", ACM TOG 30 (6), article 159.

    Example:
        >>> round(relmse(np.full((2, 2, 3), 1.0), np.full((2, 2, 3), 2.0)), 4)
        0.2494
    """
    b = np.asarray(b, np.float64)
    return float(np.mean((a - b) ** 2 / (b ** 2 + RELMSE_FLOOR)))


def smape(a: np.ndarray, b: np.ndarray) -> float:
    """Symmetric mean absolute percentage error of linear radiance, as a share in [0, 1].

        mean(|a - b| / (|a| + |b| + 0.01))

    Source: Vogels et al. 2018, "Denoising with kernel prediction and asymmetric loss functions",
    doi:10.1145/3197517.3201388.

    Example:
        >>> round(smape(np.full((2, 2, 3), 1.0), np.full((2, 2, 3), 3.0)), 4)
        0.4988
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    return float(np.mean(np.abs(a - b) / (np.abs(a) + np.abs(b) + SMAPE_FLOOR)))


def energy_error(a: np.ndarray, b: np.ndarray) -> float | None:
    """|mean(a) / mean(b) - 1| of linear radiance; None for a black reference.

    Example:
        >>> energy_error(np.full((2, 2, 3), 0.75), np.ones((2, 2, 3)))
        0.25
    """
    mean = np.mean(b, dtype=np.float64)
    return float(abs(np.mean(a, dtype=np.float64) / mean - 1)) if mean > 0 else None
