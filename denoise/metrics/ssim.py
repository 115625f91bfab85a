"""Structural similarity of display values, for each colour.

    SSIM = (2 m_a m_b + C1) (2 s_ab + C2) / ((m_a^2 + m_b^2 + C1) (s_a^2 + s_b^2 + C2))

m, s^2 and s_ab are means, variances and covariance under a Gaussian of sigma 1.5 pixels cut to
11x11; C1 = 0.01^2, C2 = 0.03^2. The score is the mean over colours and over pixels whose window
lies inside the image; a smaller image is mirrored at its border and counted whole.

Source: Wang et al. 2004, "Image quality assessment: from error visibility to structural
similarity", doi:10.1109/TIP.2003.819861. The same as scikit-image's
`structural_similarity(gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1,
channel_axis=2)`, without its dependencies.
"""

from __future__ import annotations

import numpy as np

RADIUS, SIGMA = 5, 1.5
C1, C2 = 0.01**2, 0.03**2

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
    return float(np.mean([_mean_of_plane(np.ascontiguousarray(a[..., c], np.float64),
                                         np.ascontiguousarray(b[..., c], np.float64))
                          for c in range(a.shape[2])]))


def _mean_of_plane(a: np.ndarray, b: np.ndarray) -> float:
    mean_a, mean_b = _blur(a), _blur(b)
    product = mean_a * mean_b
    squares = mean_a * mean_a + mean_b * mean_b
    covariance = _blur(a * b) - product
    variances = _blur(a * a + b * b) - squares
    map_ = (2 * product + C1) * (2 * covariance + C2) / ((squares + C1) * (variances + C2))
    return float(map_.mean())


def _blur(plane: np.ndarray) -> np.ndarray:
    """Gaussian means of the windows inside a plane: (h - 10, w - 10)."""
    for axis in (0, 1):
        length = plane.shape[axis] - 2 * RADIUS
        at = [plane[start:start + length] if axis == 0 else plane[:, start:start + length]
              for start in range(2 * RADIUS + 1)]
        total = _GAUSSIAN[0] * at[RADIUS]
        for k in range(1, RADIUS + 1):
            total += _GAUSSIAN[k] * (at[RADIUS - k] + at[RADIUS + k])
        plane = total
    return plane
