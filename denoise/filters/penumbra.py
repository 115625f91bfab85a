"""How wide the soft edge of a shadow is: how far visibility may be filtered.

Past an edge that is d away from a surface, a light of size s, D away, throws a penumbra of width

    w = s d / ((D - d) cos),

cos being of the angle at which the light meets the surface: where it grazes, a penumbra is long. On
the screen that is w f / z pixels, f being the pixels of a unit length at depth 1. Each shadow ray
that was stopped tells d and D; s is how far the points lie apart that the frame's shadow rays asked
a light for. A level of `innovation.py` weighs a tap of visibility, r pixels away, also by

    exp(-r^2 q / (2 p^2)),

p a parameter and q the mean of 1 / (w^2 + 1) over the rays around that were stopped; one of the
last filter by (1 + (n - 1) / 8) q, n being the samples that the history holds. Contact
shadows stay sharp, whatever the noise; where nothing is in the light's way, q is 0.

Rays to one of several groups of lights are few, and near a contact those that were stopped may all
have gone to others. What stands in the way of one light is likely to be in that of another: q of a
group is at least three tenths of that of all rays. Our own.

Where w is far below a pixel a shadow is as hard as a ray, and what a pixel's own ray met there is
all of its visibility, while history is of places a part of a pixel away. With q of its own ray, 0
unless that was stopped, the visibility that is looked at is

    V (1 - 3/4 q^8).

Source: Mehta et al. 2012, "Axis-Aligned Filtering for Interactive Sampled Soft Shadows", which
takes the extremes of d around a pixel, not a mean, and filters by this width alone.
"""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr

from onespp.denoise.jit.arrays import Bool, Float
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import mapped
from onespp.render.channels import SUN

IN_HARD_SHADOW = 0.75          # most that a stopped ray takes off its pixel's visibility
_HISTORY = 8.0                 # samples beyond the first that make it twice as narrow
_OF_ALL = 0.3                  # share of q of all rays that q of a group is at least


class PenumbraSample(NamedTuple):
    """Whether a pixel's shadow ray was stopped, 1 or 0, and q where it was; or means of these."""

    blocked: Float
    inverse_width: Float


def penumbra_samples(stencil: Stencil, blocked: Bool, share: Float, cosine: Float, light_id: Float,
                     depth: Float, focal: Float, sizes: Float) -> PenumbraSample:
    """How sharp each pixel's shadow is.

    Args:
        blocked: of `shadow_motion.stopped`. share: d / D. cosine: between the ray and the normal.
        light_id: what the ray was sent to. focal: f. sizes: of `light_sizes`.
    """
    from_end = dr.maximum(light_id, SUN) + float(dr.width(sizes))
    size = dr.gather(stencil.Float, sizes, stencil.UInt(
        dr.select(blocked, dr.select(light_id >= 0, light_id, from_end), 0)))
    left = dr.square((1 - share) * cosine)
    q = left / dr.maximum(dr.square(size * share * focal / depth) + left, 1e-20)
    return PenumbraSample(dr.select(blocked, stencil.Float(1), 0),
                          dr.select(blocked & (q > 0), q, 0))


def footprint_falloff(around: PenumbraSample, scale: Float, min_share: float) -> Float:
    """log2(e) q / (2 p^2) of each pixel: what a tap's squared distance takes off the log2 of its
    weight.

    Args:
        around: `penumbra_samples`, smoothed. scale: log2(e) / (2 p^2).
        min_share: of the rays around; where fewer were stopped, nothing is in the light's way.
    """
    shadowed = around.blocked > min_share
    return dr.select(shadowed,
                     scale * around.inverse_width / dr.select(shadowed, around.blocked, 1), 0)


def footprint_falloffs(around: list[PenumbraSample], scale: Float,
                       min_share: float) -> list[Float]:
    """`footprint_falloff` of each group of lights."""
    falloffs = [footprint_falloff(group, scale, min_share) for group in around]
    if len(around) < 2:
        return falloffs
    together = mapped(lambda *of_each: sum(of_each), *around)
    least = _OF_ALL * footprint_falloff(together, scale, min_share)
    return [dr.maximum(falloff, least) for falloff in falloffs]


def sharpened(falloff: Float, samples: Float) -> Float:
    """A `footprint_falloff` as the last filter has it; samples: n."""
    return falloff * dr.fma(dr.maximum(samples - 1, 0), 1 / _HISTORY, 1)


def left_in_hard_shadow(inverse_width: Float) -> Float:
    """What is left of a pixel's visibility; inverse_width: q of its own ray."""
    return dr.fma(dr.square(dr.square(dr.square(inverse_width))), -IN_HARD_SHADOW, 1)
