"""The last filter, whose result is looked at and not kept."""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import drjit as dr

from onespp.denoise.filters.atrous import EPSILON
from onespp.denoise.filters.tangent_plane import BINOMIAL, SurfaceTap, surface_exponent
from onespp.denoise.inputs.signals import SignalKind
from onespp.denoise.inputs.surface import TangentPlane
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.fastmath import exp2
from onespp.denoise.jit.structure import mapped
from onespp.denoise.jit.taps import Taps, window

from .layout import NoisySignal, SignalLayout
from .smoothing import footprint

_NEVER = -1e3                  # log2 of a weight that is 0


class OutputFalloff(NamedTuple):
    """What weakens the taps of the last filter: `fade_out` of its last level, and visibility's
    `penumbra.footprint_falloff`, None without shadow rays."""

    fade: Float
    footprint: Float | None


def output_level(layout: SignalLayout, level: int, values: Taps[list[NoisySignal]],
                 surfaces: Taps[SurfaceTap], plane: TangentPlane, spacing: Float,
                 falloff: OutputFalloff, sigmas: list[Float]) -> list[NoisySignal]:
    """One level of the last filter. The last tap is the pixel itself.

    Args:
        values: the signals that are left at this level.
        sigmas: sqrt(log2(e)) / sigma of each signal. Others as of `smooth_level`.
    """
    exponent = surface_exponent(surfaces, plane, spacing)
    nearer, h0 = footprint(falloff.footprint, spacing), BINOMIAL[0]**2
    kinds, center = layout.output_level(level), values.at(-1)
    sums = [NoisySignal(mapped(lambda v: v * h0, c.signal), c.variance * h0**2) for c in center]
    scales = [sigma / (dr.sqrt(c.variance) + EPSILON) for c, sigma in zip(center, sigmas)]
    totals = [type(plane.dx)(h0) for _ in kinds]
    for i, offset in enumerate(window(1)):
        taps, surface_x = values.at(i), exponent(i, offset)
        for s, (kind, tap) in enumerate(zip(kinds, taps, strict=True)):
            distance = (tap.signal.luminance - center[s].signal.luminance) * scales[s]
            x = dr.fma(distance, -distance, surface_x)
            if kind is SignalKind.VISIBILITY:
                x = nearer(x, offset)
            w = exp2(x + falloff.fade if layout.is_last_level(kind, level) else x)
            totals[s] += w
            sums[s] = NoisySignal(mapped(_weighted(w), tap.signal, sums[s].signal),
                                  dr.fma(w * w, tap.variance, sums[s].variance))
        values.next()
    norms = [1 / total for total in totals]
    return [NoisySignal(mapped(_times(norm), noisy.signal), noisy.variance * dr.square(norm))
            for noisy, norm in zip(sums, norms)]


def _weighted(w: Float) -> Callable[[Float, Float], Float]:
    """Function of (tap, sum)."""
    return lambda tap, total: dr.fma(w, tap, total)


def _times(factor: Float) -> Callable[[Float], Float]:
    return lambda value: value * factor


def fade_out(length: Float, frames: Float) -> Float:
    """log2 of 1 - (n - 1) / frames, which falls from 1 to 0."""
    left = 1 - (length - 1) / frames
    return dr.select(left > 1e-6, dr.log2(dr.maximum(left, 1e-6)), _NEVER)
