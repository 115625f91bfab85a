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
from dataclasses import dataclass

import drjit as dr

from onespp.denoise.filters.atrous import (
    BACKGROUND,
    LARGEST_LEVELS,
    VARIANCE_RADIUS,
    Guides,
    LevelWeights,
    NoisyColor,
    estimate_variance,
    filter_level,
    guides_of,
    luminance_weight,
    noisy_color,
)
from onespp.denoise.inputs.demodulation import read_texture
from onespp.denoise.inputs.surface import Surface, TangentPlane
from onespp.denoise.jit.arrays import Color, Float, Vector3
from onespp.denoise.jit.color import LuminanceColor, with_green, with_luminance
from onespp.denoise.jit.fastmath import LOG2E
from onespp.denoise.jit.grid import Planes, Stencil, single
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.taps import Taps, window
from onespp.render.frame import Frame

from .base import OnLanes
from .parameters import check_positive, check_whole

_OUTSIDE = -1e15     # 1/z outside the image
_LUMINANCE, _VARIANCE = 1, 3  # which plane of a `NoisyColor`
_INVERSE_DEPTH = 3   # which plane of `Guides`
_BACKGROUND_SCALE = 1e3  # |k| / sigma_plane of background: only background counts


@dataclass(frozen=True)
class Atrous(OnLanes["AtrousState"]):
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
        return AtrousState.make(stencil, self.levels)

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: AtrousState) -> tuple[Color, AtrousState]:
        stencil = state.stencil
        texture = read_texture(frame, stencil, self.demodulate)
        light = with_luminance(texture.demodulate(color))
        guides, plane = self._read_guides(surface, stencil)
        evaluate(light, guides, plane)

        state.guides.store(guides)
        noisy = state.estimate_variance(light, plane)
        filtered = state.filter_levels(noisy, plane, self._weights(stencil))
        return texture.modulate(with_green(filtered.color)), state

    def _read_guides(self, surface: Surface, stencil: Stencil) -> tuple[Guides, TangentPlane]:
        """Of each pixel; background is far away from any surface, and flat."""
        is_valid = surface.is_valid
        normal = Vector3(*[dr.select(is_valid, n, m) for n, m in zip(surface.normal, (1, 0, 0))])
        inverse_depth = dr.select(is_valid, surface.inverse_depth, stencil.Float(BACKGROUND))
        scale = dr.select(is_valid, dr.abs(surface.plane_distance)
                          * stencil.opaque(1 / self.sigma_plane), stencil.Float(_BACKGROUND_SCALE))
        return Guides(normal, inverse_depth), TangentPlane(inverse_depth, *surface.slope, scale)

    def _weights(self, stencil: Stencil) -> LevelWeights:
        return LevelWeights(luminance_weight(stencil, self.sigma_luminance),
                            stencil.opaque(math.sqrt(LOG2E * self.normal_power / 2)))


@dataclass(frozen=True)
class Level:
    """A level's taps, their distance in pixels, and the recorded step. The last tap is the pixel
    itself."""

    signal: Taps[NoisyColor]
    guides: Taps[Guides]
    spacing: Float
    step: Step[..., NoisyColor]

    @staticmethod
    def make(i: int, signal: Planes, guides: Planes) -> Level:
        """Level i."""
        offsets = [(dy << i, dx << i) for dy, dx in (*window(2), (0, 0))]
        return Level(signal.taps(offsets).named(noisy_color), guides.taps(offsets).named(guides_of),
                     signal.stencil.opaque(1 << i), Step(filter_level))


@dataclass(frozen=True)
class AtrousState:
    """The planes and recorded steps, and the passes that they are.

    Attributes:
        signal: planes of a `NoisyColor`. guides: planes of `Guides`.
        blur_taps: variance of the 3x3 pixels around.
        window_luminance, window_inverse_depth: of the window that variance is estimated from; the
            last tap is the pixel itself.
    """

    stencil: Stencil
    signal: Planes
    guides: Planes
    blur_taps: Taps[Float]
    window_luminance: Taps[Float]
    window_inverse_depth: Taps[Float]
    variance_step: Step[..., Float]
    levels: list[Level]

    @staticmethod
    def make(stencil: Stencil, levels: int) -> AtrousState:
        signal, guides = stencil.planes([0.0] * 4), stencil.planes([0.0] * 3 + [_OUTSIDE])
        level_taps = [Level.make(i, signal, guides) for i in range(levels)]
        around = [*window(VARIANCE_RADIUS), (0, 0)]
        return AtrousState(stencil, signal, guides,
                           signal.taps(window(1), [_VARIANCE]).named(single),
                           signal.taps(around, [_LUMINANCE]).named(single),
                           guides.taps(around, [_INVERSE_DEPTH]).named(single),
                           Step(estimate_variance), level_taps)

    def estimate_variance(self, light: LuminanceColor, plane: TangentPlane) -> NoisyColor:
        """The light with the variance of its luminance over a window, both stored."""
        self.signal.store(light, gutters=True)
        variance = self.variance_step(self.window_luminance, self.window_inverse_depth, plane)
        self.signal.store(variance, first=_VARIANCE)
        return NoisyColor(light, variance)

    def filter_levels(self, noisy: NoisyColor, plane: TangentPlane,
                      weights: LevelWeights) -> NoisyColor:
        """All levels, of which the first finds its input stored."""
        for i, level in enumerate(self.levels):
            if i > 0:
                self.signal.store(noisy.color, gutters=True)
                self.signal.store(noisy.variance, first=_VARIANCE)
            noisy = level.step(self.blur_taps, level.signal, level.guides, noisy.variance, plane,
                               level.spacing, weights)
        return noisy
