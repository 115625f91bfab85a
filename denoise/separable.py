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
from typing import Any

from render.frame import Frame

from .arrays import Color
from .bilateral import OUTSIDE, Bilateral, add_row_of_taps
from .demodulation import read_texture
from .stencil import Planes, Stencil, Step, Taps
from .structure import evaluate
from .surface import Surface


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

    def init_on(self, stencil: Stencil) -> SeparableState:
        planes = stencil.planes(OUTSIDE, aligned=True)
        window = range(-self.radius, self.radius + 1)
        passes = [planes.taps([(0, dx) for dx in window]), planes.taps([(dy, 0) for dy in window])]
        return SeparableState(stencil, planes, passes, [Step(add_row_of_taps) for _ in passes])

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: SeparableState) -> tuple[Color, SeparableState]:
        stencil = state.stencil
        texture = read_texture(frame, stencil, self.demodulate)
        center, weights = self.prepare(texture.demodulate(color), surface, state.planes)
        for taps, step in zip(state.passes, state.steps, strict=True):
            zeros = [stencil.constant(0) for _ in range(4)]
            *sums, total = step(taps, center, zeros, [*weights, stencil.opaque(0)])
            center = [s / total for s in sums] + center[3:]
            if taps is not state.passes[-1]:
                evaluate(center)
                state.planes.store(center[:3])
        scale = stencil.opaque(1 / self.color_scale)
        return texture.modulate(Color(*[c * scale for c in center[:3]])), state


@dataclass(frozen=True)
class SeparableState:
    """Planes as in `BilateralState`, their taps along a row and along a column."""

    stencil: Stencil
    planes: Planes
    passes: list[Taps]
    steps: list[Step[..., Any]]
