"""A mean square that is known with an error, and its dB or root.

Symbols: M the mean square, m its unbiased estimate, v the variance of that; k = 10 / ln 10. To the
delta method's second order

    E[-10 log10 m] = -10 log10 M + k v / (2 M^2)      standard error k sqrt(v) / M
    E[sqrt m]      = sqrt M - v / (8 M^1.5)           standard error sqrt(v) / (2 sqrt M)

and the terms in v are taken off here. That holds while m is a few standard errors from 0 (where
m is `resolved`; the terms left are below 0.1 dB); less than that has no dB, and may be negative.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from .errors import PSNR_CAP, decibels

Scale = Literal["dB", "root", "mean"]
"""What a measure makes of its mean square: PSNR, a root, or nothing."""

RESOLVED = 3.0
"""Standard errors from 0 that a mean square must be to have a dB or a root."""
BOUND = 2.0
"""Standard errors above the estimate of what is only known to be smaller."""
_K = 10 / math.log(10)


@dataclass(frozen=True)
class Estimate:
    """An unbiased estimate of a mean square.

    Attributes:
        mean: may be negative. variance: of it, by the noise of the reference alone.
        noise: (3, n), L_1, L_2 and Q of `halves.py` for each block; kept to pair with others.
    """

    mean: float
    variance: float
    noise: np.ndarray | None = field(default=None, compare=False, repr=False)

    @classmethod
    def of_blocks(cls, mean: float, noise: np.ndarray) -> Estimate:
        """noise: (3, n) L_1, L_2, Q of the blocks, over the same count as `mean`."""
        return cls(mean, max(0.0, product_of(noise, noise)), noise)

    @property
    def resolved(self) -> bool:
        """Whether it is surely not 0, or exact."""
        return self.variance == 0 or self.mean > RESOLVED * math.sqrt(self.variance)

    def without_noise(self) -> Estimate:
        return replace(self, noise=None)


def product_of(one: np.ndarray, other: np.ndarray) -> float:
    """Covariance of two estimates on the same halves, of their (3, n) noise."""
    # (Not by BLAS, whose threads take longer to wake than these sums.)
    first, second, both = (float(total) for total in np.einsum("kb,kb->k", one, other))
    return first + second - both


def pooled(estimates: Sequence[Estimate]) -> Estimate:
    """The mean of independent estimates."""
    n = len(estimates)
    return Estimate(sum(e.mean for e in estimates) / n, sum(e.variance for e in estimates) / n**2)


def value(scale: Scale, estimate: Estimate) -> float | None:
    """The measure's value; None where the estimate isn't resolved.

    Example:
        >>> value("dB", Estimate(0.001, 0.0)), value("dB", Estimate(0.001, 1e-6))
        (30.0, None)
    """
    m, v = estimate.mean, estimate.variance
    if scale == "mean":
        return m
    if not estimate.resolved:
        return None
    if scale == "dB":
        return min(PSNR_CAP, decibels(m) - (_K * v / (2 * m * m) if v else 0.0))
    return math.sqrt(max(m, 0.0)) + (v / (8 * m**1.5) if v else 0.0)


def error(scale: Scale, estimate: Estimate) -> float:
    """The standard error of a resolved estimate's value."""
    m, deviation = estimate.mean, math.sqrt(estimate.variance)
    if scale == "mean" or not deviation:
        return deviation
    return _K * deviation / m if scale == "dB" else deviation / (2 * math.sqrt(m))


@dataclass(frozen=True)
class Number:
    """A sequence's number.

    Attributes:
        value: of the measure. error: its standard error; None where it is a bound.
        bound: the value is `BOUND` standard errors towards the better: all that is known.
        together: mean squares were pooled over frames, since single frames were not resolved.
    """

    value: float
    error: float | None
    bound: bool = False
    together: bool = False


def number(scale: Scale, estimates: Iterable[Estimate], shared: float = 0.0) -> Number:
    """The mean over frames of the measure; where a frame's isn't resolved, that of the mean square.

    Args:
        estimates: one or more, of frames. shared: correlation of neighbours' errors.
    """
    known = list(estimates)
    spread = 1 + 2 * shared if len(known) > 1 else 1.0
    whole = pooled(known)
    whole = replace(whole, variance=spread * whole.variance)
    if scale == "mean":
        return Number(whole.mean, math.sqrt(whole.variance))
    values = [value(scale, e) for e in known]
    if None not in values:
        squares = sum(error(scale, e) ** 2 for e in known)
        return Number(sum(v for v in values if v is not None) / len(known),
                      math.sqrt(spread * squares) / len(known))
    if (found := value(scale, whole)) is not None:
        return Number(found, error(scale, whole), together=True)
    most = max(whole.mean, 0.0) + BOUND * math.sqrt(whole.variance)
    return Number(value(scale, Estimate(most, 0.0)) or 0.0, None, bound=True, together=True)
