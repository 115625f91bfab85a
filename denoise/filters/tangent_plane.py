"""Weights by the distance of a tap from the pixel's tangent plane.

Where a surface is rougher than pixels can show (leaves, grass) no two pixels share a plane, and
nothing would be filtered. There a plane is worth less: with r the roughness, the least over the
four lines through a pixel of the greater distance of its two neighbours on that line, and t the
tolerated distance, slopes shrink by t / (t + r) and t grows to t + r. An edge, a crease or a bent
surface is not rough: some line follows it.

Leaves of several objects, or lone ones, have no line of their own, as little as a corner of a box
has, but are rough for some pixels around. With R the same among all pixels, whatever their object
is, and m the mean of R / (t + R) at the eight pixels two away,

    r <- max(r, clamp(4 m - 1, 0, 1) R).

Our own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import drjit as dr

from onespp.denoise.inputs.surface import TangentPlane
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.fastmath import LOG2E
from onespp.denoise.jit.taps import Offset, Taps, window

BINOMIAL = {0: 1 / 2, 1: 1 / 4}
OTHER_OBJECT_WEIGHT = 0.4      # of a pixel of another object, beside its distance
RING = [(2 * dy, 2 * dx) for dy, dx in window(1)]
_APART = 1e15                  # distance of what is not the same surface


class SurfaceTap(NamedTuple):
    """What a tap is weighed by: 1/z, far away where the pixel does not count, and object ID."""

    inverse_depth: Float
    id: Float


class Roughness(NamedTuple):
    """r / t, R / t and R / (t + R)."""

    own: Float
    any: Float
    share: Float


def roughness(surfaces: Taps[SurfaceTap], plane: TangentPlane) -> Roughness:
    """Of each pixel, given the 3x3 pixels around, of which the last is the pixel."""
    center, own, any_ = surfaces.at(-1), [], []
    for i, (dy, dx) in enumerate(window(1)):
        tap = surfaces.at(i)
        expected = dr.fma(plane.dx, float(dx), dr.fma(plane.dy, float(dy), center.inverse_depth))
        there = (tap.inverse_depth > 0) & (center.inverse_depth > 0)
        any_.append(dr.select(there, dr.abs(tap.inverse_depth - expected), _APART))
        own.append(dr.select(tap.id == center.id, any_[-1], _APART))
    of_own, of_any = (_least_line(distances) * plane.scale for distances in (own, any_))
    return Roughness(of_own, of_any, of_any / (1 + of_any))


def _least_line(distances: list[Float]) -> Float:
    """Least over lines of the greater distance, 0 where none is whole."""
    lines = [dr.maximum(a, b) for a, b in zip(distances[:4], distances[:3:-1], strict=True)]
    rough = dr.minimum(dr.minimum(lines[0], lines[1]), dr.minimum(lines[2], lines[3]))
    return dr.select(rough < _APART, rough, 0)


def loosened(shares: Taps[Float], rough: Roughness, plane: TangentPlane) -> TangentPlane:
    """The planes as they count; shares: R / (t + R) at `RING`, 0 outside the image."""
    mean = sum(shares.at(i) for i in range(len(shares))) * (1 / len(shares))
    among_leaves = dr.clip(dr.fma(mean, 4, -1), 0, 1)
    share = 1 / (1 + dr.maximum(rough.own, among_leaves * rough.any))
    return TangentPlane(plane.inverse_depth, plane.dx * share, plane.dy * share,
                        plane.scale * share)


def surface_exponent(surfaces: Taps[SurfaceTap], plane: TangentPlane,
                     spacing: Float) -> Callable[[int, Offset], Float]:
    """Function of (tap, offset): log2 of h times the weight of the distance from p's plane, and
    of being another object."""
    dx_, dy_, scale = plane.dx * spacing, plane.dy * spacing, plane.scale * LOG2E
    center = surfaces.at(-1)

    def exponent(i: int, offset: Offset) -> Float:
        dy, dx = offset
        tap = surfaces.at(i)
        expected = dr.fma(dx_, float(dx), dr.fma(dy_, float(dy), center.inverse_depth))
        log2_h = math.log2(BINOMIAL[abs(dy)] * BINOMIAL[abs(dx)])
        same = dr.select(tap.id == center.id, type(scale)(log2_h),
                         log2_h + math.log2(OTHER_OBJECT_WEIGHT))
        return dr.fma(dr.abs(tap.inverse_depth - expected), -scale, same)

    return exponent
