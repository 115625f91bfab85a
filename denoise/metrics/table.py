"""Measures of error: one function and one row of `METRICS` each.

Symbols: a the image to judge, b the reference, both (h, w, 3); S the tone map; means run over
pixels and colours alike, in float64. A row says in which space its function takes a and b:
"linear" radiance, or "srgb", display values in [0, 1] (`denoise/tonemap.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from . import flip
from .ssim import ssim
from .tonemap import srgb_from_linear

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


@dataclass(frozen=True)
class Metric:
    """One measure of a frame.

    Attributes:
        name: key in scores.json and column in scores.csv.
        label: heading in tables.
        function: (a, b) -> float, finite for finite images; None where it does not apply.
        space: what `function` takes, "linear" radiance, "srgb" display values, or a "step" of two
            frames (`stability.py`).
        unit: goes with the label, as "dB"; "" where there is none.
        higher_is_better: the direction.
        format: how tables print it.
        about: the definition in a line.
        in_table: whether it has a column on the terminal; the files have them all.
        most_frames: for a slow one, the number of frames it is measured on, spread evenly; None:
            all.
    """

    name: str
    label: str
    function: Callable[..., float | None]
    space: str
    unit: str
    higher_is_better: bool
    format: str
    about: str
    in_table: bool = True
    most_frames: int | None = None


_ROWS = (
    Metric("psnr_srgb", "PSNR", psnr, "srgb", "dB", True, ".2f",
           f"10 log10(1 / mean((S(a) - S(b))^2)) on clipped sRGB, not quantised, "
           f"at most {PSNR_CAP:g}; a sequence's is the mean over its frames, without those "
           "identical to the reference"),
    Metric("relmse", "relMSE", relmse, "linear", "", False, ".4f",
           "mean((a - b)^2 / (b^2 + 0.01)), linear; a sequence's is the mean over its frames"),
    Metric("smape", "SMAPE", smape, "linear", "", False, ".4f",
           "mean(|a - b| / (|a| + |b| + 0.01)), linear", in_table=False),
    Metric("energy_error", "energy error", energy_error, "linear", "", False, ".2%",
           "|mean(a) / mean(b) - 1|, linear", in_table=False),
    Metric("ssim", "SSIM", ssim, "srgb", "", True, ".4f",
           "structural similarity, Gaussian of 1.5 pixels, mean over colours, on clipped sRGB"),
)
_FLIP_ROWS = (
    Metric("flip", "FLIP", flip.flip, "srgb", "", False, ".4f",
           "mean LDR-FLIP at 67 pixels per degree, on clipped sRGB; "
           "on at most 8 frames, spread evenly", most_frames=8),
    Metric("flip_hdr", "HDR-FLIP", flip.hdr_flip, "linear", "", False, ".4f",
           "mean HDR-FLIP (ACES), linear, where a reference exceeds 1; "
           "on at most 2 frames, spread evenly", in_table=False, most_frames=2),
)

METRICS = MappingProxyType({
    row.name: row for row in (*_ROWS, *(_FLIP_ROWS if flip.AVAILABLE else ()))})

HEADLINE = METRICS["psnr_srgb"]


def blacken(image: np.ndarray, where: np.ndarray) -> np.ndarray:
    """`image` with the pixels of the (h, w) mask `where` set to 0; itself if there are none."""
    return np.where(where[..., None], np.zeros((), image.dtype), image) if where.any() else image


def non_finite(image: np.ndarray) -> np.ndarray:
    """(h, w) mask of pixels that have a NaN or an infinity in any colour."""
    return np.logical_not(np.isfinite(image).all(axis=-1))


@dataclass(frozen=True)
class Pair:
    """An image and its reference, fit for the measures.

    Attributes:
        linear: (a, b), (h, w, 3) linear radiance.
        srgb: (a, b), (h, w, 3) display values in [0, 1].
    """

    linear: tuple[np.ndarray, np.ndarray]
    srgb: tuple[np.ndarray, np.ndarray]


def pair(image: np.ndarray, reference: np.ndarray) -> Pair:
    """Two (h, w, 3) images of linear radiance, to be compared.

    A non-finite pixel of `image` is judged as black. Where `reference` is not finite, neither is
    judged (black in both).
    """
    unknown = non_finite(reference)
    linear = blacken(image, non_finite(image) | unknown), blacken(reference, unknown)
    return Pair(linear, (srgb_from_linear(linear[0]), srgb_from_linear(linear[1])))


def measure(image: np.ndarray, reference: np.ndarray) -> dict[str, float | None]:
    """Every row of `METRICS` for one frame: name -> value, finite, or None if it doesn't apply.

    Args:
        image, reference: (h, w, 3) linear radiance, repaired as by `pair`.
    Example:
        >>> scores = measure(np.full((16, 16, 3), 0.2), np.full((16, 16, 3), 0.25))
        >>> round(scores["psnr_srgb"], 2), round(scores["energy_error"], 2)
        (25.59, 0.2)
    """
    return measure_pair(pair(image, reference), METRICS)


def measure_pair(images: Pair, names: Iterable[str]) -> dict[str, float | None]:
    """The named rows of `METRICS`."""
    rows = [METRICS[name] for name in names]
    return {row.name: row.function(*getattr(images, row.space)) for row in rows}


def spread(frames: list[int], count: int | None) -> list[int]:
    """At most `count` of the frames: first, last, and evenly between; None: all."""
    if count is None or len(frames) <= count:
        return frames
    return [frames[i] for i in np.linspace(0, len(frames) - 1, count).round().astype(int)]


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
