"""The Gaussian filter as two passes, along rows and then along columns: the same, for less.

G of `gaussian.py` is a product of a term in x and one in y, and so is its sum over the window, for
the part of a window that lies inside the image is a rectangle too:

    C1(i) = sum_x G(i, i + x) C(i + x) / sum_x G(i, i + x)
    C2(i) = sum_y G(i, i + y) C1(i + y) / sum_y G(i, i + y)

C2 is the result of `gaussian` but for rounding, with 2 (2 radius + 1) taps instead of
(2 radius + 1)^2: 50 instead of 625 at radius 12. A weight that depends on colours or surfaces does
not factor: `bilateral-separable` is another filter than `bilateral`.

Source: GAMES202, lecture on real-time ray tracing and denoising (large filters as two passes).
"""

from __future__ import annotations

from dataclasses import dataclass

from onespp.denoise.inputs.surface import Surface
from onespp.denoise.jit.arrays import Color
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.step import Step
from onespp.render.frame import Frame

from ..bilateral import no_taps
from .gaussian import Gaussian, GaussianLine, GaussianState, add_line, store


@dataclass(frozen=True)
class GaussianSeparable(Gaussian):
    """Gaussian filter in two passes, rows, then columns: equal to `gaussian`, and cheaper.

    Attributes: those of `Gaussian`.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = GaussianSeparable(radius=6, sigma_coord=2.0)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    def init_on(self, stencil: Stencil) -> GaussianState:
        planes = stencil.planes([0.0] * 4, aligned=True)
        window = range(-self.radius, self.radius + 1)
        return GaussianState(stencil, planes, [
            GaussianLine.make(planes, [(0, dx) for dx in window], 0, Step(add_line)),
            GaussianLine.make(planes, [(dy, 0) for dy in window], 0, Step(add_line))])

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: GaussianState) -> tuple[Color, GaussianState]:
        stencil, weights = state.stencil, self.weights(state.stencil)
        for line in state.lines:
            store(state.planes, color)
            color = line.step(line.taps, self.weight(stencil, 0), no_taps(stencil), weights).mean()
        return color, state
