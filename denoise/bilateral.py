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
from dataclasses import dataclass
from typing import Any

import drjit as dr

from render.frame import Frame

from .arrays import Color, Float
from .demodulation import read_texture
from .exponential import exp2
from .lanes import OnLanes
from .parameters import check_positive, check_whole
from .stencil import Planes, Stencil, Step, Taps
from .structure import evaluate
from .surface import Surface

LOG2E = 1.4426950408889634
# acos^2(1 - t) / t on [0, 1], relative error below 0.0026 (t + 0.02); beyond, it only grows.
ACOS2 = (2.00009996, 0.32205101, 0.13894848)
_FAR = 1e19       # colour outside the image: far from any other, so that its weight is 0
OUTSIDE = [_FAR] * 3 + [0.0] * 7  # what the planes hold there: colour 3, normal 3, kind, position 3
_KIND = 4.0       # fourth component of a normal: + surface, - none; its product tells them apart
_TINY = 1e-30     # |Pj - Pi|^2 of a pixel and itself


@dataclass(frozen=True)
class Bilateral(OnLanes):
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
        planes = stencil.planes(OUTSIDE)
        window = range(-self.radius, self.radius + 1)
        rows = [planes.taps([(dy, dx) for dx in window]) for dy in window]
        squares = [stencil.opaque(dy * dy) for dy in window]
        return BilateralState(stencil, planes, rows, squares, Step(add_row_of_taps))

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: BilateralState) -> tuple[Color, BilateralState]:
        stencil = state.stencil
        texture = read_texture(frame, stencil, self.demodulate)
        center, weights = self.prepare(texture.demodulate(color), surface, state.planes)
        sums = [stencil.constant(0) for _ in range(4)]
        for taps, square in zip(state.rows, state.squares, strict=True):
            sums = state.step(taps, center, sums, [*weights, square])
        return texture.modulate(self.mean(sums, stencil)), state

    def prepare(self, light: Color, surface: Surface,
                planes: Planes) -> tuple[list[Float], list[Float]]:
        """Fill the planes; `center` and `weights` of `add_row_of_taps`, these without dy^2."""
        stencil = planes.stencil
        k = stencil.opaque(self.color_scale)
        kind = dr.select(surface.is_valid, stencil.Float(_KIND), -_KIND)
        pixels = [*(c * k for c in light), *surface.normal, kind, *surface.position]
        own_kind = dr.select(surface.is_valid, stencil.Float(_KIND),
                             -_KIND * self.isolate_background)
        self_product = dr.fma(own_kind, own_kind, dr.select(surface.is_valid, stencil.Float(1), 0))
        evaluate(pixels, own_kind, self_product)
        planes.store(pixels)
        half_log2e = LOG2E / 2
        weights = ([stencil.opaque(-half_log2e / self.sigma_coord**2)]
                   + [stencil.opaque(-half_log2e / self.sigma_normal**2 * a) for a in ACOS2]
                   + [stencil.opaque(-half_log2e / self.sigma_plane**2)])
        return [*pixels[:6], own_kind, *pixels[7:], self_product], weights

    @property
    def color_scale(self) -> float:
        """Of colours in the planes, so that the square of a difference is its exponent of 2."""
        return math.sqrt(LOG2E / 2) / self.sigma_color

    def mean(self, sums: list[Float], stencil: Stencil) -> Color:
        """Colour from the sums of w times scaled colour, and of w."""
        norm = 1 / (sums[3] * stencil.opaque(self.color_scale))
        return Color(*[s * norm for s in sums[:3]])


@dataclass(frozen=True)
class BilateralState:
    """Planes (colour 3, normal 3, kind, position 3) and their taps, a row of the window each."""

    stencil: Stencil
    planes: Planes
    rows: list[Taps]
    squares: list[Float]
    step: Step[..., Any]


def add_row_of_taps(taps: Taps, center: list[Float], sums: list[Float],
                    weights: list[Float]) -> list[Float]:
    """Add one row of the window to the sums of w C (3) and w.

    Args:
        taps: colour scaled by sqrt(log2(e) / 2) / sigma_color, (n, kind), position.
        center: the same ten of the pixel itself, then (n, kind) . (n, kind).
        weights: log2 weight of a pixel^2, the three of acos^2, of the plane term; then dy^2.
    """
    cr, cg, cb, nx, ny, nz, kind, px, py, pz, self_product = center
    coord, a0, a1, a2, plane, dy2 = weights
    r, g, b, w_sum = sums
    radius = len(taps) // 2
    row = coord * dy2
    for i in range(len(taps)):
        tr, tg, tb, tnx, tny, tnz, tkind, tpx, tpy, tpz = taps.at(i)
        dr_, dg, db = tr - cr, tg - cg, tb - cb
        e = dr.fma(dr_, -dr_, dr.fma(coord, float((i - radius) ** 2), row))
        e = dr.fma(dg, -dg, e)
        e = dr.fma(db, -db, e)
        t = dr.fma(-nx, tnx, dr.fma(-ny, tny, dr.fma(-nz, tnz, dr.fma(-kind, tkind, self_product))))
        e = dr.fma(t, dr.fma(t, dr.fma(t, a2, a1), a0), e)
        dx, dy, dz = tpx - px, tpy - py, tpz - pz
        distance2 = dr.fma(dx, dx, dr.fma(dy, dy, dr.fma(dz, dz, _TINY)))
        across = dr.fma(nx, dx, dr.fma(ny, dy, nz * dz))
        e = dr.fma(across * across / distance2, plane, e)
        w = exp2(e)
        r, g, b, w_sum = dr.fma(w, tr, r), dr.fma(w, tg, g), dr.fma(w, tb, b), w_sum + w
        taps.next()
    return [r, g, b, w_sum]
