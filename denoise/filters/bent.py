"""How far glossy light may be filtered on a bent surface: as far as its lobes see the same.

From pixel to pixel the mirror direction turns by twice as much as the normal n. In widths of a lobe
that is

    g_x = 2 (dn / dx) / (2 alpha (1 + (alpha / alpha_0)^2) + LEAST_WIDTH),   alpha_0 = 0.15

along a row, and so g_y; alpha is the roughness (wide lobes see nearly the same, and their noise
asks for a wider filter). A tap, (x, y) pixels away, counts by

    exp(-2 k |x g_x + y g_y|^2),   k = n / (n + 3) / (1 + 3/4 (|g_x|^2 + |g_y|^2)),

n being the length of the history: the longer it is, the less noise is there that would want a wider
filter (as in `contact.py`). Where something is diffuse, too, g is 0: lamps' highlights are in
unshadowed light, and what else a coat reflects is so little that its noise matters more. Along a
tube its highlight is filtered, and not across. k lets something be filtered where normals differ
without an order, as on bumps. dn is the mean of the differences to the two neighbours that see the
same object.

Our own; NRD compares each tap's normal with the lobe's angle instead.
"""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import drjit as dr

from onespp.denoise.history.reflections import LEAST_WIDTH
from onespp.denoise.jit.arrays import Float, Vector3
from onespp.denoise.jit.fastmath import LOG2E
from onespp.denoise.jit.taps import Offset, Taps
from onespp.denoise.jit.vector import dot

from .contact import HALF_LENGTH

BESIDE = [(0, -1), (0, 1), (-1, 0), (1, 0), (0, 0)]
_WIDE = 0.15                   # alpha_0
_RATE = 2.0                    # of the exponent
_LEAST = 0.75                  # of |g|^2, which k is divided by


class Bend(NamedTuple):
    """log2(e) 2 k times g_x . g_x, g_x . g_y and g_y . g_y; 0 where there is no lobe,
    or a diffuse one."""

    xx: Float
    xy: Float
    yy: Float


def bend(normals: Taps[Vector3], ids: Taps[Float], roughness: Float) -> Bend:
    """Of each pixel, for a history without end.

    Args:
        normals: n, in any axes, and object IDs, at `BESIDE`.
        roughness: alpha, 1 where the bend is to be 0.
    """
    n, id_ = normals.at(-1), ids.at(-1)

    def difference(before: int, after: int) -> Vector3:
        there = [dr.select(ids.at(i) == id_, type(roughness)(1), 0) for i in (before, after)]
        share = 1 / dr.maximum(there[0] + there[1], 1)
        first, last = normals.at(before), normals.at(after)
        return Vector3(*[share * dr.fma(there[1], b - c, there[0] * (c - a))
                         for a, b, c in zip(first, last, n)])

    width = dr.fma(2 * roughness, dr.fma(dr.square(roughness), 1 / _WIDE**2, 1), LEAST_WIDTH)
    scale = dr.select(roughness < 1, dr.square(2 / width), 0)
    gx, gy = difference(0, 1), difference(2, 3)
    xx, xy, yy = (scale * dot(a, b) for a, b in ((gx, gx), (gx, gy), (gy, gy)))
    k = _RATE * LOG2E / dr.fma(xx + yy, _LEAST, 1)
    return Bend(k * xx, k * xy, k * yy)


def bent_share(whole: Bend) -> Float:
    """From 0, where a surface is flat for its lobes, to 1."""
    return (_LEAST / (_RATE * LOG2E)) * (whole.xx + whole.yy)


def with_history(whole: Bend, length: Float) -> Bend:
    """For a history of n frames."""
    trust = length / (length + HALF_LENGTH)
    return Bend(*[trust * x for x in whole])


def along(bend_: Bend, spacing: Float,
          nearer: Callable[[Float, Offset], Float]) -> Callable[[Float, Offset], Float]:
    """Function of (x, offset): log2 x of a weight, less what it is by `nearer` and by the bend;
    spacing: pixels between taps."""
    rate = dr.square(spacing)
    xx, xy, yy = (rate * x for x in bend_)

    def weakened(x: Float, offset: Offset) -> Float:
        dy, dx = offset
        turning = [float(c) * term for c, term in ((dx * dx, xx), (2 * dx * dy, xy), (dy * dy, yy))
                   if c]
        return nearer(x, offset) - sum(turning[1:], turning[0])

    return weakened
