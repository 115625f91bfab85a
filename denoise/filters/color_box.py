"""Mean and standard deviation of a colour over the square window around each pixel.

First along rows, then along columns: 2 (2 r + 1) taps instead of (2 r + 1)^2. Only pixels inside
the image count. Both passes add up differences from the pixel's own value, which is one of those
that count: E[d^2] is then at most n times the variance, and E[d^2] - E[d]^2 loses few digits,
whatever the brightness. Rows are merged as sets of numbers are (Chan et al. 1979): with n in each,
the variance of all is the mean of the rows' variances plus the variance of the rows' means.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr

from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.grid import Planes, Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.taps import Taps


class MeanVariance(NamedTuple):
    """Of one component over a part of a row."""

    mean: Float
    variance: Float


class RowMoments(NamedTuple):
    """Of each component over the part of a row that is inside the window and the image."""

    red: MeanVariance
    green: MeanVariance
    blue: MeanVariance


class WindowMoments(NamedTuple):
    """Of each component over the part of the window that is inside the image."""

    mean: Color
    standard_deviation: Color


@dataclass(frozen=True)
class RowPass:
    """The pass along rows: planes of the colour, their taps from left to right, and the recorded
    step."""

    planes: Planes
    taps: Taps[Color]
    step: Step[..., RowMoments]

    @staticmethod
    def make(stencil: Stencil, radius: int) -> RowPass:
        planes = stencil.planes([0.0] * 3)
        taps = planes.taps([(0, dx) for dx in range(-radius, radius + 1)], margin=radius)
        return RowPass(planes, taps.named(Color), Step(lambda taps: row_moments(stencil, taps)))

    def __call__(self, color: Color) -> RowMoments:
        """`row_moments` of an evaluated colour, over `radius` rows more on either side."""
        self.planes.store(color)
        return self.step(self.taps)

    def rows_around(self, moments: RowMoments) -> Taps[RowMoments]:
        """What a call gave, from the topmost row of the window to the lowest."""
        radius = len(self.taps) // 2
        return self.planes.stencil.rows_around(moments, radius).named(_row_moments)


def row_moments(stencil: Stencil, taps: Taps[Color]) -> RowMoments:
    """Moments along a row.

    Args:
        taps: the colour from left to right, the pixel itself in the middle.
    """
    column = stencil.Int(dr.arange(stencil.UInt, taps.lanes) % stencil.stride)
    counts = _inside(stencil, column, len(taps), stencil.width)
    norm = 1 / sum(counts[1:], counts[0])
    moments = []
    for c, own in enumerate(taps.at(len(taps) // 2)):
        total, squares = stencil.Float(0), stencil.Float(0)
        for i, count in enumerate(counts):
            d = taps.at(i)[c] - own
            counted = d * count
            total, squares = total + counted, dr.fma(d, counted, squares)
            taps.next()
        mean = total * norm
        moments.append(MeanVariance(own + mean, dr.fma(-mean, mean, squares * norm)))
    evaluate(moments)
    return RowMoments(*moments)


def window_moments(stencil: Stencil, rows: Taps[RowMoments]) -> WindowMoments:
    """Moments over the window; rows: `row_moments` from the topmost row to the lowest."""
    row, _ = stencil.pixel()
    counts = _inside(stencil, stencil.Int(row), len(rows), stencil.height)
    norm = 1 / sum(counts[1:], counts[0])
    means, standard_deviations = [], []
    for c in range(3):
        own = rows.at(len(rows) // 2)[c].mean
        total, squares, variances = (stencil.Float(0) for _ in range(3))
        for i, count in enumerate(counts):
            mean, variance = rows.at(i)[c]
            d = mean - own
            counted = d * count
            total, squares = total + counted, dr.fma(d, counted, squares)
            variances += variance  # 0 in rows outside the image
            rows.next()
        mean = total * norm
        variance = dr.fma(-mean, mean, (squares + variances) * norm)
        means.append(own + mean)
        standard_deviations.append(dr.sqrt(dr.select(variance > 0, variance, 0)))
    return WindowMoments(Color(*means), Color(*standard_deviations))


def _row_moments(*planes: Float) -> RowMoments:
    return RowMoments(*[MeanVariance(*planes[i:i + 2]) for i in (0, 2, 4)])


def _inside(stencil: Stencil, position: Any, side: int, size: int) -> list[Float]:
    """1 for each of the `side` pixels around a position that is in [0, size), else 0."""
    offsets = range(-(side // 2), side // 2 + 1)
    return [dr.select((position + i >= 0) & (position + i < size), stencil.Float(1), 0)
            for i in offsets]
