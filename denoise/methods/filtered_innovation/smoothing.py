"""The wide smoothing of the innovation, over the surface by geometry alone."""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import drjit as dr

from onespp.denoise.filters.tangent_plane import BINOMIAL, SurfaceTap, surface_exponent
from onespp.denoise.inputs.surface import TangentPlane
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.fastmath import exp2
from onespp.denoise.jit.taps import Offset, Taps, window

from .layout import PlaneRule


def smooth_level(rules: Sequence[PlaneRule], values: Taps[list[Float]], surfaces: Taps[SurfaceTap],
                 plane: TangentPlane, spacing: Float,
                 falloffs: Sequence[Float] = ()) -> list[Float]:
    """One level of S, and of Q. The last tap is the pixel itself.

    Args:
        rules: of each plane in `values`. spacing: pixels between taps.
        falloffs: `penumbra.footprint_falloff` of each light that a rule names.
    """
    exponent = surface_exponent(surfaces, plane, spacing)
    nearer = [footprint(falloff, spacing) for falloff in falloffs]
    many = len(falloffs) > 1
    factors = [decays(falloff, spacing) for falloff in falloffs] if many else []
    h0 = BINOMIAL[0]**2

    def each(wide: Any, *near: Any) -> list[Any]:
        """The factor of each plane, of the plain ones and of those within a penumbra."""
        each_of = [wide if rule.penumbra is None else near[rule.penumbra] for rule in rules]
        return [dr.square(f) if rule.squared else f for f, rule in zip(each_of, rules)]

    totals = [type(plane.dx)(h0)] * (1 + len(falloffs))
    sums = [f * v for f, v in zip(each(*[h0] * len(totals)), values.at(-1), strict=True)]
    for i, offset in enumerate(window(1)):
        x = exponent(i, offset)
        w = exp2(x)
        weights = [w, *((w * factor(offset) for factor in factors) if many else
                        (exp2(within(x, offset)) for within in nearer))]
        sums = [dr.fma(w, v, s) for w, v, s in zip(each(*weights), values.at(i), sums)]
        totals = [t + w for t, w in zip(totals, weights)]
        values.next()
    return [f * s for f, s in zip(each(*[1 / total for total in totals]), sums)]


def fill_level(values: Taps[list[Float]], surfaces: Taps[SurfaceTap], plane: TangentPlane,
               spacing: Float) -> list[Float]:
    """A plane, where it is not known the mean of the neighbours that know it, if any do.

    Args:
        values: the plane, 0 where it is not known, and whether it is. Others as of `smooth_level`.
    Returns:
        both planes, the second as it was.
    """
    around, share = smooth_level([PlaneRule(1)] * 2, values, surfaces, plane, spacing)
    value, is_known = values.at(-1)
    is_filled = (is_known == 0) & (share > 0)
    return [dr.select(is_filled, around / dr.select(is_filled, share, 1), value), is_known]


def footprint(falloff: Float | None, spacing: Float) -> Callable[[Float, Offset], Float]:
    """Function of (x, offset): log2 x of a weight, less the more the farther a tap is.

    falloff: `penumbra.footprint_falloff`, or None, which takes nothing off.
    """
    if falloff is None:
        return lambda x, _: x
    rate = falloff * dr.square(spacing)
    return lambda x, offset: dr.fma(rate, -float(offset[0]**2 + offset[1]**2), x)


def decays(falloff: Float, spacing: Float) -> Callable[[Offset], Float]:
    """As `footprint`, function of the offset, within 1 pixel, to what a weight is multiplied by:
    quicker where several lights ask for it."""
    near = exp2(-falloff * dr.square(spacing))
    far = dr.square(near)
    return lambda offset: far if offset[0] and offset[1] else near
