"""Structural similarity of display values, for each colour.

    SSIM = (2 m_a m_b + C1) (2 s_ab + C2) / ((m_a^2 + m_b^2 + C1) (s_a^2 + s_b^2 + C2))

m, s^2 and s_ab are means, variances and covariance under a Gaussian of sigma 1.5 pixels cut to
11x11; C1 = 0.01^2, C2 = 0.03^2. The score is the mean over colours and over pixels whose window
lies inside the image; a smaller image is mirrored at its border and counted whole.

Source: Wang et al. 2004, "Image quality assessment: from error visibility to structural
similarity", doi:10.1109/TIP.2003.819861. The same as scikit-image's
`structural_similarity(gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1,
channel_axis=2)` to 1e-6, without its dependencies; in float32, three times as fast.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .banded import Band

RADIUS, SIGMA = 5, 1.5
C1, C2 = 0.01**2, 0.03**2

_GREY = np.float32(0.5)
_STRIP = 64  # rows at once: what fits into a cache
_INSIDE = slice(RADIUS, -RADIUS)
_GAUSSIAN = np.exp(-0.5 * (np.arange(RADIUS + 1) / SIGMA) ** 2)
_GAUSSIAN /= 2 * _GAUSSIAN.sum() - _GAUSSIAN[0]


def ssim(a: np.ndarray, b: np.ndarray) -> float:
    """Mean SSIM of two (h, w, 3) images of display values in [0, 1]; 1 for equal images.

    Example:
        >>> round(ssim(np.full((16, 16, 3), 0.5), np.full((16, 16, 3), 0.5)), 6)
        1.0
    """
    if min(a.shape[:2]) <= 2 * RADIUS:
        margins = ((RADIUS, RADIUS), (RADIUS, RADIUS), (0, 0))
        a, b = np.pad(a, margins, mode="symmetric"), np.pad(b, margins, mode="symmetric")
    rows, columns = a.shape[0] - 2 * RADIUS, a.shape[1] - 2 * RADIUS
    total = sum(_sum_of_strip(*(np.ascontiguousarray(i[top:top + _STRIP + 2 * RADIUS, :, c],
                                                     np.float32) for i in (a, b)))
                for c in range(a.shape[2]) for top in range(0, rows, _STRIP))
    return total / (rows * columns * a.shape[2])


def _sum_of_strip(a: np.ndarray, b: np.ndarray) -> float:
    """The sum of the map over the windows inside some rows of a plane."""
    # Of values around 0, or float32 would lose the variance in the difference of two squares.
    a, b = a - _GREY, b - _GREY
    mean_a, mean_b = _blur(a), _blur(b)
    covariance = _blur(a * b) - mean_a * mean_b
    variances = _blur(a * a + b * b) - (mean_a * mean_a + mean_b * mean_b)
    mean_a += _GREY
    mean_b += _GREY
    product = mean_a * mean_b
    squares = mean_a * mean_a + mean_b * mean_b
    map_ = (2 * product + C1) * (2 * covariance + C2) / ((squares + C1) * (variances + C2))
    return float(map_.sum(dtype=np.float64))


def _blur(plane: np.ndarray) -> np.ndarray:
    """Gaussian means of the windows inside a plane: (h - 10, w - 10)."""
    high, wide = (_band(n) for n in plane.shape)
    return wide.along_rows(high.along_columns(plane)[_INSIDE])[:, _INSIDE]


@lru_cache(maxsize=8)
def _band(n: int) -> Band:
    return Band(np.concatenate([_GAUSSIAN[:0:-1], _GAUSSIAN]), n)
