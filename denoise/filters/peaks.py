"""Rare bright pixels: they leave no blobs, and most of their light is kept.

A path that meets a lamp by a rare chance, as by way of a glossy floor, is a pixel many times as
bright as those around. A filter that weighs by noise spreads it over its few pixels, as a blob, or
keeps it from some of them, and so loses light; and in a history it is for many frames a pixel that
is not as bright any more as to be told from others. Symbols: d luminance of the frame, h of its
history, 0 without one, x of what is judged; m the mean of x over those of the 24 pixels around that
see the same object, F the last filter, S a smoothing by geometry alone, as wide as that of the
innovation.

    x' = min(x, max(t m, u min(d, h)))

    before the last filter    x = merged history,   output = F[x'] + S[x - x'] l(F[x']) / w
        diffuse light t = 2.5 (its caustics are bright for a reason); u = 3/4
        glossy light t = 1.5 + 10 b, b being how bent a surface is (`bent.bent_share`)
    before history            x = d,                d <- x' + S[x - x'] l(x') / w
        glossy light of narrow lobes (roughness below 0.2) t = 4; u = 3

with w = max(S[x'], l(S[x - x']) / 5): luminance is multiplied by S[x] / S[x'], at most by 6, and
what is added has the colour of what was taken.

What frame and history both have is no rare chance; and where a surface is bent each pixel sees
another part of what is around, as in the highlight on a small thing. What is taken has its share in
S of the light all around. Light is lost where the limit, 6, is reached: where S reaches only few
pixels, as on leaves. Wider lobes meet lamps often, and what is taken from them before history is
missed there; the light of other layers stays as it is, too.

Under a sky or a lamp of many colours diffuse light holds what one visibility for all of them leaves
of direct light (`inputs/signals.py`): colour almost without luminance, of either sign. It is no
peak: what is taken is a share of p, a pixel's light mixed with just so much grey of its luminance
that no component is negative. When light was multiplied by 6 whatever it was, open ground under a
sky of blue and white was off by a fifth in blue.

Source: our own, of two known parts: outliers by their neighbours (as in GAMES202, lecture 13, here
by the mean alone), and the ratio of two smoothings (Heitz et al. 2018), which gives light back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import drjit as dr

from onespp.denoise.inputs.signals import Signal, SignalKind, color_of
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.structure import mapped
from onespp.denoise.jit.taps import Taps

RADIUS = 2                     # pixels
MOST = 6.0                     # that light is multiplied by
_OF_BENT = 10.0                # more of t where a surface is bent


class Limits(NamedTuple):
    """What is left of a pixel: t of each kind, and u."""

    around: Mapping[SignalKind, float]
    seen_twice: float


BEFORE_FILTER = Limits({SignalKind.DIFFUSE: 2.5, SignalKind.GLOSSY: 1.5}, 0.75)
BEFORE_HISTORY = Limits({SignalKind.GLOSSY: 4.0}, 3.0)


class Trimmed(NamedTuple):
    """Of each light, the luminance that `without_peaks` leaves, l(x'), and what it takes, x - x';
    or smoothings of these."""

    left: list[Float]
    taken: list[Signal]


def without_peaks(limits: Limits, kinds: Sequence[SignalKind], lights: list[Signal],
                  seen_twice: list[Float], bent: Float | None, luminances: Taps[list[Float]],
                  ids: Taps[Float]) -> tuple[list[Signal], Trimmed]:
    """Each light without its peaks, x', and what was taken.

    Args:
        kinds: of the lights. seen_twice: min(d, h) of each. bent: b, None for 0. luminances: x, at
            least 0. ids: of objects. Both of the window of `RADIUS`, of which the last is the
            pixel.
    """
    last = len(luminances) - 1
    center, id_ = luminances.at(last), ids.at(last)
    sums, count = [0 * x for x in center], 0 * id_
    for i in range(last):
        same = (ids.at(i) == id_) & (id_ >= 0)
        sums = [total + dr.select(same, x, 0) for total, x in zip(sums, luminances.at(i))]
        count += dr.select(same, 1, 0)
        luminances.next()
    shares = []
    for kind, twice, x, total in zip(kinds, seen_twice, center, sums, strict=True):
        times = limits.around[kind]
        if bent is not None and kind is SignalKind.GLOSSY:
            times = dr.fma(bent, _OF_BENT, times)
        least = dr.maximum(times * total / dr.maximum(count, 1),
                           limits.seen_twice * twice)
        is_peak = (x > least) & (least > 0)
        shares.append(dr.select(is_peak, least / dr.select(is_peak, x, 1), 1))
    positive = [_without_negative(light) for light in lights]
    kept = [mapped(lambda x, p, s=share: dr.fma(p, s, x - p), *both)
            for *both, share in zip(lights, positive, shares)]
    taken = [mapped(lambda p, s=share: p * (1 - s), p) for p, share in zip(positive, shares)]
    return kept, Trimmed([x * share for x, share in zip(center, shares)], taken)


def with_their_light(lights: list[Signal], around: Trimmed) -> list[Signal]:
    """What was made of `without_peaks`, with its light again; around: smoothed."""
    whole = []
    for light, left, taken in zip(lights, *around, strict=True):
        among = dr.maximum(left, taken.luminance * (1 / (MOST - 1)))
        own = dr.maximum(light.luminance, 0)
        per = dr.select(among > 0, own / dr.select(among > 0, among, 1), 0)
        whole.append(mapped(lambda x, more, a=per: dr.fma(a, more, x), light, taken))
    return whole


def _without_negative(light: Signal) -> Signal:
    """p of the module's header, black where luminance is below 0."""
    red, green, blue = color_of(light)
    least = dr.minimum(dr.minimum(red, green), blue)
    grey = dr.maximum(light.luminance, 0)
    way = grey / dr.select(least < 0, grey - least, 1)
    return mapped(lambda v: dr.select(least < 0, dr.fma(way, v - grey, grey), v), light)
