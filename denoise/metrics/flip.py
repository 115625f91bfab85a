"""FLIP, the difference a viewer sees when flipping between two images, by NVIDIA's own library.

LDR-FLIP (Andersson et al. 2020, doi:10.1145/3406183) takes display values; HDR-FLIP (Andersson et
al. 2021, doi:10.2312/egs.20211015) takes radiance, and is the greatest LDR-FLIP over a range of
exposures with the ACES tone map. Both are
in [0, 1], 0 for equal images, at 67 pixels per degree (the library's default: a 0.7 m wide
display of 3840 pixels at 0.7 m). Without `flip-evaluator` there are no such scores.

The range of exposures is worked out here, after the second paper's section 4: the library ends
the process where a reference has none (one of a single value, or black).
"""

from __future__ import annotations

import importlib.util

import numpy as np

from .luminance import luminance

AVAILABLE = importlib.util.find_spec("flip_evaluator") is not None

_ACES = (0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14)
_BRIGHT = 0.85     # tone-mapped value that the brightest pixel and the median are brought to
_LARGEST = 65504.0  # radiance; the square of more overflows in the tone map
_MOST_STOPS = 24.0


def flip_map(image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(h, w) float32 LDR-FLIP of two (h, w, 3) images of display values in [0, 1]."""
    return _evaluate(image, reference, "LDR", {})[0][..., 0]


def flip(image: np.ndarray, reference: np.ndarray) -> float:
    """Mean LDR-FLIP of two (h, w, 3) images of display values in [0, 1]; 0 for equal images.

    Example:
        >>> flip(np.zeros((8, 8, 3), np.float32), np.zeros((8, 8, 3), np.float32))
        0.0
    """
    return float(_evaluate(image, reference, "LDR", {})[1])


def hdr_flip(image: np.ndarray, reference: np.ndarray) -> float | None:
    """Mean HDR-FLIP of linear radiance; None where nothing is brighter than a display's 1."""
    if not (reference > 1).any():
        return None
    a, b = (np.clip(i, 0, _LARGEST) for i in (image, reference))
    start, stop = exposures(b)
    return float(_evaluate(a, b, "HDR", {"startExposure": start, "stopExposure": stop})[1])


def exposures(reference: np.ndarray) -> tuple[float, float]:
    """First and last exposure of HDR-FLIP, in stops, from the reference's luminance.

    They bring its maximum and its median to 0.85. A median of 0 is replaced by that of the pixels
    that are not black; the range ends after 24 stops.
    """
    k0, k1, k2, k3, k4, k5 = _ACES
    a, b, c = (k0 - _BRIGHT * k3, k1 - _BRIGHT * k4, k2 - _BRIGHT * k5)
    bright = (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a)
    light = luminance(np.asarray(reference, np.float64))
    median = _median(light) or _median(light[light > 0])
    start, stop = np.log2(bright / light.max()), np.log2(bright / median)
    return float(start), float(np.clip(stop, start, start + _MOST_STOPS))


def _median(values: np.ndarray) -> float:
    """The upper one of two, as in the library."""
    middle = values.size // 2
    return float(np.partition(values.ravel(), middle)[middle])


def _evaluate(image: np.ndarray, reference: np.ndarray, kind: str, parameters: dict) -> tuple:
    import flip_evaluator

    a, b = (np.ascontiguousarray(i, np.float32) for i in (image, reference))
    return flip_evaluator.evaluate(b, a, kind, kind == "LDR", False, True, parameters)
