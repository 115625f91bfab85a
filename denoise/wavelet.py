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

import drjit as dr

from .atrous import LOG2E, SPLINE
from .exponential import exp2
from .stencil import Float, Stencil, Taps, window
from .surface import Surface

EPSILON_DEPTH = 1e-3
_BACKGROUND = 1e20   # depth where there is no surface: far from any, so that its weight is 0
OUTSIDE = [0.0, 0.0, 0.0, 1e26]  # n, z outside the image


def read_guides(stencil: Stencil, surface: Surface, sigma_depth: float) -> list[Float]:
    """n (3), z, and what scales |dz|: sigma_depth / log2(e) times grad z (2), and eps_z z."""
    float_t, exists = stencil.Float, surface.is_valid
    normal = [dr.select(exists, n, m) for n, m in zip(surface.normal, (1, 0, 0))]
    depth = dr.select(exists, surface.depth, float_t(_BACKGROUND))
    scale = -stencil.opaque(sigma_depth / LOG2E) * dr.square(surface.depth)
    slope = [dr.select(exists, scale * g, 0) for g in surface.slope]
    return [*normal, depth, *slope, depth * (EPSILON_DEPTH / LOG2E)]


def geometry_exponent(center: list[Float], tap: list[Float], gradient: Float,
                      half_power: Float) -> Float:
    """log2 of the geometry weight; gradient: |grad z . (p - q)|, scaled as in `read_guides`."""
    nx, ny, nz, depth, _, _, epsilon = center
    t = dr.fma(-nx, tap[0], dr.fma(-ny, tap[1], dr.fma(-nz, tap[2], 1)))
    e = -t * dr.fma(t, half_power, 2 * half_power)
    return dr.fma(-dr.abs(tap[3] - depth), 1 / (gradient + epsilon), e)


def filter_level(signal: Taps, guides: Taps, center: list[Float], center_guides: list[Float],
                 scale: list[Float], numbers: list[Float]) -> list[Float]:
    """One level: filtered (r, l, b, v).

    scale: `atrous.luminance_scale`; numbers: pixels between taps, log2(e) normal_power / 2.
    """
    spacing, half_power = numbers
    (scale_of_l,) = scale
    h0 = SPLINE[0]**2
    *color, v = center
    sums, v, total = [c * h0 for c in color], v * h0**2, type(spacing)(h0)
    gx, gy = (g * spacing for g in center_guides[4:6])
    for i, (dy, dx) in enumerate(window(2)):
        *tap, tap_v = signal.at(i)
        gradient = dr.abs(dr.fma(gx, float(dx), gy * float(dy)))
        e = geometry_exponent(center_guides, guides.at(i), gradient, half_power)
        e += math.log2(SPLINE[abs(dy)] * SPLINE[abs(dx)])
        w = exp2(dr.fma(-dr.abs(tap[1] - color[1]), scale_of_l, e))
        sums, total = [dr.fma(w, c, s) for c, s in zip(tap, sums)], total + w
        v = dr.fma(w * w, tap_v, v)
        signal.next()
    norm = 1 / total
    return [*(s * norm for s in sums), v * norm * norm]
