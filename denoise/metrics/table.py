"""Measures of error: one function and one row of `METRICS` each.

Symbols: a the image to judge, b the reference, both (h, w, 3); S the tone map; means run over
pixels and colours alike, in float64. A row says in which space its function takes a and b:
"linear" radiance, "srgb", display values in [0, 1] (`tonemap.py`), or "flip". What is quadratic has
an estimate by the halves of a reference as well, which takes the function's place where it can.
"""

from __future__ import annotations

from collections.abc import Iterable
from types import MappingProxyType

import numpy as np

from .errors import PSNR_CAP, energy_error, psnr, relmse, smape
from .flicker import boiling, difference_psnr, difference_square, flicker, flicker_square
from .image import Pair, display_error, energy, pair, relative_error
from .metric import Metric
from .perceptual.flip import flip, hdr_flip
from .perceptual.ssim import ssim

_ROWS = (
    Metric("psnr_srgb", "PSNR", psnr, "srgb", "dB", True, ".2f",
           f"10 log10(1 / mean((S(a) - S(b))^2)) on clipped sRGB, not quantised, "
           f"at most {PSNR_CAP:g}, by halves of the reference where it has them, so without its "
           "noise; a sequence's is the mean over its frames, without those "
           "identical to the reference", estimate=display_error, scale="dB"),
    Metric("psnr_plain", "plain PSNR", psnr, "srgb", "dB", True, ".2f",
           "the same against the mean of the halves: at most the reference's noise floor",
           in_table=False),
    Metric("relmse", "relMSE", relmse, "linear", "", False, ".4f",
           "mean((a - b)^2 / (b^2 + 0.01)), linear, by halves; a sequence's is the mean over its "
           "frames", estimate=relative_error),
    Metric("smape", "SMAPE", smape, "linear", "", False, ".4f",
           "mean(|a - b| / (|a| + |b| + 0.01)), linear", in_table=False),
    Metric("energy_error", "energy error", energy_error, "linear", "", False, ".2%",
           "|mean(a) / mean(b) - 1|, linear, by halves", in_table=False, estimate=energy,
           scale="root"),
    Metric("ssim", "SSIM", ssim, "srgb", "", True, ".4f",
           "structural similarity, Gaussian of 1.5 pixels, mean over colours, on clipped sRGB"),
    Metric("flip", "FLIP", flip, "flip", "", False, ".4f",
           "mean LDR-FLIP at 67 pixels per degree, on clipped sRGB; "
           "on at most 8 frames, spread evenly", most_frames=8),
    Metric("flip_hdr", "HDR-FLIP", hdr_flip, "flip", "", False, ".4f",
           "mean HDR-FLIP (ACES), linear, where a reference exceeds 1; "
           "on at most 2 frames, spread evenly", in_table=False, most_frames=2),
)

METRICS = MappingProxyType({row.name: row for row in _ROWS})

HEADLINE = METRICS["psnr_srgb"]


def measure(image: np.ndarray, reference: np.ndarray) -> dict[str, float | None]:
    """Every row of `METRICS` for one frame: name -> value, finite, or None if it doesn't apply.

    Args:
        image, reference: (h, w, 3) linear radiance, repaired as by `pair`.
    Example:
        >>> scores = measure(np.full((16, 16, 3), 0.2), np.full((16, 16, 3), 0.25))
        >>> round(scores["psnr_srgb"], 2), round(scores["energy_error"], 2)
        (25.59, 0.2)
    """
    return measure_pair(pair(image, reference), METRICS.values())


def measure_pair(images: Pair, rows: Iterable[Metric]) -> dict[str, float | None]:
    """Rows of `METRICS`, or such as these, against the mean of a reference."""
    return {row.name: row.function(*getattr(images, row.space)) for row in rows}


_CHANGES = (
    Metric("flicker", "flicker", flicker, "step", "", False, ".4f",
           "sqrt(mean((e_t(p) - e_{t-1}(p'))^2)), e = S(a) - S(b), p' the pixel of the frame "
           "before that shows p's surface, by halves; a sequence's is the mean over its frames",
           estimate=flicker_square, scale="root"),
    Metric("psnr_difference", "PSNR of differences", difference_psnr, "step", "dB", True, ".2f",
           "PSNR of S(a_t) - S(a_{t-1}) against S(b_t) - S(b_{t-1}), by halves", in_table=False,
           estimate=difference_square, scale="dB"),
    Metric("boiling", "boiling", boiling, "step", "", False, ".4f",
           "sqrt(mean((S(a_t) - S(a_{t-1}))^2)) where neither surface, camera nor light has "
           "changed", in_table=False),
)
STABILITY = MappingProxyType({row.name: row for row in _CHANGES})
MEASURES = MappingProxyType({**METRICS, **STABILITY})
"""All that is known of a frame of a method: `FrameScore` has a value for each row."""
ESTIMATED = tuple(row.name for row in MEASURES.values() if row.estimate)
"""Those that halves of a reference give without its noise."""
