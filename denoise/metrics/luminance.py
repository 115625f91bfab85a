"""Relative luminance of linear Rec. 709 radiance, in NumPy."""

from __future__ import annotations

import numpy as np

_WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


def luminance(color: np.ndarray) -> np.ndarray:
    """(..., 3) radiance to (...), of the same type."""
    return color @ _WEIGHTS.astype(color.dtype)
