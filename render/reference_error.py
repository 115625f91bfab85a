"""How well a reference tells the PSNR of an image, before there is an image.

Symbols: x an image, t the truth, A and B the halves of a reference, all on clipped sRGB;
e = x - t, a = A - t, b = B - t; v the variance of the mean of A and B in one pixel and channel, so
that a and b have 2 v each; n pixels x channels of a frame; E = mean of e^2.

The halves tell E as M = mean of (x - A)(x - B) = mean of e^2 - e (a + b) + a b. Given the image,

    Var[M] = c/n^2 * sum (4 e^2 v + 4 v^2),

since a, b and pixels are independent. Channels are not: a path's light has much the same error in
all three, so that c = 3, the most that is possible. What the image will be nobody knows yet: it is
taken to be as good everywhere, e^2 = E = 1e-4, which is 40 dB. By the delta method the frame's
PSNR then has the standard error 10 / ln 10 * sqrt(Var[M]) / E, and the mean over F frames the root
of the sum of squares over F.

v is measured between the four parts, with 3 degrees of freedom: E[v^2 as measured] = 5/3 v^2. Of N
samples a pixel it is 1/N at most, as of independent ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from .srgb import srgb_from_linear

MSE = 1e-4  # of a method of 40 dB
FEWEST_SPP = 64  # below, what bends the halves on sRGB is no small correction any more
MOST_SPP = 16384

_CHANNELS = 3  # c above
_FREEDOM = 3  # of v


@dataclass(frozen=True)
class FrameNoise:
    """The variance of the PSNR that a frame's reference tells, dB^2.

    Attributes:
        spp: samples a pixel.
        crossed: of the noise times the image's error, which falls as 1/N.
        squared: of the product of the halves' noise, which falls as 1/N^2.
    """

    spp: int
    crossed: float
    squared: float

    @property
    def variance(self) -> float:
        return self.crossed + self.squared

    def at(self, spp: int) -> FrameNoise:
        """As expected with another number of samples."""
        share = self.spp / spp
        return FrameNoise(spp, self.crossed * share, self.squared * share**2)


def frame_noise(parts: np.ndarray, spp: int) -> FrameNoise:
    """What a reference's parts, (4, h, w, 3) linear radiance, say of their noise."""
    shown = srgb_from_linear(parts)
    v = shown.var(0, ddof=1, dtype=np.float64) / len(parts)
    v = np.where(np.isfinite(v), v, 0.0)
    scale = (10 / math.log(10) / MSE) ** 2 * _CHANNELS * 4 / v.size**2
    return FrameNoise(spp, scale * MSE * float(v.sum()),
                      scale * float(np.square(v).sum()) * _FREEDOM / (_FREEDOM + 2))


def standard_error(noises: Iterable[FrameNoise]) -> float:
    """Of the mean over frames of the PSNR, dB."""
    variances = [noise.variance for noise in noises]
    return math.sqrt(math.fsum(variances)) / len(variances) if variances else 0.0


def next_to_grow(noises: Mapping[int, FrameNoise], decibels: float) -> tuple[int, int] | None:
    """The frame whose reference to double next, and its samples then; None: no more.

    That whose further samples gain most, until the standard error is as asked for or all have
    `MOST_SPP`.
    """
    if standard_error(noises.values()) <= decibels:
        return None
    growing = [i for i in noises if noises[i].spp < MOST_SPP]
    if not growing:
        return None
    best = max(growing, key=lambda i: (noises[i].variance / noises[i].spp, -i))
    return best, min(2 * noises[best].spp, MOST_SPP)


def expected_spp(noises: Mapping[int, FrameNoise], decibels: float) -> dict[int, int]:
    """Samples a pixel that each frame's reference is likely to get."""
    planned = dict(noises)
    while (step := next_to_grow(planned, decibels)) is not None:
        index, spp = step
        planned[index] = planned[index].at(spp)
    return {i: noise.spp for i, noise in planned.items()}
