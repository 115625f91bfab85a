"""A shadow's motion, and how bright its surroundings are, over a window of the same object.

Symbols: mean and sigma, mean and standard deviation of direct light over the pixels of 7x7 that are
of the pixel's object. A shadow ray that is lit tells nothing of a shadow's motion, so a pixel takes
the mean of those around that do; and what history brings along it is clamped to mean +- sigma, for
shadows of several objects cross.

Source: Zeng et al. 2021, section 4.1 (the clamp, there over colours of neighbours of any object).
"""

# pyright: standard
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import drjit as dr

from onespp.denoise.history.shadow_motion import ShadowMotion, shadow_motion
from onespp.denoise.inputs.shadow_rays import ShadowRays
from onespp.denoise.inputs.surface import SurfaceSample
from onespp.denoise.jit.arrays import Float, Vector3
from onespp.denoise.jit.color import LuminanceColor
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.masked import tabulate, weighted_sums, window_taps
from onespp.denoise.jit.structure import evaluate

RADIUS = 3  # pixels


class Surroundings(NamedTuple):
    """Means over a window: of a shadow's motion, of direct light, and its sigma."""

    motion: ShadowMotion
    mean: list[Float]
    sigma: list[Float]


def tabulate_shadows(stencil: Stencil, rays: ShadowRays, surface: SurfaceSample, position: Vector3,
                     direct: LuminanceColor) -> Float:
    """The window's table. Evaluated."""
    motion, _ = shadow_motion(stencil, rays, surface, position)
    table = tabulate(stencil, [stencil.Float(surface.id), *motion, *direct])
    evaluate(table)
    return table


def surroundings(stencil: Stencil, id_: Float, table: Float) -> Surroundings:
    """Of each pixel; id_: its object. table: of `tabulate_shadows`."""
    around, side = window_taps(stencil, RADIUS, table), 2 * RADIUS + 1

    def tap(i: Float) -> tuple[Float, list[Float]]:
        inside, _, _, words = around(i)
        same = inside & (words[0] == stencil.Float(id_))
        light = words[4:7]
        return (dr.select(same, stencil.Float(1), 0),
                [*words[1:4], *light, *(c * c for c in light)])

    total, sums = weighted_sums(stencil, stencil.Float(id_) >= 0, side * side, 9, tap)
    share = 1 / dr.maximum(total, 1)
    means = [s * share for s in sums]
    light = means[3:6]
    sigma = [dr.sqrt(dr.maximum(dr.fma(-m, m, q), 0)) for m, q in zip(light, means[6:])]
    return Surroundings(ShadowMotion(*means[:3]), light, sigma)


def clamped(values: Sequence[Float], around: Surroundings) -> list[Float]:
    """A colour within mean +- sigma."""
    return [dr.minimum(dr.maximum(v, m - s), m + s)
            for v, m, s in zip(values, around.mean, around.sigma)]
