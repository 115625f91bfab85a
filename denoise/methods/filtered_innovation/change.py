"""How much history a change of light leaves.

Symbols as in `innovation.py`: e the innovation, S[e] its smoothing, Q that one's variance, W the
mean of l(e)^2 around, n the length of the history. h + S[e] has the light that is new, and yet the
high frequencies and the noise of the old one. A history as long as

    n = N / (p D),   N = max(W - D, W / 16),

is worth its while: the noise N of a frame falls as 1 / n, the error of history, a share p of the
squared change D, does not. With

    r = min(l(S[e])^2, W) / max(l(S[e])^2, W),    c = 1 - k Q (1 - r^4) / D_0,
    D_1 = max(c, 0)^2 D_0,                        D = min(D_1, W^2 / D_1),

D_0 is the largest square of l(S[e]), of its red and of half of its blue, those of diffuse light
halved once more: its colours are over albedo, and noisy. What is as large all around as its mean is
(r = 1: a shadow that is there at once) is no noise, however few pixels have told of it. And where
the mean is far larger than what happens around (a quiet place near a change), it is none of the
place's own. Of diffuse and glossy light n is at most 1 / `renewal`, too, where unshadowed light
tells of a change (`inputs/light_change.py`).

All of it is of the surroundings: were n of the pixel's own noise, a would go with it, and the mean
of the history be off (3 % of energy too much with n of h itself).

Of diffuse light k is four times that on surfaces at rest where lights are known to be as they were:
on one that moves, light changes. Of visibility it is half of that, and four times that where shadow
rays tell that shadow and surface stand still: near a contact S is of few rays, and has little else
to tell there.

Of a sparse signal N is v (1 - v), D = max(c, 0)^2 (S[e] / S[omega])^2, and what is limited is the
sum of omega.
"""

# pyright: standard
from __future__ import annotations

from typing import NamedTuple

import drjit as dr

from onespp.denoise.inputs.signals import Signal, SignalKind
from onespp.denoise.jit.arrays import Float

from .innovation import Innovations
from .layout import SignalLayout, Smoothed

MIN_ENERGY = 1e-20             # square of a luminance that is taken for 0
LEAST_NOISE = 0.01             # variance of a sample of visibility
_LEAST_SHARE = 1 / 16          # of W that is noise
_GLOSSY_SAMPLES = 48.0         # W / Q of glossy light, whose Q is not known
_AT_REST, _IN_MOTION = 4.0, 0.5  # times k, of visibility
_COLOR = 0.25                  # share of squared red and blue, of diffuse light
_BLUE = 0.25
_KEPT = 1e6                    # n where nothing has changed


def certainty(spread: Float, size: Float, threshold: Float) -> Float:
    """c = 1 - k Q / size, size being of squares. (A ratio's norm is in both.)"""
    return 1 - threshold * spread / dr.maximum(size, MIN_ENERGY)


class Doubts(NamedTuple):
    """What a change is judged by: k, of diffuse light on surfaces at rest and of all else; p of
    each signal; and `renewal`."""

    light_threshold: Float
    threshold: Float
    weights: list[Float]
    renewal: Float


def lengths_left(layout: SignalLayout, innovations: Innovations, smoothed: Smoothed,
                 changes: list[Float], doubts: Doubts) -> list[Float]:
    """n of each signal, or N, that a change leaves at most; may be below 1.

    Args:
        changes: S[e] / S[omega] of each sparse signal.
    """
    spreads = iter(smoothed.visibility_spread)
    left = []
    for s, (kind, wide, p) in enumerate(
            zip(layout.kinds, smoothed.each, doubts.weights, strict=True)):
        group, follower, k = layout.group(s), layout.follower(s), doubts.threshold
        if kind is SignalKind.VISIBILITY:
            spread = next(spreads)
            k = doubts.threshold * (_IN_MOTION if follower is None else dr.fma(
                innovations.unrest[follower], _IN_MOTION - _AT_REST, _AT_REST))
        elif kind is SignalKind.GLOSSY:
            spread = smoothed.energies[s] / _GLOSSY_SAMPLES
        else:
            spread, k = smoothed.diffuse_spread, threshold_of_light(doubts, innovations.rests)
        if group is None:
            n = _left(kind, wide, spread, smoothed.energies[s], k, p)
            left.append(n if kind is SignalKind.VISIBILITY
                        else dr.minimum(n, 1 / dr.maximum(doubts.renewal, 1 / _KEPT)))
            continue
        certain = certainty(spread, dr.square(wide.luminance), k)
        size = dr.square(dr.maximum(certain, 0) * changes[group])
        noise = coin_variance(innovations.sparse[group].history + changes[group])
        left.append(noise / dr.maximum(p * size, MIN_ENERGY))
    return left


def _left(kind: SignalKind, wide: Signal, spread: Float, energy: Float, threshold: Float,
          p: Float) -> Float:
    """n of a signal that is not sparse; energy: W."""
    luminance2 = size = dr.square(wide.luminance)
    if wide.red is not None and wide.blue is not None:
        color = dr.maximum(dr.square(wide.red), _BLUE * dr.square(wide.blue))
        size = dr.maximum(size, color * _COLOR if kind is SignalKind.DIFFUSE else color)
    agree = dr.minimum(luminance2, energy) / dr.maximum(dr.maximum(luminance2, energy), MIN_ENERGY)
    certain = certainty(spread * (1 - dr.square(dr.square(agree))), size, threshold)
    size = size * dr.square(dr.maximum(certain, 0))
    size = dr.minimum(size, energy * (energy / dr.maximum(size, MIN_ENERGY)))
    noise = dr.maximum(energy - size, energy * _LEAST_SHARE)
    return dr.select(size > MIN_ENERGY, noise / dr.maximum(p * size, MIN_ENERGY), _KEPT)


def threshold_of_light(doubts: Doubts, rests: Float) -> Float:
    """k of diffuse light; rests: of `Innovations`."""
    return dr.fma(doubts.light_threshold - doubts.threshold, rests, doubts.threshold)


def coin_variance(visibility: Float) -> Float:
    """v (1 - v), of a sample of a sparse signal."""
    mean = dr.clip(visibility, 0, 1)
    return dr.maximum(mean * (1 - mean), LEAST_NOISE)
