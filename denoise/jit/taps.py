"""Planes seen from a pixel's neighbours."""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import drjit as dr

from .arrays import Float

T = TypeVar("T")
Named = TypeVar("Named")
Offset = tuple[int, int]


def window(radius: int) -> list[Offset]:
    """Offsets of the pixels around one, row by row, without it."""
    side = range(-radius, radius + 1)
    return [(dy, dx) for dy in side for dx in side if dy or dx]


@dataclass(frozen=True)
class Taps(Generic[T]):
    """Planes at a few offsets: `taps.at(t)` is the planes as seen from the t-th neighbour, a list
    unless they were `named`."""

    views: list[list[Float]]
    planes: list[Float]
    starts: list[Any]
    lanes: int
    backend: dr.JitBackend
    make: Callable[..., T]

    def named(self, make: Callable[..., Named]) -> Taps[Named]:
        """The same taps, of which `at` gives make(*planes), such as a NamedTuple."""
        return Taps(self.views, self.planes, self.starts, self.lanes, self.backend, make)

    def __len__(self) -> int:
        return len(self.views) or len(self.starts)

    @property
    def arrays(self) -> list[list[Float]]:
        """All arrays that a kernel must be given."""
        return self.views or [self.planes, self.starts]

    def seen_as(self, arrays: list[list[Float]]) -> Taps[T]:
        """The same taps of arrays that stand for these."""
        if self.views:
            return replace(self, views=arrays)
        return replace(self, planes=arrays[0], starts=arrays[1])

    def next(self) -> None:
        """Call at the end of a tap: keeps it apart from the following one while compiling.

        Dr.Jit orders operations by scope; with one scope a tap, independent accumulators
        interleave and fewer values wait in registers (1.2 to 2 times faster). An internal call.
        """
        dr.detail.new_scope(self.backend)

    def at(self, t: int) -> T:
        if self.views:
            return self.make(*self.views[t])
        lane = dr.arange(type(self.starts[t]), self.lanes) + self.starts[t]
        return self.make(*[dr.gather(type(plane), plane, lane) for plane in self.planes])


def _listed(*planes: Float) -> list[Float]:
    return list(planes)
