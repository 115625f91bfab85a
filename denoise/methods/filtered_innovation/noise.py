"""The noise of a signal without history, from one frame."""

# pyright: standard
from __future__ import annotations

from itertools import product
from typing import Any

import drjit as dr

from onespp.denoise.filters.tangent_plane import BINOMIAL
from onespp.denoise.inputs.signals import Signal
from onespp.denoise.inputs.surface import TangentPlane
from onespp.denoise.jit.arrays import Bool, Float
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.masked import tabulate, weighted_sums, window_taps

RADIUS = 2                     # pixels, of the window of the spatial variance
NO_SAMPLE = -1.0               # in the place of a visibility
PRIOR_VARIANCE = 0.25          # of visibility that nothing is known of
MAX_ENERGY = 1e36             # squares of luminance stay below: sums of them must not overflow


def spatial_variances(stencil: Stencil, signals: list[Signal], active: Bool,
                      plane: TangentPlane, sparse: list[Float]) -> list[Float]:
    """Variance of each signal's luminance where `active`, from one frame.

    Mean square of what a 3x3 smoothing over the surface takes away, around the 3x3 pixels of the
    middle, over the share that it would take of white noise. An edge of light leaves less in it
    than in the variance of the window.

    Args:
        sparse: signals of which few pixels have a sample, `NO_SAMPLE` elsewhere, which come after
            the others; the variance of each is that over the window's samples.
    """
    lum = [signal.luminance for signal in signals]
    table = tabulate(stencil, [plane.inverse_depth, *lum, *sparse])
    dr.eval(table)
    around = window_taps(stencil, RADIUS, table)

    def mean_square(_: Any) -> tuple[Float, list[Float]]:
        near, values = {}, {}
        few = [(stencil.Float(0),) * 3] * len(sparse)
        for i, at in enumerate(product(range(-RADIUS, RADIUS + 1), repeat=2)):
            inside, dy, dx, (tap_inverse_depth, *luminances) = around(i)
            expected = dr.fma(plane.dx, dx, dr.fma(plane.dy, dy, plane.inverse_depth))
            near[at] = inside & (dr.abs(tap_inverse_depth - expected) * plane.scale < 1)
            values[at] = luminances[:len(lum)]
            few = [_with_sample(near[at], v, m)
                   for v, m in zip(luminances[len(lum):], few)]
        count, sums = stencil.Float(0), [stencil.Float(0)] * len(lum)
        for cy, cx in product(range(1 - RADIUS, RADIUS), repeat=2):
            total, squares, *means = [stencil.Float(0)] * (2 + len(lum))
            for dy, dx in product((-1, 0, 1), repeat=2):
                at = cy + dy, cx + dx
                h = dr.select(near[at], stencil.Float(BINOMIAL[abs(dy)] * BINOMIAL[abs(dx)]), 0)
                total, squares = total + h, dr.fma(h, h, squares)
                means = [dr.fma(h, v, m) for v, m in zip(values[at], means)]
            norm = 1 / dr.maximum(total, 1e-6)
            share = 1 - 2 * BINOMIAL[0]**2 * norm + squares * norm * norm
            counts = near[cy, cx] & (share > 0.1)
            scaled = 1 / dr.maximum(share, 0.1)
            count += dr.select(counts, stencil.Float(1), 0)
            sums = [s + dr.select(counts, dr.square(v - m * norm) * scaled, 0)
                    for s, v, m in zip(sums, values[cy, cx], means)]
        norm = 1 / dr.maximum(count, 1)
        return stencil.Float(1), [*(s * norm for s in sums), *(_variance(*m) for m in few)]

    _, variances = weighted_sums(stencil, active, 1, len(lum) + len(sparse), mean_square)
    return [dr.minimum(v, MAX_ENERGY) for v in variances]


def _with_sample(near: Bool, value: Float, moments: tuple[Float, ...]) -> tuple[Float, ...]:
    """Number, sum and sum of squares, with one tap more if it has a sample."""
    has = near & (value != NO_SAMPLE)
    value = dr.select(has, value, 0)
    count, first, second = moments
    return count + dr.select(has, type(value)(1), 0), first + value, dr.fma(value, value, second)


def _variance(count: Float, first: Float, second: Float) -> Float:
    """Of samples; `PRIOR_VARIANCE` of less than two."""
    mean = first / dr.maximum(count, 1)
    variance = dr.maximum(second - first * mean, 0) / dr.maximum(count - 1, 1)
    return dr.select(count > 1.5, variance, PRIOR_VARIANCE)
