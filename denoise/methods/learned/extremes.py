"""The least and the greatest of each component over the square window around each pixel.

First along rows, then along columns. Only pixels inside the image count.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import drjit as dr

from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.grid import Planes, Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import arrays_of, evaluate
from onespp.denoise.jit.taps import Taps

_FAR = 3e38  # outside the image nothing is the least or the greatest


class Extremes(NamedTuple):
    """Of each component."""

    least: Color
    greatest: Color


@dataclass(frozen=True)
class Window:
    """Planes of `Extremes`, of a single pixel and then along rows, and for each the taps of the
    window along rows or columns with the recorded step."""

    passes: list[tuple[Planes, Taps[Extremes], Step[..., Extremes]]]

    @staticmethod
    def make(stencil: Stencil, radius: int) -> Window:
        def one(offsets: list[tuple[int, int]]) -> tuple:
            planes = stencil.planes([_FAR] * 3 + [-_FAR] * 3)
            return planes, planes.taps(offsets).named(_extremes), Step(widest)

        window = range(-radius, radius + 1)
        return Window([one([(0, d) for d in window]), one([(d, 0) for d in window])])

    def __call__(self, color: Color) -> Extremes:
        """Of an evaluated colour."""
        found = Extremes(color, color)
        for planes, taps, step in self.passes:
            planes.store(found)
            found = step(taps)
        return found


def widest(taps: Taps[Extremes]) -> Extremes:
    """Over all taps."""
    found = arrays_of(taps.at(0))
    for t in range(1, len(taps)):
        other = arrays_of(taps.at(t))
        found = [*map(dr.minimum, found[:3], other[:3]), *map(dr.maximum, found[3:], other[3:])]
        taps.next()
    evaluate(found)
    return _extremes(*found)


def _extremes(*planes: Float) -> Extremes:
    return Extremes(Color(*planes[:3]), Color(*planes[3:]))
