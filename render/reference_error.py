"""How well a reference tells the PSNR of an image, before there is an image.

Symbols: x an image, t the truth, A and B the halves of a reference, all on clipped sRGB;
e = x - t, a = A - t, b = B - t; P pixels of a frame; E = mean of e^2. Products with a dot are sums
over the three channels of a pixel.

The halves tell E as M = mean of (x - A)(x - B), so of e^2 - e (a + b) + a b. Given the image,

    Var[M] = 1/(3 P)^2 * sum over pixels of (Var[e . a] + Var[e . b] + Var[a . b]),

since a, b and pixels are independent. (Channels are not: a path's light errs alike in all three.)
Half of the difference of a half's two parts, q for A and r for B, has the second moments that a and
b have, and q and r are independent. Hence, whatever the distribution of the noise and the
correlation of channels, sums over pixels are estimated without bias by

    Var[e . a] ~ (e . q)^2,    Var[e . b] ~ (e . r)^2,    Var[a . b] ~ (q . r)^2.

What the image will be nobody knows yet: it is taken to be as good everywhere, e^2 = E = 1e-4,
which is 40 dB, and wrong alike in all channels. By the delta method the frame's PSNR then has the
standard error 10 / ln 10 * sqrt(Var[M]) / E, and the mean over F frames the root of the sum of
squares over F. With N samples a pixel q and r fall as 1/sqrt(N), or faster where samples are
stratified.

The display's curve bends what a half has on average, by about

    d_A = f(A) - (f(P_0) + f(P_1)) / 2          (likewise d_B; f is sRGB, P_i the parts)

which the jackknife of `denoise/metrics/halves.py` takes off. Of what is left the mean of
(x - A)(x - B) has the square, in all frames alike, so that no number of frames averages it away.
d_A and d_B are independent, and mean(d_A d_B) tells the mean square of what was taken off. On
frames of `box` and `room` with 8 and 16 samples, against 2048, what was left had 0.12, 0.31, 0.37
and 0.18 of that mean square: `LEFT` of it is expected. It falls as 1/N^2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from onespp.show.srgb import srgb_from_linear

MSE = 1e-4  # of a method of 40 dB
FEWEST_SPP = 16  # in each part 4
LEFT = 0.25  # by the jackknife, of the mean square that it takes off
MOST_SPP = 16384


@dataclass(frozen=True)
class FrameNoise:
    """The variance of the PSNR that a frame's reference tells, dB^2, and its bias, dB.

    Attributes:
        spp: samples a pixel.
        crossed: variance of the noise times the image's error, which falls as 1/N.
        squared: variance of the product of the halves' noise, which falls as 1/N^2.
        bent: how much too low the PSNR is by what the curve leaves, which falls as 1/N^2.
    """

    spp: int
    crossed: float
    squared: float
    bent: float = 0.0

    @property
    def variance(self) -> float:
        return self.crossed + self.squared

    def at(self, spp: int) -> FrameNoise:
        """As expected with another number of samples."""
        share = self.spp / spp
        return FrameNoise(spp, self.crossed * share, self.squared * share**2, self.bent * share**2)


def frame_noise(parts: np.ndarray, spp: int) -> FrameNoise:
    """What a reference's parts, (4, h, w, 3) linear radiance, say of their noise."""
    shown = srgb_from_linear(parts).astype(np.float64)
    shown = np.where(np.isfinite(shown).all(0), shown, 0.0)
    q, r = (shown[0] - shown[1]) / 2, (shown[2] - shown[3]) / 2
    scale = 10 / math.log(10) / MSE / q.size
    crossed = np.square(q.sum(-1)).sum() + np.square(r.sum(-1)).sum()
    squared = np.square((q * r).sum(-1)).sum()
    taken_off = [srgb_from_linear((parts[i] + parts[i + 1]) / 2) - (shown[i] + shown[i + 1]) / 2
                 for i in (0, 2)]
    bent = np.nansum(taken_off[0] * taken_off[1], dtype=np.float64)
    return FrameNoise(spp, scale**2 * MSE * float(crossed), scale**2 * float(squared),
                      LEFT * scale * max(0.0, float(bent)))


def expected_error(noises: Iterable[FrameNoise]) -> float:
    """Of the mean over frames of the PSNR, dB: the root of its variance and its bias squared."""
    known = list(noises)
    if not known:
        return 0.0
    deviation = math.sqrt(math.fsum(noise.variance for noise in known))
    return math.hypot(deviation, math.fsum(noise.bent for noise in known)) / len(known)


def next_to_grow(noises: Mapping[int, FrameNoise], decibels: float) -> tuple[int, int] | None:
    """The frame whose reference to double next, and its samples then; None: no more.

    That whose further samples gain most, until the expected error is as asked for or all have
    `MOST_SPP`.
    """
    if expected_error(noises.values()) <= decibels:
        return None
    growing = [i for i in noises if noises[i].spp < MOST_SPP]
    if not growing:
        return None
    bent = 3 * math.fsum(noise.bent for noise in noises.values())  # b^2 falls by 3/4 of 2 b each
    best = max(growing, key=lambda i: (
        (noises[i].variance + bent * noises[i].bent) / noises[i].spp, -i))
    return best, min(2 * noises[best].spp, MOST_SPP)


def expected_spp(noises: Mapping[int, FrameNoise], decibels: float) -> dict[int, int]:
    """Samples a pixel that each frame's reference is likely to get."""
    planned = dict(noises)
    while (step := next_to_grow(planned, decibels)) is not None:
        index, spp = step
        planned[index] = planned[index].at(spp)
    return {i: noise.spp for i, noise in planned.items()}
