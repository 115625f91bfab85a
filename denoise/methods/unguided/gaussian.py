"""The Gaussian filter: what a denoiser is before it knows an edge.

    G(i, j) = exp(-|i - j|^2 / 2 sp^2)

i, j pixels on the screen, C colour, sp = sigma_coord (pixels). The result is the mean of Cj over a
square window, weighted by G, of each channel of the colour alike.

Source: GAMES202, lecture on real-time ray tracing and denoising (filtering of a pixel: sum of
weights times values over the sum of weights).

Departures, where the lecture leaves it open: only pixels inside the image count. Pixels of all
objects and of the background count alike, so that light leaks across every edge: that is what the
next filters are for. IDs are read to repair pixels that are not finite, and weigh nothing.

Form: one kernel for a row of taps, launched once for each row of the window; the weights are
arguments, so that another sigma compiles nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import drjit as dr

from onespp.denoise.inputs.surface import Surface
from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.grid import Planes, Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.taps import Offset, Taps
from onespp.render.frame import Frame

from ..base import OnLanes
from ..bilateral import WeightedColor, no_taps
from ..parameters import check_positive, check_whole


class CountedColor(NamedTuple):
    """A pixel's colour, and 1; both are 0 outside the image, where no pixel counts."""

    color: Color
    count: Float


@dataclass(frozen=True)
class Gaussian(OnLanes["GaussianState"]):
    """Gaussian filter of each frame on its own: blurs noise and edges alike.

    Attributes:
        radius: half width of the square window [pixels, 1 to 64]; each value compiles a kernel.
        sigma_coord: falloff with distance on the screen [pixels, above 0].

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Gaussian(radius=6, sigma_coord=2.0)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    radius: int = 12
    sigma_coord: float = 4.0

    def __post_init__(self) -> None:
        check_whole(self, "radius", 64)
        check_positive(self, "sigma_coord")

    @property
    def reach(self) -> int:
        return self.radius

    def init_on(self, stencil: Stencil) -> GaussianState:
        planes, step = stencil.planes([0.0] * 4), Step(add_line)
        window = range(-self.radius, self.radius + 1)
        return GaussianState(stencil, planes, [
            GaussianLine.make(planes, [(dy, dx) for dx in window], dy, step) for dy in window])

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: GaussianState) -> tuple[Color, GaussianState]:
        stencil = state.stencil
        store(state.planes, color)
        weights, sums = self.weights(stencil), no_taps(stencil)
        for line in state.lines:
            sums = line.step(line.taps, self.weight(stencil, line.distance), sums, weights)
        return sums.mean(), state

    def weights(self, stencil: Stencil) -> list[Float]:
        """Of taps 0 to `radius` pixels away along a line."""
        return [self.weight(stencil, distance) for distance in range(self.radius + 1)]

    def weight(self, stencil: Stencil, distance: int) -> Float:
        """Of a distance along a row or a column, in memory of its own: which arguments of a step
        share theirs is part of its recording."""
        return stencil.opaque(math.exp(-0.5 * (distance / self.sigma_coord)**2))


@dataclass(frozen=True)
class GaussianLine:
    """A row or a column of taps, its distance from the pixel, and the recorded step."""

    taps: Taps[CountedColor]
    distance: int
    step: Step[..., WeightedColor]

    @staticmethod
    def make(planes: Planes, offsets: list[Offset], distance: int,
             step: Step[..., WeightedColor]) -> GaussianLine:
        return GaussianLine(planes.taps(offsets).named(_counted), distance, step)


@dataclass(frozen=True)
class GaussianState:
    """Planes of a `CountedColor`, and the lines of taps in the order of their passes."""

    stencil: Stencil
    planes: Planes
    lines: list[GaussianLine]


def store(planes: Planes, color: Color) -> None:
    """Fill the planes with each pixel's colour, which its neighbours see."""
    sample = CountedColor(color, planes.stencil.constant(1))
    evaluate(sample)
    planes.store(sample)


def add_line(taps: Taps[CountedColor], line_weight: Float, sums: WeightedColor,
             weights: list[Float]) -> WeightedColor:
    """Add a line of taps to the sums.

    Args:
        taps: along the line, the one nearest to the pixel in the middle.
        line_weight: of the line's distance from the pixel.
        weights: of taps 0, 1, ... pixels from the middle.
    """
    (r, g, b), w_sum = sums
    radius = len(taps) // 2
    for i in range(len(taps)):
        color, count = taps.at(i)
        w = line_weight * weights[abs(i - radius)]
        r, g, b = dr.fma(w, color.red, r), dr.fma(w, color.green, g), dr.fma(w, color.blue, b)
        w_sum = dr.fma(w, count, w_sum)
        taps.next()
    return WeightedColor(Color(r, g, b), w_sum)


def _counted(red: Float, green: Float, blue: Float, count: Float) -> CountedColor:
    return CountedColor(Color(red, green, blue), count)
