"""What a perfect image would get against a noisy reference: PSNR, FLIP and SSIM."""

from __future__ import annotations

import numpy as np

from .errors import decibels, mse
from .image import blacken, non_finite
from .perceptual.flip import flip
from .perceptual.ssim import ssim
from .tonemap import srgb_from_linear


def reference_floor(reference: np.ndarray, variance: np.ndarray, nodes: int = 5) -> float:
    """PSNR (clipped sRGB) that a perfect image is expected to get against a noisy reference.

    No method can be seen to be better than this; one within a few dB of it is underrated. It is
    the dB of E[(S(b) - S(b + e))^2], e ~ N(0, variance): the mean of many samples is close to
    Gaussian, and b stands in for the unknown truth around which it lies. Gauss-Hermite quadrature
    follows S through its toe and its clip, where S'(b)^2 variance (the delta method) doesn't.

    Args:
        reference: (h, w, 3) linear radiance. variance: (h, w, 3) of the mean, radiance^2.
        nodes: points of the quadrature.
    Returns:
        dB, at most `PSNR_CAP`. Where most pixels of a reference are uncertain by 20 % and more,
        b's own noise makes it off by up to 0.5 dB.
    Example:
        >>> round(reference_floor(np.full((4, 4, 3), 0.5), np.full((4, 4, 3), 1e-4)), 1)
        43.6
    """
    x, weights = np.polynomial.hermite_e.hermegauss(nodes)
    b = blacken(reference, non_finite(reference))
    sigma = np.sqrt(np.maximum(np.nan_to_num(variance, nan=0.0, posinf=0.0), 0.0))
    display = srgb_from_linear(b)
    error = sum(w * mse(srgb_from_linear(b + np.float32(t) * sigma), display)
                for t, w in zip(x, weights / weights.sum()))
    return decibels(error)


def seen_floors(parts: np.ndarray) -> tuple[float, float]:
    """FLIP and SSIM that a perfect image is expected to get against the mean of four parts.

    Measured, not derived: with v the variance of the mean, P_0 and P_1 differ as a perfect image
    and a reference of variance 8 v do, halves A and B as with 4 v. Through these two goes a power
    of v, and two halvings more lead to v itself.

    Args:
        parts: (4, h, w, 3) linear radiance.
    """
    display = srgb_from_linear(parts)
    half = srgb_from_linear((parts[0] + parts[1]) / 2), srgb_from_linear((parts[2] + parts[3]) / 2)
    coarse = [(flip(a, b), 1 - ssim(a, b)) for a, b in (display[:2], display[2:])]
    fine = flip(*half), 1 - ssim(*half)
    floors = [_down(float(np.mean([pair[k] for pair in coarse])), fine[k]) for k in (0, 1)]
    return floors[0], 1 - floors[1]


def _down(coarse: float, fine: float) -> float:
    """Two halvings of the variance further on, as the last one went."""
    return fine * min(1.0, fine / coarse) ** 2 if coarse > 0 else 0.0
