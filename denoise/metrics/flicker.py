"""Measures of change from frame to frame: one function and one row of `STABILITY` each.

Symbols: a_t image and b_t reference of frame t, on the display (clipped sRGB); e_t = a_t - b_t;
p a pixel, p' the pixel of frame t - 1 that shows p's surface (`correspondence.py`, exact).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from onespp.denoise.geometry.correspondence import NOWHERE, carry

from .errors import decibels, mse
from .estimate import Estimate
from .halves import Halves, mean_product


@dataclass(frozen=True)
class Step:
    """Two frames in a row of one method.

    Attributes:
        now: (image, reference) of this frame, (h, w, 3) display values in [0, 1].
        before: the same of the frame before.
        source: (h, w) of `correspondence.previous_pixel`, None without guides.
        still: (h, w) mask of pixels where nothing has changed, None without guides.
        moved, aligned: halves of b_t(p) - b_{t-1}(p') and b_t(p) - b_{t-1}(p); None without.
    """

    now: tuple[np.ndarray, np.ndarray]
    before: tuple[np.ndarray, np.ndarray]
    source: np.ndarray | None
    still: np.ndarray | None
    moved: Halves | None = None
    aligned: Halves | None = None


def flicker(step: Step) -> float | None:
    """sqrt(mean((e_t(p) - e_{t-1}(p'))^2)) over pixels with a p'; None if there is none.

    Example, with an error that changes by 0.1 from one frame to the next:
        >>> black = np.zeros((2, 2, 3))
        >>> there = np.arange(4).reshape(2, 2)
        >>> round(flicker(Step((black + 0.1, black), (black, black), there, None)), 6)
        0.1
    """
    if step.source is None or not (there := step.source != NOWHERE).any():
        return None
    error, old = (np.subtract(*images, dtype=np.float64) for images in (step.now, step.before))
    return float(np.sqrt(np.mean(np.square(error - carry(old, step.source))[there])))


def difference_psnr(step: Step) -> float:
    """-10 log10(mean(((a_t - a_{t-1}) - (b_t - b_{t-1}))^2)) in dB, pixel by pixel, no motion.

    Example:
        >>> black = np.zeros((2, 2, 3))
        >>> round(difference_psnr(Step((black + 0.1, black), (black, black), None, None)), 6)
        20.0
    """
    image, reference = (np.subtract(now, before, dtype=np.float64)
                        for now, before in zip(step.now, step.before))
    return decibels(mse(image, reference))


def flicker_square(step: Step) -> Estimate | None:
    """The square of `flicker` by halves; None without, or without a p'."""
    if step.moved is None or step.source is None:
        return None
    change = step.now[0] - carry(step.before[0], step.source)
    return mean_product(change, step.moved, where=step.source != NOWHERE)


def difference_square(step: Step) -> Estimate | None:
    """The mean square of `difference_psnr` by halves; None without."""
    if step.aligned is None:
        return None
    return mean_product(step.now[0] - step.before[0], step.aligned)


def boiling(step: Step) -> float | None:
    """sqrt(mean((a_t - a_{t-1})^2)) over still pixels; None if there is none.

    Example:
        >>> black, still = np.zeros((2, 2, 3)), np.array([[True, False], [False, True]])
        >>> round(boiling(Step((black + 0.2, black), (black, black), None, still)), 6)
        0.2
    """
    if step.still is None or not step.still.any():
        return None
    change = np.subtract(step.now[0], step.before[0], dtype=np.float64)
    return float(np.sqrt(np.mean(np.square(change)[step.still])))
