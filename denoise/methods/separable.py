"""The joint bilateral filter as two passes, along rows and then along columns.

J is the weight of `bilateral.py`. The first pass is the mean over a row of the window, the second
the mean over a column of what the first gave:

    C1(i) = sum_x J(C; i, i + x) C(i + x) / sum_x J(C; i, i + x)
    C2(i) = sum_y J(C1; i, i + y) C1(i + y) / sum_y J(C1; i, i + y)

2 (2 radius + 1) taps instead of (2 radius + 1)^2: 66 instead of 1089 at radius 16.

Source: Pham and van Vliet 2005, "Separable bilateral filtering for fast video preprocessing",
doi:10.1109/ICME.2005.1521458.

Departures from the joint bilateral filter: J does not factor into a term in x and one in y, so the
result differs: a pixel averages only pixels that a row and a column connect without crossing an
edge. The second pass compares filtered colours, which have less noise: it keeps more of the taps
that noise would have rejected, and fewer across an edge.
"""

from __future__ import annotations

from dataclasses import dataclass

from onespp.denoise.inputs.demodulation import read_texture
from onespp.denoise.inputs.surface import Surface
from onespp.denoise.jit.arrays import Color
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.render.frame import Frame

from .bilateral import (
    OUTSIDE,
    Bilateral,
    BilateralState,
    Center,
    TapLine,
    WeightedColor,
    add_taps,
    no_taps,
)


@dataclass(frozen=True)
class BilateralSeparable(Bilateral):
    """Joint bilateral filter in two passes, rows, then columns: the cheaper form.

    Attributes: those of `Bilateral`.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = BilateralSeparable(radius=8)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    def init_on(self, stencil: Stencil) -> BilateralState:
        planes = stencil.planes(OUTSIDE, aligned=True)
        window = range(-self.radius, self.radius + 1)
        return BilateralState(stencil, planes, [
            TapLine.make(planes, [(0, dx) for dx in window], 0, Step(add_taps)),
            TapLine.make(planes, [(dy, 0) for dy in window], 0, Step(add_taps))])

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: BilateralState) -> tuple[Color, BilateralState]:
        stencil = state.stencil
        texture = read_texture(frame, stencil, self.demodulate)
        center = self.prepare(texture.demodulate(color), surface, state.planes)
        weights = self.weights(stencil)
        along_row, along_column = state.lines
        center = _with_mean(center, along_row.add(center, no_taps(stencil), weights))
        evaluate(center.sample.color)
        state.planes.store(center.sample.color)
        center = _with_mean(center, along_column.add(center, no_taps(stencil), weights))
        scale = stencil.opaque(1 / self.color_scale)
        return texture.modulate(Color(*[c * scale for c in center.sample.color])), state


def _with_mean(center: Center, sums: WeightedColor) -> Center:
    """The pixel with the mean of the taps in the place of its colour."""
    return center._replace(sample=center.sample._replace(color=sums.mean()))
