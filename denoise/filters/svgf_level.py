"""SVGF's a-trous level, with its published weights.

Symbols as in `atrous.py`; grad z the change of depth from pixel to pixel. A signal is four planes
(r, l, b, v), filtered with

    w = h exp(-|l(p) - l(q)| / (sigma_luminance sqrt(g3x3(v)(p)) + eps))
        max(0, n(p) . n(q))^normal_power
        exp(-|z(p) - z(q)| / (sigma_depth |grad z(p) . (p - q)| + eps_z z(p)))

Two signals are two calls: to compute the last two factors once for both saves no time.

Departures from SVGF (Schied et al. 2017):
- grad z is that of the tangent plane, -z^2 times the slope of 1/z, not a finite difference.
- eps_z is relative to depth, so that the unit of length does not matter.
- x^128 = exp(-128 (t + t^2 / 2)), t = 1 - x; background as in `atrous.py`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import drjit as dr

from onespp.denoise.inputs.surface import Surface
from onespp.denoise.jit.arrays import Float, Vector3
from onespp.denoise.jit.color import LuminanceColor
from onespp.denoise.jit.fastmath import LOG2E, exp2
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.taps import Taps, window

from .atrous import SPLINE, LuminanceWeight, NoisyColor

EPSILON_DEPTH = 1e-3
_BACKGROUND = 1e20   # depth where there is no surface: far from any, so that its weight is 0
OUTSIDE = [0.0, 0.0, 0.0, 1e26]  # `Guides` outside the image


class Guides(NamedTuple):
    """What a tap is weighed by: n, (1, 0, 0) without a surface, and z, far away without one."""

    normal: Vector3
    depth: Float


class DepthTolerance(NamedTuple):
    """What divides |dz| in the log2 of a weight.

    Attributes:
        dx, dy: sigma_depth / log2(e) times grad z, a pixel. constant: eps_z z / log2(e).
    """

    dx: Float
    dy: Float
    constant: Float


class Geometry(NamedTuple):
    """What a pixel weighs its taps with."""

    guides: Guides
    tolerance: DepthTolerance


class SvgfLevelWeights(NamedTuple):
    """How a level weighs differences: of luminance; of normals, by log2(e) normal_power / 2."""

    luminance: LuminanceWeight
    normal_exponent: Float


def read_geometry(stencil: Stencil, surface: Surface, sigma_depth: float) -> Geometry:
    """Of each pixel; traced and not yet evaluated."""
    float_t, is_valid = stencil.Float, surface.is_valid
    normal = Vector3(*[dr.select(is_valid, n, m) for n, m in zip(surface.normal, (1, 0, 0))])
    depth = dr.select(is_valid, surface.depth, float_t(_BACKGROUND))
    scale = -stencil.opaque(sigma_depth / LOG2E) * dr.square(surface.depth)
    dx, dy = (dr.select(is_valid, scale * slope, 0) for slope in surface.slope)
    return Geometry(Guides(normal, depth),
                    DepthTolerance(dx, dy, depth * (EPSILON_DEPTH / LOG2E)))


def guides_of(nx: Float, ny: Float, nz: Float, depth: Float) -> Guides:
    """Of planes side by side."""
    return Guides(Vector3(nx, ny, nz), depth)


def geometry_exponent(center: Geometry, tap: Guides, gradient: Float,
                      normal_exponent: Float) -> Float:
    """log2 of the geometry weight; gradient: |grad z . (p - q)|, scaled as a `DepthTolerance`."""
    n, depth = center.guides
    t = dr.fma(-n.x, tap.normal.x, dr.fma(-n.y, tap.normal.y, dr.fma(-n.z, tap.normal.z, 1)))
    e = -t * dr.fma(t, normal_exponent, 2 * normal_exponent)
    return dr.fma(-dr.abs(tap.depth - depth), 1 / (gradient + center.tolerance.constant), e)


def filter_level(signal: Taps[NoisyColor], guides: Taps[Guides], center: NoisyColor,
                 geometry: Geometry, luminance_scale: Float, spacing: Float,
                 normal_exponent: Float) -> NoisyColor:
    """One level.

    Args:
        center, geometry: of the pixel itself. luminance_scale: of `atrous.py`.
        spacing: pixels between taps. normal_exponent: of `SvgfLevelWeights`.
    """
    h0 = SPLINE[0]**2
    color, v = center
    sums, v, total = [c * h0 for c in color], v * h0**2, type(spacing)(h0)
    dx_, dy_ = geometry.tolerance.dx * spacing, geometry.tolerance.dy * spacing
    for i, (dy, dx) in enumerate(window(2)):
        tap, tap_variance = signal.at(i)
        gradient = dr.abs(dr.fma(dx_, float(dx), dy_ * float(dy)))
        e = geometry_exponent(geometry, guides.at(i), gradient, normal_exponent)
        e += math.log2(SPLINE[abs(dy)] * SPLINE[abs(dx)])
        w = exp2(dr.fma(-dr.abs(tap.luminance - color.luminance), luminance_scale, e))
        sums, total = [dr.fma(w, c, s) for c, s in zip(tap, sums)], total + w
        v = dr.fma(w * w, tap_variance, v)
        signal.next()
    norm = 1 / total
    return NoisyColor(LuminanceColor(*[s * norm for s in sums]), v * norm * norm)
