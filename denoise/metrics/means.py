"""The number of a sequence: the mean over its frames, and which frames count.

The PSNR of an image that is identical to its reference is infinite (`PSNR_CAP` stands for it): one
such frame would decide a mean in dB alone. Hence for measures in dB

- a frame where the input itself is identical, as a black one, is left out for every method:
  there was nothing to denoise, and all methods keep being judged on the same frames;
- any other frame where a method is identical is left out of that method's mean;
- if no frame is left, all count.

Measures in other units are finite there (relMSE 0, SSIM 1), and their means are over all frames.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from statistics import fmean

from .errors import PSNR_CAP
from .estimate import Estimate, Number, number
from .metric import Metric

_DECIBELS = "dB"
STEPS_SHARE = 0.5
"""Correlation taken between the errors of two steps in a row, which share a reference: a half where
the errors of three frames are independent, a quarter where the reference's noise is all of it."""


def mean_over_frames(row: Metric, values: Mapping[int, float | None],
                     untouched: Collection[int] = ()) -> float | None:
    """Mean of a measure over frames; None if nothing was measured.

    Args:
        values: frame -> value. untouched: frames where the input is identical to the reference.
    """
    measured = {i: v for i, v in values.items() if v is not None}
    if row.unit == _DECIBELS:
        measured = {i: v for i, v in measured.items() if i not in untouched} or measured
        measured = {i: v for i, v in measured.items() if v < PSNR_CAP} or measured
    return fmean(measured.values()) if measured else None


def sequence_number(row: Metric, values: Mapping[int, float | None],
                    estimates: Mapping[int, Estimate],
                    untouched: Collection[int] = ()) -> Number | None:
    """The same with its standard error, which frames have whose reference has halves.

    Args:
        estimates: frame -> mean square, of those frames; their values may be None.
    """
    if not estimates:
        mean = mean_over_frames(row, values, untouched)
        return None if mean is None else Number(mean, None)
    known = {i: Estimate(_square(row, v), 0.0) for i, v in values.items() if v is not None}
    known = dict(sorted({**known, **estimates}.items()))
    if row.unit == _DECIBELS:
        known = {i: e for i, e in known.items() if i not in untouched} or known
        infinite = identical(row, values)
        known = {i: e for i, e in known.items() if i not in infinite} or known
    return number(row.scale, known.values(), STEPS_SHARE if row.space == "step" else 0.0)


def _square(row: Metric, value: float) -> float:
    if row.scale == "dB":
        return 10 ** (-value / 10) if value < PSNR_CAP else 0.0
    return value * value if row.scale == "root" else value


def mean_decibels(values: Iterable[float]) -> float:
    """Mean of dB, without those of identical images unless there are no others."""
    known = list(values)
    return fmean([v for v in known if v < PSNR_CAP] or known)


def identical(row: Metric, values: Mapping[int, float | None]) -> list[int]:
    """The frames whose dB are infinite, so `PSNR_CAP`; none for a measure in another unit."""
    if row.unit != _DECIBELS:
        return []
    return [i for i, v in values.items() if v is not None and v >= PSNR_CAP]
