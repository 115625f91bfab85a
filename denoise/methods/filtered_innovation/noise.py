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
MAX_ENERGY = 1e36             # squares of luminance stay below: sums of them must not overflow


def spatial_variances(stencil: Stencil, signals: list[Signal], active: Bool,
                      plane: TangentPlane) -> list[Float]:
    """Variance of each signal's luminance where `active`, from one frame.

    Mean square of what a 3x3 smoothing over the surface takes away, around the 3x3 pixels of the
    middle, over the share that it would take of white noise. An edge of light leaves less in it
    than in the variance of the window.
    """
    lum = [signal.luminance for signal in signals]
    table = tabulate(stencil, [plane.inverse_depth, *lum])
    dr.eval(table)
    around = window_taps(stencil, RADIUS, table)

    def mean_square(_: Any) -> tuple[Float, list[Float]]:
        near, values = {}, {}
        for i, at in enumerate(product(range(-RADIUS, RADIUS + 1), repeat=2)):
            inside, dy, dx, (tap_inverse_depth, *luminances) = around(i)
            expected = dr.fma(plane.dx, dx, dr.fma(plane.dy, dy, plane.inverse_depth))
            near[at] = inside & (dr.abs(tap_inverse_depth - expected) * plane.scale < 1)
            values[at] = luminances[:len(lum)]
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
        return stencil.Float(1), [s * norm for s in sums]

    _, variances = weighted_sums(stencil, active, 1, len(lum), mean_square)
    return [dr.minimum(v, MAX_ENERGY) for v in variances]
