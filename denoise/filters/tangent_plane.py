"""Weights by the distance of a tap from the pixel's tangent plane."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import drjit as dr

from onespp.denoise.inputs.surface import TangentPlane
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.fastmath import LOG2E
from onespp.denoise.jit.taps import Offset, Taps

BINOMIAL = {0: 1 / 2, 1: 1 / 4}
OTHER_OBJECT_WEIGHT = 0.4      # of a pixel of another object, beside its distance


class SurfaceTap(NamedTuple):
    """What a tap is weighed by: 1/z, far away where the pixel does not count, and object ID."""

    inverse_depth: Float
    id: Float


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
