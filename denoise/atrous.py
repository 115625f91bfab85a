"""Edge-avoiding a-trous wavelet filter with SVGF's variance-guided weights.

Symbols: p the pixel, q a tap; i the level; h the 5x5 B3 spline {1/16, 1/4, 3/8, 1/4, 1/16}^2;
l luminance, v its variance; n normal, z depth; k = n . X distance of the camera from p's plane.

Level i filters what level i - 1 gave, with taps 2^i pixels apart:

    C'(p) = sum h w C(q) / sum h w,    v'(p) = sum (h w)^2 v(q) / (sum h w)^2,
    w = exp(-|l(p) - l(q)| / (sigma_luminance sqrt(g3x3(v)(p)) + eps))
        (n(p) . n(q))^normal_power exp(-distance(q, p's plane) / (sigma_plane z(p)))

with g3x3 the binomial {1, 2, 1}^2 / 16. The first variance is that of l over a 7x7 window's pixels
on p's plane, since one frame has no history. Colour is filtered without texture (demodulation.py)
where the frame has albedo.

Sources: Dammertz et al. 2010, "Edge-avoiding a-trous wavelet transform for fast global
illumination filtering", doi:10.2312/EGGH/HPG10/067-075; Schied et al. 2017 (SVGF),
doi:10.1145/3105762.3105770: sigma_luminance 4, normal_power 128.

Departures from SVGF:
- Its depth term uses the depth's screen-space gradient by finite differences. Over a plane 1/z is
  linear on the screen, with a slope that follows from n; so the distance from the tangent plane
  is |k| |1/z(q) - the plane's 1/z there| z(q), with z(p) for z(q). No differences, no positions.
- x^128 = exp(-128 (t + t^2 / 2)), t = 1 - x: within 1e-3 of the largest weight.
- Two pixels without a surface have full geometry weights; one with, one without: 0.
- Only pixels inside the image count.

Form: kernels filter (r, l, b) instead of (r, g, b), so that no tap computes its luminance; g comes
out of the three at the end, with an error of 1e-7 times the brightest of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr

from render.frame import Frame

from .arrays import Color, Float
from .demodulation import read_texture
from .exponential import exp2
from .lanes import OnLanes
from .parameters import check_positive, check_whole
from .stencil import Stencil, Step, Taps, window
from .structure import evaluate
from .surface import LUMINANCE, Surface, luminance

LOG2E = 1.4426950408889634
SPLINE = {0: 3 / 8, 1: 1 / 4, 2: 1 / 16}
BINOMIAL = {0: 1 / 2, 1: 1 / 4}
VARIANCE_RADIUS = 3
LARGEST_LEVELS = 8
EPSILON = 1e-6       # radiance; below it differences of luminance do not count
BACKGROUND = -1e8    # 1/z where there is no surface: far from any plane, so that its weight is 0
_OUTSIDE = -1e15     # 1/z outside the image
_BACKGROUND_SCALE = 1e3  # |k| / sigma_plane of background, whose like alone count


@dataclass(frozen=True)
class Atrous(OnLanes):
    """A-trous filter of each frame on its own.

    Attributes:
        levels: wavelet levels; taps of the last are 2^(levels - 1) pixels apart [1, 1 to 8].
        sigma_luminance: falloff with difference of luminance [standard deviations, above 0].
        sigma_plane: falloff with distance from the tangent plane [share of depth, above 0].
        normal_power: exponent of the cosine between normals [1, above 0].
        demodulate: filter colour over albedo, where frames have albedo.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Atrous(levels=3)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    levels: int = 5
    sigma_luminance: float = 4.0
    sigma_plane: float = 0.01
    normal_power: float = 128.0
    demodulate: bool = True

    def __post_init__(self) -> None:
        check_whole(self, "levels", LARGEST_LEVELS)
        check_positive(self, "sigma_luminance", "sigma_plane", "normal_power")

    @property
    def reach(self) -> int:
        return max(2 << (self.levels - 1), VARIANCE_RADIUS)

    def init_on(self, stencil: Stencil) -> AtrousState:
        signal, guides = stencil.planes([0.0] * 4), stencil.planes([0.0] * 3 + [_OUTSIDE])
        level_taps = []
        for i in range(self.levels):
            offsets = [(dy << i, dx << i) for dy, dx in (*window(2), (0, 0))]
            level_taps.append((signal.taps(offsets), guides.taps(offsets)))
        near = [*window(VARIANCE_RADIUS), (0, 0)]
        return AtrousState(stencil, signal, guides, level_taps, signal.taps(window(1), [3]),
                           (signal.taps(near, [1]), guides.taps(near, [3])),
                           [stencil.opaque(1 << i) for i in range(self.levels)],
                           Step(estimate_variance), [Step(level) for _ in range(self.levels)])

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: AtrousState) -> tuple[Color, AtrousState]:
        stencil = state.stencil
        texture = read_texture(frame, stencil, self.demodulate)
        light = texture.demodulate(color)
        float_t = stencil.Float
        normal = [dr.select(surface.is_valid, n, m) for n, m in zip(surface.normal, (1, 0, 0))]
        inverse_depth = dr.select(surface.is_valid, surface.inverse_depth, float_t(BACKGROUND))
        scale = dr.select(surface.is_valid, dr.abs(surface.plane_distance)
                          * stencil.opaque(1 / self.sigma_plane), float_t(_BACKGROUND_SCALE))
        guides, plane = [*normal, inverse_depth], [*surface.slope, scale]
        light = [light.red, luminance(light), light.blue]
        evaluate(light, guides, plane)
        state.guides.store(guides)
        state.signal.store(light, gutters=True)
        signal = [*light, state.variance_step(*state.variance_taps, plane)]
        state.signal.store(signal[3:], first=3)
        numbers = [stencil.opaque(EPSILON), stencil.opaque(self.sigma_luminance / LOG2E),
                   stencil.opaque(math.sqrt(LOG2E * self.normal_power / 2))]
        for i in range(self.levels):
            if i > 0:
                state.signal.store(signal[:3], gutters=True)
                state.signal.store(signal[3:], first=3)
            signal = state.level_steps[i](state.blur_taps, *state.level_taps[i], signal[3:], plane,
                                          [state.spacings[i], *numbers])
        return texture.modulate(with_green(signal)), state


@dataclass(frozen=True)
class AtrousState:
    """Planes of the signal (r, l, b, variance) and of the guides (n, 1/z), and their taps: the
    pixel itself is the last of a level's, and of those that variance is estimated from."""

    stencil: Stencil
    signal: Any
    guides: Any
    level_taps: list[tuple[Taps, Taps]]
    blur_taps: Taps
    variance_taps: tuple[Taps, Taps]
    spacings: list[Float]
    variance_step: Step[..., Any]
    level_steps: list[Step[..., Any]]


def estimate_variance(signal: Taps, guides: Taps, plane: list[Float]) -> Float:
    """Variance of the luminance over the taps within sigma_plane of the pixel's plane.

    Sums run over differences from the pixel itself, which keeps digits on bright pixels.
    """
    gx, gy, scale = plane
    (lum,), (inverse_depth,), limit = signal.at(-1), guides.at(-1), 1 / scale
    float_t = type(lum)
    count, sum1, sum2, row = float_t(1), float_t(0), float_t(0), inverse_depth
    for i, (dy, dx) in enumerate(window(VARIANCE_RADIUS)):
        if dx == -VARIANCE_RADIUS:
            row = dr.fma(gy, float(dy), inverse_depth)
        distance = dr.abs(guides.at(i)[0] - dr.fma(gx, float(dx), row))
        on_plane = dr.select(distance < limit, float_t(1), 0)
        d = signal.at(i)[0] - lum
        counted = d * on_plane
        count, sum1, sum2 = count + on_plane, sum1 + counted, dr.fma(d, counted, sum2)
        signal.next()
    mean = sum1 / count
    variance = dr.fma(-mean, mean, sum2 / count)
    return dr.select(variance > 0, variance, 0)


def luminance_scale(taps: Taps, variance: list[Float], numbers: list[Float]) -> Float:
    """log2(e) / (sigma_luminance sqrt(g3x3(v)) + eps)."""
    epsilon, sigma, *_ = numbers
    blurred = variance[0] * BINOMIAL[0]**2
    for i, (dy, dx) in enumerate(window(1)):
        blurred = dr.fma(taps.at(i)[0], BINOMIAL[abs(dy)] * BINOMIAL[abs(dx)], blurred)
    return 1 / dr.fma(sigma, dr.sqrt(blurred), epsilon)


def level(blur: Taps, signal: Taps, guides: Taps, variance: list[Float], plane: list[Float],
          numbers: list[Float]) -> list[Float]:
    """One level: filtered r, l, b and variance.

    In two kernels: one alone would not find room in the registers.
    """
    spacing, epsilon, sigma, q = numbers
    scale_of_l = luminance_scale(blur, variance, [epsilon, sigma])
    evaluate(scale_of_l)
    return filter_level(signal, guides, plane, scale_of_l, spacing, q)


def filter_level(signal: Taps, guides: Taps, plane: list[Float], scale_of_l: Float, spacing: Float,
                 q: Float) -> list[Float]:
    """Mean of the taps by weight. q: sqrt(log2(e) normal_power / 2), so that with u = q t the
    exponent of the normals is u (u + 2 q).

    The pixel's own values are read from the planes too, where its neighbours have brought them
    into the cache. What waits in a register counts: a vector on the stack, across two cache lines
    as it may lie, costs a level up to half its time.
    """
    red, lum, blue, variance = signal.at(-1)
    *normal, inverse_depth = guides.at(-1)
    nx, ny, nz = (-q * n for n in normal)
    gx, gy, scale = plane[0] * spacing, plane[1] * spacing, plane[2] * LOG2E
    two_q, h0 = 2 * q, SPLINE[0]**2
    total = type(lum)(h0)
    r, y, b, v = red * h0, lum * h0, blue * h0, variance * h0**2
    row = inverse_depth
    for i, (dy, dx) in enumerate(window(2)):
        tr, ty, tb, tv = signal.at(i)
        tnx, tny, tnz, tap_inverse_depth = guides.at(i)
        if dx == -2:
            row = dr.fma(gy, float(dy), inverse_depth)
        u = dr.fma(nx, tnx, dr.fma(ny, tny, dr.fma(nz, tnz, q)))
        e = dr.fma(-u, u + two_q, math.log2(SPLINE[abs(dy)] * SPLINE[abs(dx)]))
        e = dr.fma(dr.abs(tap_inverse_depth - dr.fma(gx, float(dx), row)), -scale, e)
        w = exp2(dr.fma(dr.abs(ty - lum), -scale_of_l, e))
        r, y, b, total = dr.fma(w, tr, r), dr.fma(w, ty, y), dr.fma(w, tb, b), total + w
        v = dr.fma(w * w, tv, v)
        signal.next()
    norm = 1 / total
    return [r * norm, y * norm, b * norm, v * norm * norm]


def with_green(signal: Sequence[Float]) -> Color:
    """(r, g, b) of (r, luminance, b, ...)."""
    r, y, b, *_ = signal
    red, green, blue = LUMINANCE
    return Color(r, dr.fma(r, -red / green, dr.fma(b, -blue / green, y * (1 / green))), b)
