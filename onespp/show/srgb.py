"""The sRGB curve, below all that measures or shows on it.

Source: IEC 61966-2-1:1999. Values are quantised to 8 bits for pictures alone.
"""

from __future__ import annotations

import numpy as np


def srgb_from_linear(linear: np.ndarray) -> np.ndarray:
    """Display values in [0, 1] of linear radiance: clip to [0, 1], then the sRGB curve.

    Any shape; floats keep their type. NaN stays NaN.

    Example:
        >>> srgb_from_linear(np.array([-1.0, 0.0, 0.214041, 2.0])).round(4).tolist()
        [0.0, 0.0, 0.5, 1.0]
    """
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def bytes_from_linear(linear: np.ndarray) -> np.ndarray:
    """8-bit sRGB for pictures, rounded to nearest; NaN is black. Any shape."""
    return np.rint(255 * srgb_from_linear(np.nan_to_num(linear, nan=0.0))).astype(np.uint8)
