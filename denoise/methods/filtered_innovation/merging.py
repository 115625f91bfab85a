"""A signal and its history merged by the filtered innovation."""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import drjit as dr

from onespp.denoise.filters.contact import ContactFalloff, contact_falloff
from onespp.denoise.filters.penumbra import sharpened
from onespp.denoise.inputs.signals import LARGEST_VISIBILITY, Chosen, Signal, SignalKind
from onespp.denoise.inputs.surface import TangentPlane
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import mapped

from .change import (
    MIN_ENERGY,
    Doubts,
    certainty,
    coin_variance,
    lengths_left,
    threshold_of_light,
)
from .innovation import Innovations, ShadowInnovation, seen_twice, weights_of
from .layout import NoisySignal, Pair, SignalLayout, Smoothed
from .noise import MAX_ENERGY, NO_SAMPLE, PRIOR_VARIANCE, spatial_variances
from .output import FEWEST_SAMPLES, fade_out
from .texture import error_of_history, parts_of, renewal

OF_STILL = 0.4                 # share of g' where shadows stand still
OF_STILL_IMAGE = 2 / 3         # share of g'' where a mirror direction does
OF_MOVING_IMAGE = 0.5          # weight of a frame where what is reflected moves
MIN_NOISE = 0.25               # share of the innovation's energy that is at least noise of d
_FILLED = 0.5                  # samples that what was filtered counts for
_UNKNOWN = 0.5                 # visibility that nothing is known of
_MOST_SAMPLES = 64.0
LEAST_MEAN = -0.5              # of h + S[e] / S[omega]; lone rays with a small omega say anything
_LEAST_OMEGA = 0.1             # that a lone sample is divided by
_OTHER_IMAGE = 0.5             # lobes by which a mirror direction may turn
_MOVING_IMAGE = 1 / 30         # lobes by which one that does not stand still turns, at least
_RENEWED = 2.0                 # n below which the noise is estimated anew


class Gains(NamedTuple):
    """How history follows.

    Attributes:
        alphas: of each signal. min_gain: g. expected_change: b. sharp_min_gain: g'.
        glossy_gain: g''. change_alpha: r. fade_frames: until the last filter has faded.
        doubts: of `change.py`.
    """

    alphas: list[Float]
    min_gain: Float
    expected_change: Float
    sharp_min_gain: Float
    glossy_gain: Float
    change_alpha: Float
    fade_frames: Float
    doubts: Doubts


class Merged(NamedTuple):
    """The new history of each signal, its lengths, and `fade_out` of each signal, of sparse ones by
    their samples; `penumbra.sharpened` of each visibility that shadow rays tell of; of light with
    texture, what it was made of; what `contact.py` asks for; and of each light with peaks the
    lesser luminance of the frame and of its history, 0 without one."""

    signals: list[NoisySignal]
    lengths: list[Float]
    fades: list[Float]
    sparse_fades: list[Float]
    footprints: list[Float]
    parts: Pair | None = None
    contact: ContactFalloff | None = None
    seen_twice: Sequence[Float] = ()


def merge(stencil: Stencil, layout: SignalLayout, signals: list[Signal], innovations: Innovations,
          chosen: Chosen | None, smoothed: Smoothed, plane: TangentPlane, gains: Gains) -> Merged:
    """The new history, and how the last filter fades out with it."""
    if innovations.shadows:
        innovations, smoothed = _choose_history(innovations, innovations.shadows[0], smoothed)
    is_new = innovations.lengths[0] < 1.5
    omegas = weights_of(layout, chosen)
    dense = [s for s, omega in enumerate(omegas) if omega is None]
    first = [_only_sample(y, omega) for y, omega in zip(signals, omegas) if omega is not None]
    changes = [_change(wide.luminance, weight, sparse.history) for wide, weight, sparse in zip(
        smoothed.each[len(dense):], smoothed.weights, innovations.sparse, strict=True)]
    left = lengths_left(layout, innovations, smoothed, changes, gains.doubts)
    lengths = list(innovations.lengths)
    for s in dense:
        lengths[layout.length(s)] = dr.minimum(lengths[layout.length(s)], left[s])
    lengths = [dr.maximum(n, 1) for n in lengths]
    is_renewed = [n < _RENEWED for n in left]
    turned = innovations.turned
    if turned is not None:
        glossy = layout.kinds.index(SignalKind.GLOSSY)
        is_renewed[glossy] = is_renewed[glossy] | (turned > _OTHER_IMAGE)  # a new mask
    asks = is_new
    for renewed in is_renewed:
        asks = asks | renewed
    spatial = ([innovations.spatial] if innovations.spatial is not None else
               spatial_variances(stencil, [signals[s] for s in dense], asks, plane, first))
    visible = dict(zip(layout.visibilities, smoothed.visibility_spread, strict=True))
    merged, sparse_fades = [], []

    def estimated(noise: Float, most: Float, s: int) -> Float:
        """Noise of a sample, from one frame where history says little of it."""
        noise = dr.select(is_renewed[s], dr.minimum(spatial[s], most), noise)
        return dr.select(is_new, spatial[s], noise)

    for s, (kind, signal, wide) in enumerate(
            zip(layout.kinds, signals, smoothed.each, strict=True)):
        e = innovations.signals[s]
        variance, omega, samples = innovations.variances[s], omegas[s], None
        alpha, gain = gains.alphas[s], gains.glossy_gain
        if kind is SignalKind.DIFFUSE:
            certain = certainty(smoothed.diffuse_spread, dr.square(wide.luminance),
                                threshold_of_light(gains.doubts, innovations.rests))
            change = gains.expected_change * (signal.luminance - e.luminance + wide.luminance)
            gain = dr.maximum(certain, gains.min_gain * expected_gain(
                change, smoothed.diffuse_spread))
        elif kind is SignalKind.VISIBILITY:
            certain = certainty(visible[s], dr.square(wide.luminance), gains.doubts.threshold)
            least, f = gains.sharp_min_gain, layout.follower(s)
            if f is not None:
                least = least * dr.fma(1 - OF_STILL, innovations.unrest[f], OF_STILL)
            gain = dr.maximum(certain, least)
            alpha = dr.maximum(alpha, gains.change_alpha * certain)
        elif turned is not None:  # glossy light
            alpha = dr.maximum(alpha, turned)
            moves = dr.minimum(turned * (1 / _MOVING_IMAGE), 1)
            gain = gain * dr.fma(1 - OF_STILL_IMAGE, moves, OF_STILL_IMAGE)
            if innovations.image_turned is not None:
                gain = dr.fma(innovations.image_turned, 1 - gain, gain)
                alpha = dr.maximum(alpha, OF_MOVING_IMAGE * innovations.image_turned)
        if omega is None:
            a = dr.maximum(1 / lengths[layout.length(s)], alpha)
            energy = smoothed.energies[s]
            if smoothed.misses is None or smoothed.spatial is None:
                noise = estimated(dr.maximum(energy - variance, energy * MIN_NOISE), energy, s)
            else:
                most = dr.maximum(spatial[s], smoothed.spatial)
                error = error_of_history(smoothed.misses, energy, energy - variance - most)
                error = dr.select(is_new, 0, error)
                noise = dr.maximum(energy - variance - error, energy * MIN_NOISE)
                noise = estimated(dr.minimum(noise, most), energy, s)
                a = dr.maximum(a, renewal(error, noise))
                lengths[layout.length(s)] = dr.minimum(lengths[layout.length(s)], 1 / a)
            merged_signal = mapped(_merged(dr.maximum(gain, a), a), signal, e, wide)
        else:
            g = s - len(dense)
            old, change = innovations.sparse[g], changes[g]
            known = dr.minimum(old.samples, left[s])
            filled = _FILLED * dr.minimum(left[s], 1)
            a = dr.minimum(dr.maximum(1 / (known + old.weight + filled), alpha), 1)
            gain = dr.maximum(gain, 1 - known)  # what was filtered knows less than S
            v = dr.fma(gain, change, old.history)
            v = dr.fma(a, dr.fma(-old.weight, change, e.luminance), v)
            alone = dr.select(first[g] >= 0, first[g], _UNKNOWN)
            merged_signal = Signal(None, dr.select(is_new, alone, v), None)
            noise = coin_variance(old.history + change)
            noise = estimated(noise, noise, s)
            samples = dr.minimum(known + omega, _MOST_SAMPLES)
            a = dr.select(is_new, dr.select(omega > 0, type(a)(1), 0), dr.minimum(a * omega, 1))
            sparse_fades.append(fade_out(samples, gains.fade_frames))
        variance = dr.fma(dr.square(1 - a), variance, dr.square(a) * noise)
        if samples is not None:
            variance = dr.select(samples > FEWEST_SAMPLES, variance, PRIOR_VARIANCE)
        merged.append(NoisySignal(merged_signal, variance, samples))
    fades = [fade_out(lengths[layout.length(s)], gains.fade_frames) for s in dense]
    parts = parts_of(signals[0], innovations.signals[0]) if layout.has_texture else None
    contact = innovations.contact and contact_falloff(innovations.contact, lengths[0])
    footprints = []
    for s, falloff in enumerate(innovations.footprint_falloffs, len(merged) - layout.followed):
        samples = merged[s].samples
        footprints.append(sharpened(
            falloff, lengths[layout.length(s)] if samples is None else samples))
    twice = seen_twice([signals[s] for s in layout.with_peaks],
                       [innovations.signals[s] for s in layout.with_peaks], innovations.lengths[0])
    return Merged(merged, lengths, fades, sparse_fades, footprints, parts, contact, twice)


def expected_gain(change: Float, spread: Float) -> Float:
    """L / (L + Q); change: the root of L."""
    size = dr.minimum(dr.square(change), MAX_ENERGY)
    return size / dr.maximum(size + spread, MIN_ENERGY)


def _only_sample(signal: Signal, omega: Float) -> Float:
    """V of a sparse signal from one sample, `NO_SAMPLE` where there is none."""
    v = dr.minimum(signal.luminance / dr.maximum(omega, _LEAST_OMEGA), LARGEST_VISIBILITY)
    return dr.select(omega > 0, v, NO_SAMPLE)


def _change(wide: Float, weight: Float, history: Float) -> Float:
    """S[e] / S[omega], such that the mean of visibility stays within its bounds."""
    low = dr.fma(_norm(weight), wide, history)
    return dr.clip(low, LEAST_MEAN, LARGEST_VISIBILITY) - history


def _norm(weight: Float) -> Float:
    """1 over a smoothed omega, 0 where hardly a ray came by."""
    there = weight > FEWEST_SAMPLES
    return dr.select(there, 1 / dr.select(there, weight, 1), 0)


def _merged(gain: Float, a: Float) -> Callable[[Float, Float, Float], Float]:
    """Function of (d, e, S[e])."""
    return lambda d, e, wide: dr.fma(gain - a, wide, dr.fma(a - 1, e, d))


def _choose_history(innovations: Innovations, shadow: ShadowInnovation,
                    smoothed: Smoothed) -> tuple[Innovations, Smoothed]:
    """With the shadow history of visibility in the place of the other one, where it is better."""
    excess, energy = smoothed.excess[0], smoothed.energies[-1]
    better = excess < 0
    e, wide = innovations.signals[-1], smoothed.sharp[-1]
    e = e._replace(luminance=dr.select(better, shadow.innovation, e.luminance))
    wide = wide._replace(luminance=dr.select(better, smoothed.shadow_innovation[0],
                                             wide.luminance))
    variance = dr.select(better, shadow.variance, innovations.variances[-1])
    energy = dr.maximum(energy + dr.minimum(excess, 0), 0)
    return (innovations._replace(signals=[*innovations.signals[:-1], e],
                                 variances=[*innovations.variances[:-1], variance]),
            smoothed._replace(sharp=[*smoothed.sharp[:-1], wide],
                              energies=[*smoothed.energies[:-1], energy]))
