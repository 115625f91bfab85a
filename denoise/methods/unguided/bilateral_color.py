"""The bilateral filter of Tomasi and Manduchi: a Gaussian that stops where the colour changes.

    B(i, j) = exp(-|i - j|^2 / 2 sp^2 - |Ci - Cj|^2 / 2 sc^2)

i, j pixels on the screen, C colour; sp = sigma_coord (pixels), sc = sigma_color. The result is the
mean of Cj over a square window, weighted by B; the weight of i itself is 1.

Sources: Tomasi and Manduchi 1998, "Bilateral filtering for gray and color images",
doi:10.1109/ICCV.1998.710815; GAMES202, lecture on real-time ray tracing and denoising. It is the
joint bilateral filter of `bilateral.py` without its guides, and has that one's defaults, so that
what the guides are worth is the difference of the two.

Departures: distances of colours are in linear Rec. 709, as for `bilateral`; the paper's are in
CIELAB, which ends at white, and radiance does not. Only pixels inside the image count.

Form: as `gaussian.py`; both terms are summed into one exponent of 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr

from onespp.denoise.inputs.surface import Surface
from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.fastmath import LOG2E, exp2
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.taps import Taps
from onespp.render.frame import Frame

from ..base import OnLanes
from ..bilateral import OUTSIDE, BilateralState, TapLine, WeightedColor, color_scale, no_taps
from ..parameters import check_positive, check_whole


@dataclass(frozen=True)
class BilateralColor(OnLanes[BilateralState]):
    """Bilateral filter of each frame on its own, by distance and colour alone.

    Attributes:
        radius: half width of the square window [pixels, 1 to 64]; each value compiles a kernel.
        sigma_coord: falloff with distance on the screen [pixels, above 0].
        sigma_color: falloff with difference of colour, linear Rec. 709 [radiance, above 0].

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = BilateralColor(radius=4, sigma_color=1.0)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    radius: int = 16
    sigma_coord: float = 32.0
    sigma_color: float = 0.6

    def __post_init__(self) -> None:
        check_whole(self, "radius", 64)
        check_positive(self, "sigma_coord", "sigma_color")

    @property
    def reach(self) -> int:
        return self.radius

    def init_on(self, stencil: Stencil) -> BilateralState:
        planes, step = stencil.planes(OUTSIDE[:3]), Step(add_row)
        window = range(-self.radius, self.radius + 1)
        return BilateralState(stencil, planes, [
            TapLine.make(planes, [(dy, dx) for dx in window], dy, step, Color) for dy in window])

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: BilateralState) -> tuple[Color, BilateralState]:
        stencil, scale = state.stencil, color_scale(self.sigma_color)
        k = stencil.opaque(scale)
        center = Color(*[c * k for c in color])
        evaluate(center)
        state.planes.store(center)
        coord, sums = stencil.opaque(-LOG2E / 2 / self.sigma_coord**2), no_taps(stencil)
        for row in state.lines:
            sums = row.add(center, sums, coord)
        k = stencil.opaque(1 / scale)
        return Color(*[c * k for c in sums.mean()]), state


def add_row(taps: Taps[Color], squared_distance: Float, center: Color, sums: WeightedColor,
            coord: Float) -> WeightedColor:
    """Add a row of taps to the sums.

    Args:
        taps: along the row, the one nearest to the pixel in the middle.
        squared_distance: of that one from the pixel.
        coord: log2 of the weight of a pixel^2.
    """
    radius = len(taps) // 2
    row = coord * squared_distance
    for i in range(len(taps)):
        color = taps.at(i)
        e = dr.fma(coord, float((i - radius)**2), row)
        for tap, own in zip(color, center):
            e = dr.fma(tap - own, own - tap, e)
        sums = sums.with_tap(exp2(e), color)
        taps.next()
    return sums
