"""Kernels of the edge-avoiding a-trous filter; symbols and sources as in `methods/atrous.py`."""

from __future__ import annotations

import math
from typing import NamedTuple

import drjit as dr

from onespp.denoise.inputs.surface import TangentPlane
from onespp.denoise.jit.arrays import Float, Vector3
from onespp.denoise.jit.color import LuminanceColor
from onespp.denoise.jit.fastmath import LOG2E, exp2
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.taps import Taps, window

SPLINE = {0: 3 / 8, 1: 1 / 4, 2: 1 / 16}
BINOMIAL = {0: 1 / 2, 1: 1 / 4}
VARIANCE_RADIUS = 3
LARGEST_LEVELS = 8
EPSILON = 1e-6       # radiance; below it differences of luminance do not count
BACKGROUND = -1e8    # 1/z where there is no surface: far from any plane, so that its weight is 0


class NoisyColor(NamedTuple):
    """A colour and the variance of its luminance."""

    color: LuminanceColor
    variance: Float


class Guides(NamedTuple):
    """What a tap is weighed by: n, (1, 0, 0) without a surface, and 1/z, far away without one."""

    normal: Vector3
    inverse_depth: Float


class LuminanceWeight(NamedTuple):
    """How differences of luminance are weighed: eps, radiance; sigma_luminance / log2(e)."""

    epsilon: Float
    sigma: Float


class LevelWeights(NamedTuple):
    """How a level weighs differences: of luminance; of normals, by sqrt(log2(e) normal_power / 2).
    """

    luminance: LuminanceWeight
    normal_exponent_root: Float


def luminance_weight(stencil: Stencil, sigma_luminance: float) -> LuminanceWeight:
    return LuminanceWeight(stencil.opaque(EPSILON), stencil.opaque(sigma_luminance / LOG2E))


def noisy_color(red: Float, luminance: Float, blue: Float, variance: Float) -> NoisyColor:
    """Of planes side by side."""
    return NoisyColor(LuminanceColor(red, luminance, blue), variance)


def guides_of(nx: Float, ny: Float, nz: Float, inverse_depth: Float) -> Guides:
    return Guides(Vector3(nx, ny, nz), inverse_depth)


def estimate_variance(luminances: Taps[Float], inverse_depths: Taps[Float],
                      plane: TangentPlane) -> Float:
    """Variance of the luminance over the taps within sigma_plane of the pixel's plane.

    Sums run over differences from the pixel itself, which keeps digits on bright pixels.
    """
    lum, inverse_depth, limit = luminances.at(-1), inverse_depths.at(-1), 1 / plane.scale
    float_t = type(lum)
    count, sum1, sum2, row = float_t(1), float_t(0), float_t(0), inverse_depth
    for i, (dy, dx) in enumerate(window(VARIANCE_RADIUS)):
        if dx == -VARIANCE_RADIUS:
            row = dr.fma(plane.dy, float(dy), inverse_depth)
        distance = dr.abs(inverse_depths.at(i) - dr.fma(plane.dx, float(dx), row))
        on_plane = dr.select(distance < limit, float_t(1), 0)
        d = luminances.at(i) - lum
        counted = d * on_plane
        count, sum1, sum2 = count + on_plane, sum1 + counted, dr.fma(d, counted, sum2)
        luminances.next()
    mean = sum1 / count
    variance = dr.fma(-mean, mean, sum2 / count)
    return dr.select(variance > 0, variance, 0)


def luminance_scale(variances: Taps[Float], variance: Float, weight: LuminanceWeight) -> Float:
    """log2(e) / (sigma_luminance sqrt(g3x3(v)) + eps).

    Args:
        variances: of the 3x3 pixels around. variance: of the pixel itself.
    """
    blurred = variance * BINOMIAL[0]**2
    for i, (dy, dx) in enumerate(window(1)):
        blurred = dr.fma(variances.at(i), BINOMIAL[abs(dy)] * BINOMIAL[abs(dx)], blurred)
    return 1 / dr.fma(weight.sigma, dr.sqrt(blurred), weight.epsilon)


def filter_level(variances: Taps[Float], signal: Taps[NoisyColor], guides: Taps[Guides],
                 variance: Float, plane: TangentPlane, spacing: Float,
                 weights: LevelWeights) -> NoisyColor:
    """One level, in two kernels: one alone would not find room in the registers."""
    scale = luminance_scale(variances, variance, weights.luminance)
    evaluate(scale)
    return mean_of_taps(signal, guides, plane, scale, spacing, weights.normal_exponent_root)


def mean_of_taps(signal: Taps[NoisyColor], guides: Taps[Guides], plane: TangentPlane,
                 luminance_scale: Float, spacing: Float, normal_exponent_root: Float) -> NoisyColor:
    """Mean of the taps by weight. With q = normal_exponent_root = sqrt(log2(e) normal_power / 2)
    and u = q t the exponent of the normals is u (u + 2 q).

    The pixel's own values are read from the planes too, where its neighbours have brought them
    into the cache. What waits in a register counts: a vector on the stack, across two cache lines
    as it may lie, costs a level up to half its time.
    """
    (red, lum, blue), variance = signal.at(-1)
    normal, inverse_depth = guides.at(-1)
    q = normal_exponent_root
    nx, ny, nz = (-q * n for n in normal)
    dx_, dy_, scale = plane.dx * spacing, plane.dy * spacing, plane.scale * LOG2E
    two_q, h0 = 2 * q, SPLINE[0]**2
    total = type(lum)(h0)
    r, y, b, v = red * h0, lum * h0, blue * h0, variance * h0**2
    row = inverse_depth
    for i, (dy, dx) in enumerate(window(2)):
        tap, tap_variance = signal.at(i)
        tap_normal, tap_inverse_depth = guides.at(i)
        if dx == -2:
            row = dr.fma(dy_, float(dy), inverse_depth)
        u = dr.fma(nx, tap_normal.x, dr.fma(ny, tap_normal.y, dr.fma(nz, tap_normal.z, q)))
        e = dr.fma(-u, u + two_q, math.log2(SPLINE[abs(dy)] * SPLINE[abs(dx)]))
        e = dr.fma(dr.abs(tap_inverse_depth - dr.fma(dx_, float(dx), row)), -scale, e)
        w = exp2(dr.fma(dr.abs(tap.luminance - lum), -luminance_scale, e))
        r, y, b = dr.fma(w, tap.red, r), dr.fma(w, tap.luminance, y), dr.fma(w, tap.blue, b)
        total = total + w
        v = dr.fma(w * w, tap_variance, v)
        signal.next()
    norm = 1 / total
    return NoisyColor(LuminanceColor(r * norm, y * norm, b * norm), v * norm * norm)
