"""Square blocks that tile an image, and sums over the pixels of each.

A block reaches over the image's edge where the tiling is shifted; what lies outside is the image
mirrored there, so that each block has all of its pixels, and one of which a single column is inside
is not fitted to that column alone.

A sum takes two kernels: a lane for each row of each block, then a lane for each block. No sum
depends on the order in which lanes run, so that the same input gives the same bytes.
"""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr

from onespp.denoise.jit.arrays import Float, Int, UInt
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.masked import while_loop
from onespp.denoise.jit.structure import evaluate


class Shift(NamedTuple):
    """How far the tiling lies above and to the left of the image, 0 to size - 1 [pixels]."""

    dy: Int
    dx: Int


@dataclass(frozen=True)
class Blocks:
    """Blocks of size x size pixels that cover an image however they are shifted."""

    stencil: Stencil
    size: int

    @property
    def across(self) -> int:
        """Blocks a row."""
        return (self.stencil.width + self.size - 2) // self.size + 1

    @property
    def count(self) -> int:
        return self.across * ((self.stencil.height + self.size - 2) // self.size + 1)

    def of_pixels(self, shift: Shift) -> UInt:
        """The block that each pixel of the image lies in."""
        s = self.stencil
        y, x = (s.UInt(s.Int(at) + d) // self.size for at, d in zip(s.pixel(), shift))
        return y * self.across + x

    def of_rows(self) -> UInt:
        """The block that each row of blocks belongs to."""
        return dr.arange(self.stencil.UInt, self.count * self.size) // self.size

    def reduce(self, records: Float, words: int, count: int, shift: Shift, starts: Sequence[float],
               visit: Callable[[list[Float], list[Float]], list[Float]],
               join: Callable[[list[Float], list[Float]], list[Float]]) -> list[Float]:
        """Evaluated numbers of each block.

        Args:
            records: `words` floats a pixel (`Stencil.pack`), of which `count` are used.
            starts: the numbers of no pixels.
            visit: numbers so far and a pixel's record to the numbers with it, for each row.
            join: numbers of some rows, and those of another, to the numbers of both.
        """
        rows = self._over_columns(records, words, count, shift, starts, visit)
        evaluate(rows)
        s, size = self.stencil, self.size
        first = dr.arange(s.UInt, self.count) * size

        def body(i: Any, sums: list[Float]) -> tuple:
            return i + 1, join(sums, [dr.gather(s.Float, row, first + s.UInt(i)) for row in rows])

        _, sums = while_loop((dr.zeros(s.Int, self.count), _full(s, starts, self.count)),
                              lambda i, sums: i < size, body, labels=("row", "sums"))
        evaluate(sums)
        return sums

    def _over_columns(self, records: Float, words: int, count: int, shift: Shift,
                      starts: Sequence[float],
                      visit: Callable[[list[Float], list[Float]], list[Float]]) -> list[Float]:
        """Of each row of each block."""
        s, size = self.stencil, self.size
        lanes = self.count * size
        lane, block = dr.arange(s.UInt, lanes), self.of_rows()
        down = block // self.across
        y = s.Int(down * size + (lane - block * size)) - shift.dy
        left = s.Int((block - down * self.across) * size) - shift.dx
        start = _mirrored(y, s.height, size) * s.stride

        def body(i: Any, sums: list[Float]) -> tuple:
            at = s.UInt(start + _mirrored(left + i, s.width, size))
            return i + 1, visit(sums, s.unpack(records, at, words, count, lanes))

        _, sums = while_loop((dr.zeros(s.Int, lanes), _full(s, starts, lanes)),
                              lambda i, sums: i < size, body, labels=("column", "sums"))
        return sums


def _full(stencil: Stencil, values: Sequence[float], lanes: int) -> list[Float]:
    return [dr.full(stencil.Float, float(value), lanes) for value in values]


def _mirrored(at: Int, length: int, most_below: int) -> Int:
    """An index that may be up to `most_below` below 0, or anywhere above, into 0 to length - 1."""
    period = 2 * length
    at = (at + period * -(-most_below // period)) % period
    return dr.minimum(at, period - 1 - at)
