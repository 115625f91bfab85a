"""Weighted sums over taps that few pixels need.

A loop that the other lanes do not enter: a packet of lanes of which none is active skips it. Its
taps are gathers, since a shifted view would be read by every lane.
"""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import drjit as dr

from .arrays import Bool, Float
from .grid import Stencil

WORDS = 8  # floats a lane in the table of a window are so many or a multiple: what a gather brings

while_loop: Any = dr.while_loop  # its type hints know loops of one variable only


def weighted_sums(stencil: Stencil, active: Bool, taps: int, count: int,
                  tap: Callable[[Any], tuple[Float, list[Float]]]) -> tuple[Float, list[Float]]:
    """Sum of the weights, and of `count` weighted values, over taps 0 to `taps` - 1.

    Args:
        active: mask; elsewhere all sums are 0.
        tap: index of a tap (an Int array) to its weight and values.
    """
    def body(i: Any, total: Float, sums: list[Float]) -> tuple:
        weight, values = tap(i)
        return i + 1, total + weight, [dr.fma(weight, v, s) for v, s in zip(values, sums)]

    zeros = [dr.zeros(stencil.Float, stencil.lanes) for _ in range(count + 1)]
    _, total, sums = while_loop(
        (dr.select(active, stencil.Int(0), taps), zeros[0], zeros[1:]),
        lambda i, total, sums: i < taps, body, labels=("tap", "total", "sums"))
    return total, sums


def tabulate(stencil: Stencil, words: Sequence[Float], lanes: int | None = None) -> Float:
    """Numbers a lane, and zeros up to a multiple of `WORDS`, as of a window's table. lanes: as of
    `Stencil.pack`."""
    return stencil.pack([*words, *[stencil.Float(0)] * (-len(words) % WORDS)], lanes)


class WindowTap(NamedTuple):
    """Whether a tap is inside the image, its offset, pixels, and its words in the table."""

    inside: Bool
    dy: Float
    dx: Float
    words: list[Float]


def window_taps(stencil: Stencil, radius: int, table: Float,
                count: int = WORDS) -> Callable[[Any], WindowTap]:
    """Function of a tap's index in the window of (2 radius + 1)^2 pixels, the pixel included.

    Args:
        count: numbers a lane in the table.
    """
    row, column = (stencil.Int(i) for i in stencil.pixel())
    side = 2 * radius + 1

    def tap(i: Any) -> WindowTap:
        dy = i // side
        dy, dx = dy - radius, i - side * dy - radius
        y, x = row + dy, column + dx
        inside = (y >= 0) & (y < stencil.height) & (x >= 0) & (x < stencil.width)
        lane = stencil.UInt(dr.select(inside, y * stencil.stride + x, 0))
        return WindowTap(inside, stencil.Float(dy), stencil.Float(dx),
                         stencil.unpack(table, lane, count + -count % WORDS, count))

    return tap
