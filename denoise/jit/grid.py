"""The one place that knows how images lie in memory: padded planes, shifted views, frozen steps.

A kernel here runs over the *lanes* of a grid: the h rows of an image, each followed by a gutter of
`reach` pixels that is also the left border of the next row, so that no kernel tests for a border.

- A **plane** is one channel in persistent memory, with `reach` rows above and below. What lies
  outside the image holds a fixed value chosen by the kernel (one that gets weight 0).
- A **tap** is a plane seen from a neighbour, `plane[y + dy, x + dx]` for all lanes at once. On the
  CPU it is a view of the same memory at another offset: one unaligned vector load, where a gather
  of 16 lanes costs as much as 15 such loads. On CUDA, where neighbouring gathers coalesce, it is a
  gather with an offset that the kernel takes as an argument. The `gather` layout also runs on
  the CPU, where the tests compare it with the views.
- A **step** is a traced function that is recorded once and replayed (`dr.freeze`). It takes and
  returns named structures of arrays (`structure.py`).

A kernel's results are fresh arrays, one number a lane. `Planes.store` copies them into planes: a
scatter would cost five times as much, and in a frozen function it silently writes to a copy.
"""

# pyright: standard
from __future__ import annotations

import importlib
from collections.abc import Sequence
from numbers import Integral
from types import ModuleType
from typing import Any

import drjit as dr
import numpy as np

from onespp.render.errors import InputError
from onespp.render.host import backend
from onespp.render.host.aligned import aligned
from onespp.render.host.turns import check_process

from .arrays import Float
from .structure import arrays_of
from .taps import Offset, Taps, _listed

_BACKENDS = {"llvm": dr.JitBackend.LLVM, "cuda": dr.JitBackend.CUDA, "metal": dr.JitBackend.Metal}

_TAIL = 64  # floats after the last lane that a vector load may touch
_LINE = 16  # floats in a cache line
_SHIFT = 7  # floats from a cache line to the first pixel: no filter has taps 7 to the left
_GATHERED = 8  # words that one packed gather brings, at most
_SETS = 64  # sets of a first-level cache: lines that far apart displace each other


def _round_up(n: int, multiple: int) -> int:
    return -(-n // multiple) * multiple


class Stencil:
    """The grid of an image and of the neighbours within `reach` pixels.

    Attributes:
        height, width: of the image, pixels. reach: largest |dx|, |dy| of a tap.
        stride: lanes a row. lanes: lanes of the grid.
        Float, Int, UInt: Dr.Jit array types of the device.

    Raises:
        InputError: an empty image or none of whole pixels, an unknown device or layout.
    """

    def __init__(self, height: int, width: int, reach: int, device: str = "auto",
                 layout: str | None = None) -> None:
        if not (isinstance(height, Integral) and isinstance(width, Integral)):
            raise InputError(f"an image of {width!r} x {height!r} pixels: use whole numbers")
        if height < 1 or width < 1:
            raise InputError(f"an image of {width}x{height} pixels is empty: use 1x1 or more")
        check_process()
        device = backend.choose(device)
        self.layout = layout or ("views" if device == "llvm" else "gather")
        if self.layout not in ("views", "gather") or (self.layout == "views" and device != "llvm"):
            raise InputError(f"layout '{self.layout}' does not exist on {device}: use gather")
        self.height, self.width, self.reach = int(height), int(width), max(reach, 1)
        self.stride = _spread(width + self.reach)
        self.lanes = height * self.stride
        self.planes_made = 0
        module = _module(device)
        self.Float, self.Int, self.UInt = module.Float, module.Int, module.UInt
        self.Array4f, self.ArrayXf = module.Array4f, module.ArrayXf
        self.backend = _BACKENDS[device]

    @property
    def top(self) -> int:
        """Where pixel (0, 0) lies in a plane, floats from its start."""
        return _round_up(self.reach * self.stride + self.reach, _LINE)

    @property
    def size(self) -> int:
        """Floats in a plane."""
        below = self.reach * self.stride + self.reach
        return _round_up(self.top + self.lanes + below, _LINE) + _TAIL

    def pixel(self) -> tuple[Any, Any]:
        """(row, column) of each lane as UInt; the gutter repeats the last column."""
        lane = dr.arange(self.UInt, self.lanes)
        row = lane // self.stride
        return row, dr.minimum(lane - row * self.stride, self.width - 1)

    @property
    def plane_bytes(self) -> int:
        """Memory of all planes made so far that is not Dr.Jit's own."""
        return self.planes_made * 4 * self.size

    def planes(self, outside: Sequence[float], aligned: bool = False) -> Planes:
        """Persistent planes, one for each value in `outside`, which their border holds.

        Args:
            aligned: pixels start at a cache line, for filters along a column: see `_allocate`.
        """
        return Planes(self, tuple(outside), aligned)

    def load(self, image: np.ndarray) -> list[Float]:
        """(h, w) or (h, w, c) image to one array of lanes a component. Traced, not evaluated."""
        of_type = self.Int if image.dtype == np.int32 else self.Float
        flat = of_type(np.ascontiguousarray(image).reshape(-1))
        components = 1 if image.ndim == 2 else image.shape[2]
        row, column = self.pixel()
        start = (row * self.width + column) * components
        return [dr.gather(of_type, flat, start + c) for c in range(components)]

    def image(self, arrays: Sequence[Float]) -> np.ndarray:
        """Arrays of lanes to an (h, w, c) float32 image, (h, w) for one, in new memory."""
        dr.eval(*arrays)
        image = np.empty((self.height, self.width, len(arrays)), np.float32)
        for c, array in enumerate(arrays):
            image[..., c] = self.rows(array.numpy())
        return image if len(arrays) > 1 else image[..., 0]

    def rows(self, lanes: np.ndarray) -> np.ndarray:
        """(h, w) view of an array of lanes."""
        return lanes.reshape(self.height, self.stride)[:, :self.width]

    def opaque(self, value: float) -> Float:
        """A number that a kernel takes as an argument: another value recompiles nothing."""
        return dr.opaque(self.Float, float(value))

    def table(self, values: np.ndarray) -> Float:
        """A small array for packed gathers, in memory aligned to 64 bytes: otherwise Dr.Jit
        silently gathers word by word, and a step records again when the alignment changes."""
        return aligned(self.Float, np.asarray(values, np.float32))

    def pack(self, words: Sequence[Float], lanes: int | None = None) -> Float:
        """A few numbers a lane, side by side, for packed gathers. Traced, not evaluated."""
        lanes = lanes or self.lanes
        packed = dr.empty(self.Float, lanes * len(words))
        dr.scatter(packed, self.ArrayXf(words), dr.arange(self.UInt, lanes))
        return packed

    def unpack(self, packed: Float, index: Any, size: int, count: int | None = None,
               lanes: int | None = None) -> list[Float]:
        """The first `count` words (default: all) of the records of `size` words at an index.

        `size` is a multiple of 8, which is what one gather brings. `lanes`, here as in `pack`: how
        many there are, where they are not the image's.
        """
        count, lanes, words = count or size, lanes or self.lanes, []
        for chunk in range(-(-count // _GATHERED)):
            at = self.UInt(index) * (size // _GATHERED) + chunk
            words += list(dr.gather(self.ArrayXf, packed, at, shape=(_GATHERED, lanes)))
        return words[:count]

    def rows_around(self, values: Any, margin: int) -> Taps[list[Float]]:
        """A kernel's results, evaluated over `margin` rows more on either side, seen from the
        2 margin + 1 rows around each pixel: taps without a copy.

        Args:
            values: a structure of arrays (`structure.py`), depth first.
        """
        arrays = arrays_of(values)
        starts = [row * self.stride for row in range(2 * margin + 1)]
        if self.layout == "gather":
            return self.gathers(arrays, starts, self.lanes)
        memory = [array.numpy() for array in arrays]
        return Taps([[self.Float(m[start:start + self.lanes]) for m in memory] for start in starts],
                    [], [], self.lanes, self.backend, _listed)

    def gathers(self, arrays: Sequence[Float], starts: Sequence[int],
                lanes: int) -> Taps[list[Float]]:
        """Taps of the `gather` layout: arrays from each start on."""
        return Taps([], list(arrays), [dr.opaque(self.UInt, start) for start in starts], lanes,
                    self.backend, _listed)

    def constant(self, value: float) -> Float:
        """An array of lanes that holds one number."""
        return dr.opaque(self.Float, float(value), self.lanes)


def _spread(least: int) -> int:
    """Smallest stride from `least` on that is an odd number of cache lines.

    Taps straight above and below are then as aligned as the pixel itself; rows a power of two apart
    fall into different sets of the cache. With an even number (as in 544 floats) all rows of
    taps in all planes share a few sets, and a kernel is four times slower.
    """
    lines = -(-least // _LINE)
    return _LINE * (lines + 1 - lines % 2)


def _module(device: str) -> ModuleType:
    return importlib.import_module(f"drjit.{device}")


class Planes:
    """A few channels of one grid in persistent, padded memory."""

    def __init__(self, stencil: Stencil, outside: tuple[float, ...], aligned: bool) -> None:
        self.stencil, self._count = stencil, len(outside)
        self._views: dict[tuple[int, int, int], Float] = {}
        self._memory, self._targets, self._arrays = [], [], []
        for value in outside:
            if stencil.layout == "views":
                index, shift = stencil.planes_made, 0 if aligned else _SHIFT
                self._memory.append(_allocate(stencil.size, value, index, shift))
                stencil.planes_made += 1
                self._targets.append(self._memory[-1][stencil.top:stencil.top + stencil.lanes])
            else:
                self._arrays.append(dr.opaque(stencil.Float, float(value), stencil.size))

    def store(self, values: Any, first: int = 0, gutters: bool = False) -> None:
        """Copy evaluated arrays of lanes into planes from `first` on.

        Args:
            values: a structure of arrays (`structure.py`), depth first.
            gutters: copy those too, a quarter quicker: where another plane, which keeps its own,
                takes their weight away, so that they need only be finite.
        """
        s, arrays = self.stencil, arrays_of(values)
        if s.layout == "gather":
            lane = dr.arange(s.UInt, s.lanes)
            inside = True if gutters else lane % s.stride < s.width
            for plane, array in zip(self._arrays[first:], arrays):
                dr.scatter(plane, array, lane + s.top, inside)
            dr.eval(self._arrays)
            return
        for target, array in zip(self._targets[first:], arrays):
            if gutters:
                np.copyto(target, array.numpy())
            else:
                np.copyto(s.rows(target), s.rows(array.numpy()))

    def taps(self, offsets: Sequence[Offset], channels: Sequence[int] | None = None,
             margin: int = 0) -> Taps[list[Float]]:
        """Planes (default: all) seen from the neighbours at offsets (dy, dx).

        Args:
            margin: rows above and below the image that are lanes too.
        """
        s = self.stencil
        if any(max(abs(dy) + margin, abs(dx)) > s.reach for dy, dx in offsets):
            raise ValueError(f"a tap lies farther than the stencil's reach of {s.reach} pixels")
        starts = [s.top + (dy - margin) * s.stride + dx for dy, dx in offsets]
        lanes = s.lanes + 2 * margin * s.stride
        channels = range(self._count) if channels is None else channels
        if s.layout == "gather":
            return s.gathers([self._arrays[c] for c in channels], starts, lanes)
        return Taps([[self._view(c, start, lanes) for c in channels] for start in starts], [], [],
                    lanes, s.backend, _listed)

    def _view(self, channel: int, start: int, lanes: int) -> Float:
        """The same offset gives the same variable, so that a frozen function sees the alias."""
        key = (channel, start, lanes)
        if key not in self._views:
            self._views[key] = self.stencil.Float(self._memory[channel][start:start + lanes])
        return self._views[key]


def _allocate(size: int, value: float, index: int, shift: int) -> np.ndarray:
    """Float32 memory that starts `shift` floats after a cache line, each plane's in another set.

    With a shift, hardly any tap starts at a line. One that does is quicker to load, but Dr.Jit
    takes another instruction for it, and where there are many, LLVM moves those to the top of the
    kernel: their vectors wait on the stack, which does not start at a line, and the kernel takes
    up to twice as long. Rows are whole lines, so it is the taps' dx alone which decides, and with
    a shift all levels of a filter are one kernel.
    """
    memory = np.empty(4 * (size + 2 * _SETS * _LINE), np.uint8)
    page = -memory.ctypes.data % (4 * _SETS * _LINE)
    start = page + 4 * (_LINE * (index * 13 % _SETS) + shift)
    floats = memory[start:start + 4 * size].view(np.float32)
    floats.fill(value)
    return floats


def single(plane: Float) -> Float:
    """For `Taps.named`, of taps of one plane."""
    return plane
