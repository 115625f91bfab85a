"""Joint bilateral filter of the GAMES202 assignment.

    J(i, j) = exp(-|i - j|^2 / 2 sp^2 - |Ci - Cj|^2 / 2 sc^2 - acos^2(ni . nj) / 2 sn^2
                  - (ni . (Pj - Pi) / |Pj - Pi|)^2 / 2 sd^2)

i, j pixels on the screen; C colour, n normal, P position; sp = sigma_coord (pixels), sc =
sigma_color, sn = sigma_normal (radians), sd = sigma_plane. The result is the mean of Cj over a
square window, weighted by J; the weight of i itself is 1, so the sum of weights is never 0.

Sources: Petschnigg et al. 2004, "Digital photography with flash and no-flash image pairs",
doi:10.1145/1015706.1015777 (the joint bilateral filter); GAMES202, assignment 5 (J, defaults).

Departures, where the assignment leaves the formula open: only pixels inside the image count. The
plane term of a pixel with itself is 0. Two pixels without a surface (background, missing normal)
have normal and plane terms of 0; one with and one without a surface have weight 0, so that neither
bleeds into the other.

Form: one kernel for a row of taps, launched once for each row of the window. All terms are summed
into one exponent of 2. acos^2(1 - t) is t times a quadratic, exact to 2e-4 for small angles and to
3e-3 at 90 degrees, so that weights are within 1e-3, and results far closer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr

from onespp.denoise.inputs.demodulation import read_texture
from onespp.denoise.inputs.surface import Surface
from onespp.denoise.jit.arrays import Color, Float, Vector3
from onespp.denoise.jit.fastmath import LOG2E, exp2
from onespp.denoise.jit.grid import Planes, Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.taps import Offset, Taps
from onespp.render.frame import Frame

from .base import OnLanes
from .parameters import check_positive, check_whole

# acos^2(1 - t) / t on [0, 1], relative error below 0.0026 (t + 0.02); beyond, it only grows.
ACOS2 = (2.00009996, 0.32205101, 0.13894848)
_FAR = 1e19       # colour outside the image: far from any other, so that its weight is 0
OUTSIDE = [_FAR] * 3 + [0.0] * 7  # what the planes hold there: colour 3, normal 3, kind, position 3
_KIND = 4.0       # fourth component of a normal: + surface, - none; its product tells them apart
_TINY = 1e-30     # |Pj - Pi|^2 of a pixel and itself


class BilateralSample(NamedTuple):
    """What a pixel is weighed by: colour scaled so that the square of a difference is its exponent
    of 2; (n, kind); position."""

    color: Color
    normal: Vector3
    kind: Float
    position: Vector3


class Center(NamedTuple):
    """The pixel itself, and (n, kind) . (n, kind)."""

    sample: BilateralSample
    self_product: Float


class AngleTerm(NamedTuple):
    """Factors of t, t^2 and t^3 in the log2 of the normals' weight."""

    linear: Float
    quadratic: Float
    cubic: Float


class BilateralWeights(NamedTuple):
    """log2 of the weight of a pixel^2, of 1 - the cosine between normals, and of the square of the
    sine of the angle with the plane."""

    coord: Float
    angle: AngleTerm
    plane: Float


class WeightedColor(NamedTuple):
    """Sums of w C and of w."""

    color: Color
    weight: Float

    def with_tap(self, w: Float, color: Color) -> WeightedColor:
        return WeightedColor(Color(*[dr.fma(w, c, s) for c, s in zip(color, self.color)]),
                             self.weight + w)

    def mean(self) -> Color:
        return Color(*[s / self.weight for s in self.color])


@dataclass(frozen=True)
class Bilateral(OnLanes["BilateralState"]):
    """Joint bilateral filter of each frame on its own.

    Attributes:
        radius: half width of the square window [pixels, 1 to 64]; each value compiles a kernel.
        sigma_coord: falloff with distance on the screen [pixels, above 0].
        sigma_color: falloff with difference of colour, linear Rec. 709 [radiance, above 0].
        sigma_normal: falloff with the angle between normals [radians, above 0].
        sigma_plane: falloff with the sine of the angle out of the tangent plane [1, above 0].
        demodulate: filter colour over albedo, where frames have albedo.
        isolate_background: a pixel without a surface averages only such pixels. Otherwise it
            averages all (its normal and plane terms are 0), as the assignment's solutions do.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Bilateral(radius=4, sigma_color=1.0)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    radius: int = 16
    sigma_coord: float = 32.0
    sigma_color: float = 0.6
    sigma_normal: float = 0.1
    sigma_plane: float = 0.1
    demodulate: bool = False
    isolate_background: bool = True

    def __post_init__(self) -> None:
        check_whole(self, "radius", 64)
        check_positive(self, "sigma_coord", "sigma_color", "sigma_normal", "sigma_plane")

    @property
    def reach(self) -> int:
        return self.radius

    def init_on(self, stencil: Stencil) -> BilateralState:
        planes, step = stencil.planes(OUTSIDE), Step(add_taps)
        window = range(-self.radius, self.radius + 1)
        return BilateralState(stencil, planes, [
            TapLine.make(planes, [(dy, dx) for dx in window], dy, step) for dy in window])

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: BilateralState) -> tuple[Color, BilateralState]:
        stencil = state.stencil
        texture = read_texture(frame, stencil, self.demodulate)
        center = self.prepare(texture.demodulate(color), surface, state.planes)
        weights, sums = self.weights(stencil), no_taps(stencil)
        for row in state.lines:
            sums = row.add(center, sums, weights)
        norm = 1 / (sums.weight * stencil.opaque(self.color_scale))
        return texture.modulate(Color(*[s * norm for s in sums.color])), state

    def prepare(self, light: Color, surface: Surface, planes: Planes) -> Center:
        """Fill the planes with each pixel's sample, which its neighbours see; what it is itself."""
        stencil = planes.stencil
        k = stencil.opaque(self.color_scale)
        kind = dr.select(surface.is_valid, stencil.Float(_KIND), -_KIND)
        sample = BilateralSample(Color(*[c * k for c in light]), surface.normal, kind,
                                 surface.position)
        own_kind = dr.select(surface.is_valid, stencil.Float(_KIND),
                             -_KIND * self.isolate_background)
        self_product = dr.fma(own_kind, own_kind, dr.select(surface.is_valid, stencil.Float(1), 0))
        evaluate(sample, own_kind, self_product)
        planes.store(sample)
        return Center(sample._replace(kind=own_kind), self_product)

    def weights(self, stencil: Stencil) -> BilateralWeights:
        half_log2e = LOG2E / 2
        return BilateralWeights(
            stencil.opaque(-half_log2e / self.sigma_coord**2),
            AngleTerm(*[stencil.opaque(-half_log2e / self.sigma_normal**2 * a) for a in ACOS2]),
            stencil.opaque(-half_log2e / self.sigma_plane**2))

    @property
    def color_scale(self) -> float:
        return color_scale(self.sigma_color)


def color_scale(sigma_color: float) -> float:
    """Of colours in the planes, so that the square of a difference is its exponent of 2."""
    return math.sqrt(LOG2E / 2) / sigma_color


@dataclass(frozen=True)
class TapLine:
    """A row or a column of taps, the square of its distance from the pixel, and the recorded
    step."""

    taps: Taps[Any]
    squared_distance: Float
    step: Step[..., WeightedColor]

    @staticmethod
    def make(planes: Planes, offsets: list[Offset], distance: int,
             step: Step[..., WeightedColor], named: Callable[..., Any] | None = None) -> TapLine:
        """Taps of a `BilateralSample`, or of what `named` makes of the planes."""
        return TapLine(planes.taps(offsets).named(named or _sample),
                       planes.stencil.opaque(distance**2), step)

    def add(self, center: Any, sums: WeightedColor, weights: Any) -> WeightedColor:
        """The sums with these taps added."""
        return self.step(self.taps, self.squared_distance, center, sums, weights)


@dataclass(frozen=True)
class BilateralState:
    """Planes of what a pixel is weighed by, and the lines of taps in the order of their passes."""

    stencil: Stencil
    planes: Planes
    lines: list[TapLine]


def no_taps(stencil: Stencil) -> WeightedColor:
    """Sums to begin with."""
    return WeightedColor(Color(*[stencil.constant(0) for _ in range(3)]), stencil.constant(0))


def add_taps(taps: Taps[BilateralSample], squared_distance: Float, center: Center,
             sums: WeightedColor, weights: BilateralWeights) -> WeightedColor:
    """Add a line of taps to the sums.

    Args:
        taps: along the line, the one nearest to the pixel in the middle.
        squared_distance: of that one from the pixel.
    """
    (own_color, own_normal, own_kind, own_position), self_product = center
    coord, angle, plane = weights
    (cr, cg, cb), (nx, ny, nz), (px, py, pz) = own_color, own_normal, own_position
    radius = len(taps) // 2
    line = coord * squared_distance
    for i in range(len(taps)):
        color, normal, kind, position = taps.at(i)
        dr_, dg, db = color.red - cr, color.green - cg, color.blue - cb
        e = dr.fma(dr_, -dr_, dr.fma(coord, float((i - radius) ** 2), line))
        e = dr.fma(dg, -dg, e)
        e = dr.fma(db, -db, e)
        t = dr.fma(-nx, normal.x, dr.fma(-ny, normal.y, dr.fma(
            -nz, normal.z, dr.fma(-own_kind, kind, self_product))))
        e = dr.fma(t, dr.fma(t, dr.fma(t, angle.cubic, angle.quadratic), angle.linear), e)
        dx, dy, dz = position.x - px, position.y - py, position.z - pz
        distance2 = dr.fma(dx, dx, dr.fma(dy, dy, dr.fma(dz, dz, _TINY)))
        across = dr.fma(nx, dx, dr.fma(ny, dy, nz * dz))
        e = dr.fma(across * across / distance2, plane, e)
        sums = sums.with_tap(exp2(e), color)
        taps.next()
    return sums


def _sample(red: Float, green: Float, blue: Float, nx: Float, ny: Float, nz: Float, kind: Float,
            px: Float, py: Float, pz: Float) -> BilateralSample:
    return BilateralSample(Color(red, green, blue), Vector3(nx, ny, nz), kind, Vector3(px, py, pz))
