"""Rare bright pixels: they leave no blobs, and most of their light is kept.

A path that meets a lamp by a rare chance, as by way of a glossy floor, is a pixel many times as
bright as those around. A filter that weighs by noise spreads it over its few pixels, as a blob, or
keeps it from some of them, and so loses light; and in a history it is for many frames a pixel that
is not as bright any more as to be told from others. Symbols: d luminance of the frame, h of its
history, 0 without one, x of what is judged; m the mean of x over those of the 24 pixels around that
see the same object, F the last filter, S a smoothing by geometry alone, as wide as that of the
innovation.

    x' = min(x, max(t m, u min(d, h)))

    before the last filter    x = merged history,   output = F[x'] min(S[x] / S[x'], 6)
        diffuse light t = 2.5 (its caustics are bright for a reason); u = 3/4
        glossy light t = 1.5 + 10 b, b being how bent a surface is (`bent.bent_share`)
    before history            x = d,                d <- x' min(S[x] / S[x'], 6)
        glossy light of narrow lobes (roughness below 0.2) t = 4; u = 3

What frame and history both have is no rare chance; and where a surface is bent each pixel sees
another part of what is around, as in the highlight on a small thing. What is taken has its share in
S of the light all around. Light is lost where the limit, 6, is reached: where S reaches only few
pixels, as on leaves. Wider lobes meet lamps often, and what is taken from them before history is
missed there; the light of other layers stays as it is, too.

Under a coloured sky diffuse light holds what one visibility for all colours leaves of direct light
(`inputs/signals.py`): colour without luminance, of either sign. No peak is made of it, and nothing
is multiplied that is no light: x is the sum of p, the nearest to it of its luminance without
negative components (on the way to grey), and what is left, which is neither cut nor multiplied.
(Multiplied with the rest, open ground under a sky of blue and white was off by a fifth in blue.)

Source: our own, of two known parts: outliers by their neighbours (as in GAMES202, lecture 13, here
by the mean alone), and the ratio of two smoothings (Heitz et al. 2018), which gives light back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import drjit as dr

from onespp.denoise.inputs.signals import Signal, SignalKind
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.color import LuminanceColor, with_green
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


class Energies(NamedTuple):
    """Luminance of each light, and of what `without_peaks` leaves of it; or smoothings of these."""

    before: list[Float]
    after: list[Float]


def without_peaks(limits: Limits, kinds: Sequence[SignalKind], lights: list[Signal],
                  seen_twice: list[Float], bent: Float | None, luminances: Taps[list[Float]],
                  ids: Taps[Float]) -> tuple[list[Signal], Energies]:
    """Each light without its peaks, x', and its energies.

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
    kept = [_scaled(light, share) for light, share in zip(lights, shares)]
    return kept, Energies(center, [x * share for x, share in zip(center, shares)])


def with_their_light(lights: list[Signal], around: Energies) -> list[Signal]:
    """What was made of `without_peaks`, with its light again; around: smoothed."""
    whole = [dr.select(after > 0, dr.clip(before / dr.select(after > 0, after, 1), 1, MOST), 1)
             for before, after in zip(around.before, around.after)]
    return [_scaled(light, factor) for light, factor in zip(lights, whole)]


def _scaled(light: Signal, factor: Float) -> Signal:
    """p times a factor, and what is left."""
    return mapped(lambda x, p: dr.fma(p, factor, x - p), light, _without_negative(light))


def _without_negative(light: Signal) -> Signal:
    """p; light itself where nothing is negative."""
    red, x, blue = light
    if red is None or blue is None:
        return light
    least = dr.minimum(*with_green(LuminanceColor(red, x, blue))[:2])
    least = dr.minimum(least, blue)
    grey = dr.maximum(x, 0)
    way = grey / dr.select(least < 0, grey - least, 1)
    return mapped(lambda v: dr.select(least < 0, dr.fma(way, v - grey, grey), v), light)
