"""The last filter, whose result is looked at and not kept."""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import drjit as dr

from onespp.denoise.filters.atrous import EPSILON
from onespp.denoise.filters.bent import Bend, along
from onespp.denoise.filters.contact import ContactFalloff
from onespp.denoise.filters.tangent_plane import BINOMIAL, SurfaceTap, surface_exponent
from onespp.denoise.inputs.signals import SignalKind
from onespp.denoise.inputs.surface import TangentPlane
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.fastmath import exp2
from onespp.denoise.jit.structure import mapped
from onespp.denoise.jit.taps import Offset, Taps, window

from .layout import NoisySignal, SignalLayout
from .smoothing import footprint

FEWEST_SAMPLES = 1e-5          # that a sparse signal's pixel counts for where it has none
WIDE_LOBE = 0.1                # roughness: such a lobe blurs an image as far as the filter does
NEIGHBOURS_NOISE = {           # share of a noisier neighbour's variance beyond the pixel's own
    SignalKind.DIFFUSE: 0.2, SignalKind.GLOSSY: 1.0, SignalKind.VISIBILITY: 0.0}
_NOISY = 2.5                   # times the variance over the square of the mean: all of a level
_NEVER = -1e3                  # log2 of a weight that is 0


class OutputFalloff(NamedTuple):
    """What weakens the taps of the last filter: `fade_out` of its last level, of each signal that
    is not sparse and of each that is, `penumbra.footprint_falloff` of each visibility that shadow
    rays tell of, `contact_falloff` where there are such rays, and by what sigma of glossy
    light is divided, of `narrowed`, and how it is bent, `bent.with_history`."""

    fades: list[Float]
    sparse_fades: list[Float]
    footprints: list[Float]
    contact: ContactFalloff | None
    narrowed: Float | None
    bend: Bend | None


def output_level(layout: SignalLayout, level: int, values: Taps[list[NoisySignal]],
                 surfaces: Taps[SurfaceTap], plane: TangentPlane, spacing: Float,
                 falloff: OutputFalloff, sigmas: list[Float]) -> list[NoisySignal]:
    """One level of the last filter. The last tap is the pixel itself.

    Args:
        values: the signals that are left at this level.
        sigmas: sqrt(log2(e)) / sigma of each signal. Others as of `smooth_level`.
    """
    exponent, h0 = surface_exponent(surfaces, plane, spacing), BINOMIAL[0]**2
    left, center = layout.output_level(level), values.at(-1)
    rules = [_Rule.of(layout, s, level, falloff, spacing, c) for s, c in zip(left, center)]
    sums = [_start(c, h0) for c in center]
    if falloff.narrowed is not None:
        sigmas = [sigma * falloff.narrowed if kind is SignalKind.GLOSSY else sigma
                  for kind, sigma in zip(layout.kinds, sigmas)]
    totals: list[Float] = [type(plane.dx)(h0) if c.samples is None else h0 * c.samples
                           for c in center]
    for i, offset in enumerate(window(1)):
        taps, surface_x = values.at(i), exponent(i, offset)
        for s, tap in zip(left, taps, strict=True):
            c = center[s]
            precision = 1 / (rules[s].noise(c.variance, tap.variance) + EPSILON**2)
            distance = (tap.signal.luminance - c.signal.luminance) * sigmas[s]
            x = rules[s].nearer(surface_x - dr.square(distance) * precision, offset)
            fade = rules[s].fade
            w = exp2(x if fade is None else x + fade)
            samples = sums[s].samples
            if samples is not None and tap.samples is not None:
                samples, w = samples + w, w * tap.samples
            totals[s] = totals[s] + w
            sums[s] = NoisySignal(mapped(_weighted(w), tap.signal, sums[s].signal),
                                  dr.fma(w * w, tap.variance, sums[s].variance), samples,
                                  mapped(_weighted(w), tap.parts, sums[s].parts))
        values.next()
    norms = [1 / total for total in totals]
    return [NoisySignal(mapped(_times(norm), noisy.signal), noisy.variance * dr.square(norm),
                        None if noisy.samples is None else total / noisy.samples,
                        mapped(_times(norm), noisy.parts))
            for noisy, norm, total in zip(sums, norms, totals)]


def narrowed(roughness: Float, mirror: Float) -> Float:
    """By what sigma is divided where glossy lobes are narrow, 1 from `WIDE_LOBE` on.

    mirror: what a mirror's sigma is over that of diffuse light.
    """
    return 1 / dr.clip(roughness * (1 / WIDE_LOBE), mirror, 1)


class _Rule(NamedTuple):
    """How a signal's taps are weakened: by distance; at the last level, but for glossy light, whose
    noise is rare bright pixels that a long history holds too; at a level that is there for what is
    noisy still; and the variance that they are judged by.

    Judged by the pixel's own, a bright pixel, which is noisy, takes from dark ones what they do not
    take from it, and light is lost. So diffuse light counts some of the neighbour's (more would
    spread what is rare), glossy light all of it. Visibility does not: a shadow's edge is noisier
    than what it is the edge of.
    """

    nearer: Callable[[Float, Offset], Float]
    fade: Float | None
    neighbours_noise: float

    def noise(self, own: Float, neighbours: Float) -> Float:
        if not self.neighbours_noise:
            return own
        return dr.fma(self.neighbours_noise, dr.maximum(neighbours - own, 0), own)

    @staticmethod
    def of(layout: SignalLayout, s: int, level: int, falloff: OutputFalloff,
           spacing: Float, center: NoisySignal) -> _Rule:
        f, g = layout.follower(s), layout.group(s)
        is_glossy = layout.kinds[s] is SignalKind.GLOSSY
        fade = falloff.fades[s] if g is None else falloff.sparse_fades[g]
        near = None if f is None else falloff.footprints[f]
        if falloff.contact is not None and near is None:
            near = falloff.contact.glossy if is_glossy else falloff.contact.diffuse
        if layout.is_noisy_level(s, level):
            fade = noise_left(center)
        elif is_glossy or not layout.is_last_level(s, level):
            fade = None
        nearer = footprint(near, spacing)
        if is_glossy and falloff.bend is not None:
            nearer = along(falloff.bend, spacing, nearer)
        return _Rule(nearer, fade, NEIGHBOURS_NOISE[layout.kinds[s]])


def _start(center: NoisySignal, h0: float) -> NoisySignal:
    """The sums with the pixel itself alone; of a sparse signal `samples` is the sum of weights."""
    if center.samples is None:
        return NoisySignal(mapped(lambda v: v * h0, center.signal), center.variance * h0**2,
                           None, mapped(lambda v: v * h0, center.parts))
    w = center.samples * h0
    return NoisySignal(mapped(lambda v: v * w, center.signal), center.variance * dr.square(w),
                       type(w)(h0))


def _weighted(w: Float) -> Callable[[Float, Float], Float]:
    """Function of (tap, sum)."""
    return lambda tap, total: dr.fma(w, tap, total)


def _times(factor: Float) -> Callable[[Float], Float]:
    return lambda value: value * factor


def noise_left(light: NoisySignal) -> Float:
    """log2 of 5/2 s^2 / l^2, at most 0: a tap's weight where so much of the noise is left."""
    mean2 = dr.square(light.signal.luminance)
    share = _NOISY * light.variance / dr.maximum(mean2, EPSILON**2)
    return dr.log2(dr.clip(share, 1e-6, 1))


def fade_out(length: Float, frames: Float) -> Float:
    """log2 of 1 - (n - 1) / frames, which falls from 1 to 0."""
    left = dr.minimum(1 - (length - 1) / frames, 1)
    return dr.select(left > 1e-6, dr.log2(dr.maximum(left, 1e-6)), _NEVER)
