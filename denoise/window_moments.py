"""Mean and deviation of a colour over the square window around each pixel.

First along rows, then along columns: 2 (2 r + 1) taps instead of (2 r + 1)^2. Only pixels inside
the image count. Both passes add up differences from the pixel's own value, which is one of those
that count: E[d^2] is then at most n times the variance, and E[d^2] - E[d]^2 loses few digits,
whatever the brightness. Rows are merged as sets of numbers are (Chan et al. 1979): with n in each,
the variance of all is the mean of the rows' variances plus the variance of the rows' means.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from .arrays import Color, Float
from .stencil import Planes, Stencil, Step, Taps
from .structure import evaluate


@dataclass(frozen=True)
class RowMoments:
    """The pass along rows: planes of the colour, their taps, and the recorded step."""

    planes: Planes
    taps: Taps
    step: Step[..., Any]

    @staticmethod
    def make(stencil: Stencil, radius: int) -> RowMoments:
        planes = stencil.planes([0.0] * 3)
        taps = planes.taps([(0, dx) for dx in range(-radius, radius + 1)], margin=radius)
        return RowMoments(planes, taps, Step(lambda taps: row_moments(stencil, taps)))

    def __call__(self, color: Color) -> list[Float]:
        """`row_moments` of an evaluated colour, over `radius` rows more on either side."""
        self.planes.store(color)
        return self.step(self.taps)


def row_moments(stencil: Stencil, taps: Taps) -> list[Float]:
    """(mean, variance) of each component over the part of a row inside the image.

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
        moments += [own + mean, dr.fma(-mean, mean, squares * norm)]
    evaluate(moments)
    return moments


def window_moments(stencil: Stencil, rows: Taps) -> tuple[list[Float], list[Float]]:
    """Mean and deviation, three each; rows: `row_moments` from the topmost row to the lowest."""
    row, _ = stencil.pixel()
    counts = _inside(stencil, stencil.Int(row), len(rows), stencil.height)
    norm = 1 / sum(counts[1:], counts[0])
    means, deviations = [], []
    for c in range(3):
        own = rows.at(len(rows) // 2)[2 * c]
        total, squares, variances = (stencil.Float(0) for _ in range(3))
        for i, count in enumerate(counts):
            mean, variance = rows.at(i)[2 * c:2 * c + 2]
            d = mean - own
            counted = d * count
            total, squares = total + counted, dr.fma(d, counted, squares)
            variances += variance  # 0 in rows outside the image
            rows.next()
        mean = total * norm
        variance = dr.fma(-mean, mean, (squares + variances) * norm)
        means.append(own + mean)
        deviations.append(dr.sqrt(dr.select(variance > 0, variance, 0)))
    return means, deviations


def _inside(stencil: Stencil, position: Any, side: int, size: int) -> list[Float]:
    """1 for each of the `side` pixels around a position that is in [0, size), else 0."""
    offsets = range(-(side // 2), side // 2 + 1)
    return [dr.select((position + i >= 0) & (position + i < size), stencil.Float(1), 0)
            for i in offsets]
