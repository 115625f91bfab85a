"""Measures of error: one function and one row of `METRICS` each.

Symbols: a the image to judge, b the reference, both (h, w, 3); S the tone map; means run over
pixels and colours alike, in float64. A row says in which space its function takes a and b:
"linear" radiance, or "srgb", display values in [0, 1] (`denoise/tonemap.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from .tonemap import srgb_from_linear

PSNR_CAP = 150.0
"""dB of identical images, whose PSNR is infinite. A float32 image with values up to 1 is itself
uncertain by 144 dB, so nothing real reaches it, and means, files and plots stay finite."""

RELMSE_FLOOR = 0.01


def mse(a: np.ndarray, b: np.ndarray) -> float:
    """mean((a - b)^2)."""
    return float(np.mean(np.square(np.subtract(a, b, dtype=np.float64))))


def decibels(error: float) -> float:
    """-10 log10(error), the PSNR of a mean squared error with peak 1, at most `PSNR_CAP`."""
    return float(min(PSNR_CAP, -10 * np.log10(error))) if error > 0 else PSNR_CAP


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB, peak 1: 10 log10(1 / mse(a, b))."""
    return decibels(mse(a, b))


def relmse(a: np.ndarray, b: np.ndarray) -> float:
    """mean((a - b)^2 / (b^2 + 0.01)), linear (Rousselle et al. 2011)."""
    b = np.asarray(b, np.float64)
    return float(np.mean((a - b) ** 2 / (b ** 2 + RELMSE_FLOOR)))


@dataclass(frozen=True)
class Metric:
    """One measure.

    Attributes:
        name: key in scores.json and column in scores.csv.
        label: heading in tables; `unit` goes with it ("" where there is none).
        function: (a, b) -> float, finite for finite images.
        space: "linear" or "srgb", what `function` takes.
        higher_is_better: the direction.
        format: how tables print it.
        about: the definition in a line.
    """

    name: str
    label: str
    function: Callable[[np.ndarray, np.ndarray], float]
    space: str
    unit: str
    higher_is_better: bool
    format: str
    about: str


_ROWS = (
    Metric("psnr_srgb", "PSNR", psnr, "srgb", "dB", True, ".2f",
           f"10 log10(1 / mean((S(a) - S(b))^2)) on clipped sRGB, not quantised, "
           f"at most {PSNR_CAP:g}; a sequence's is the mean over its frames"),
    Metric("relmse", "relMSE", relmse, "linear", "", False, ".4f",
           "mean((a - b)^2 / (b^2 + 0.01)), linear; a sequence's is the mean over its frames"),
)

METRICS = MappingProxyType({row.name: row for row in _ROWS})

HEADLINE = METRICS["psnr_srgb"]


def blacken(image: np.ndarray, where: np.ndarray) -> np.ndarray:
    """`image` with the pixels of the (h, w) mask `where` set to 0; itself if there are none."""
    return np.where(where[..., None], np.zeros((), image.dtype), image) if where.any() else image


def non_finite(image: np.ndarray) -> np.ndarray:
    """(h, w) mask of pixels that have a NaN or an infinity in any colour."""
    return np.logical_not(np.isfinite(image).all(axis=-1))


def measure(image: np.ndarray, reference: np.ndarray) -> dict[str, float]:
    """Every row of `METRICS` for one frame.

    A non-finite pixel of `image` is scored as black. Where `reference` is not finite, neither is
    judged (black in both).

    Args:
        image, reference: (h, w, 3) linear radiance.
    Returns:
        metric name -> value, always finite.
    """
    unknown = non_finite(reference)
    a, b = blacken(image, non_finite(image) | unknown), blacken(reference, unknown)
    spaces = {"linear": (a, b), "srgb": (srgb_from_linear(a), srgb_from_linear(b))}
    return {m.name: m.function(*spaces[m.space]) for m in METRICS.values()}


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
    """
    x, weights = np.polynomial.hermite_e.hermegauss(nodes)
    b = blacken(reference, non_finite(reference))
    sigma = np.sqrt(np.maximum(np.nan_to_num(variance, nan=0.0, posinf=0.0), 0.0))
    display = srgb_from_linear(b)
    error = sum(w * mse(srgb_from_linear(b + np.float32(t) * sigma), display)
                for t, w in zip(x, weights / weights.sum()))
    return decibels(error)
