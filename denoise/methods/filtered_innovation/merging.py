"""A signal and its history merged by the filtered innovation."""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import drjit as dr

from onespp.denoise.inputs.signals import Signal, SignalKind
from onespp.denoise.inputs.surface import TangentPlane
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import mapped

from .innovation import Innovations, ShadowInnovation
from .layout import NoisySignal, SignalLayout, Smoothed
from .noise import spatial_variances
from .output import fade_out

MIN_NOISE = 0.25               # share of the innovation's energy that is at least noise of d
_MIN_ENERGY = 1e-20            # square of a luminance that is taken for 0


class Gains(NamedTuple):
    """How history follows.

    Attributes:
        alphas: of each signal. min_gain: g. noise_threshold: k. sharp_min_gain: g'.
        change_alpha: r. fade_frames: until the last filter has faded.
    """

    alphas: list[Float]
    min_gain: Float
    noise_threshold: Float
    sharp_min_gain: Float
    change_alpha: Float
    fade_frames: Float


class Merged(NamedTuple):
    """The new history of each signal, and `fade_out`."""

    signals: list[NoisySignal]
    fade: Float


def merge(stencil: Stencil, layout: SignalLayout, signals: list[Signal], innovations: Innovations,
          smoothed: Smoothed, plane: TangentPlane, gains: Gains) -> Merged:
    """The new history, and how the last filter fades out with it."""
    if innovations.shadow is not None:
        innovations, smoothed = _choose_history(innovations, innovations.shadow, smoothed)
    is_new = innovations.length < 1.5
    spatial = spatial_variances(stencil, signals, is_new, plane)
    merged = []
    for s, (kind, signal) in enumerate(zip(layout.kinds, signals, strict=True)):
        e, wide = innovations.signals[s], [smoothed.diffuse, *smoothed.sharp][s]
        a, gain = dr.maximum(1 / innovations.length, gains.alphas[s]), gains.sharp_min_gain
        if kind is SignalKind.DIFFUSE:
            gain = dr.maximum(_certainty(smoothed.diffuse_spread, wide, gains), gains.min_gain)
        elif kind is SignalKind.VISIBILITY:
            assert smoothed.visibility_spread is not None
            certain = _certainty(smoothed.visibility_spread, wide, gains)
            a = dr.maximum(a, gains.change_alpha * certain)
            gain = dr.maximum(certain, gains.sharp_min_gain)
        gain = dr.maximum(gain, a)
        merged_signal = mapped(_merged(gain, a), signal, e, wide)
        energy, variance = smoothed.energies[s], innovations.variances[s]
        noise = dr.select(is_new, spatial[s], dr.maximum(energy - variance, energy * MIN_NOISE))
        merged.append(NoisySignal(merged_signal, dr.fma(dr.square(1 - a), variance,
                                                        dr.square(a) * noise)))
    return Merged(merged, fade_out(innovations.length, gains.fade_frames))


def _merged(gain: Float, a: Float) -> Callable[[Float, Float, Float], Float]:
    """Function of (d, e, S[e])."""
    return lambda d, e, wide: dr.fma(gain - a, wide, dr.fma(a - 1, e, d))


def _choose_history(innovations: Innovations, shadow: ShadowInnovation,
                    smoothed: Smoothed) -> tuple[Innovations, Smoothed]:
    """With the shadow history of visibility in the place of the other one, where it is better."""
    excess, energy, shadow_wide = smoothed.excess, smoothed.energies[-1], smoothed.shadow_innovation
    assert excess is not None
    assert shadow_wide is not None
    better = excess < 0
    e, wide = innovations.signals[-1], smoothed.sharp[-1]
    e = e._replace(luminance=dr.select(better, shadow.innovation, e.luminance))
    wide = wide._replace(luminance=dr.select(better, shadow_wide, wide.luminance))
    variance = dr.select(better, shadow.variance, innovations.variances[-1])
    energy = dr.maximum(energy + dr.minimum(excess, 0), 0)
    return (innovations._replace(signals=[*innovations.signals[:-1], e],
                           variances=[*innovations.variances[:-1], variance]),
            smoothed._replace(sharp=[*smoothed.sharp[:-1], wide],
                              energies=[*smoothed.energies[:-1], energy]))


def _certainty(spread: Float, wide: Signal, gains: Gains) -> Float:
    """c = 1 - k Q / l(S[e])^2."""
    return 1 - gains.noise_threshold * spread / dr.maximum(dr.square(wide.luminance), _MIN_ENERGY)
