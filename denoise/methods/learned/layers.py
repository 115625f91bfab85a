"""Layers of a network over the lanes of grids: convolutions by shifted views, pooling, upsampling.

A convolution is one kernel: its nine taps of every input side by side are a vector, and the weights
a matrix that it is multiplied by (`drjit.nn.matvec`; on a GPU, where that has half precision alone,
by a loop). Weights are arguments, so that networks share kernels, and a kernel is short: with
weights as literal numbers it would be a millisecond to compile for each of them.
"""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import drjit as dr
import drjit.nn as nn
import numpy as np

from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.grid import Planes, Stencil
from onespp.denoise.jit.masked import while_loop
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.taps import Taps

_TAPS = [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]


_Input = Callable[[Sequence[list[Float]]], Any]
"""Evaluated features, beside each other, to what a convolution's kernel reads."""


@dataclass(frozen=True)
class Convolution:
    """A 3x3 convolution of features that are 0 outside the image, and its rectifier, if any."""

    input: _Input
    matrix: Float = field(repr=False)
    bias: Float = field(repr=False)
    step: Step[..., list[Float]]

    @staticmethod
    def make(stencil: Stencil, weights: np.ndarray, bias: np.ndarray,
             slope: float) -> Convolution:
        """Of weights (3, 3, inputs, outputs), and the slope below 0; 1: no rectifier."""
        inputs, outputs = weights.shape[2:]
        matrix = weights.reshape(-1, outputs)
        if stencil.layout == "gather":
            return Convolution(
                _joined, stencil.table(matrix.reshape(-1)), stencil.table(bias),
                Step(partial(convolve_by_loop, stencil, outputs=outputs, slope=slope)))
        shape = (outputs, 9 * inputs)
        return Convolution(_Views.make(stencil, inputs), stencil.table(matrix.T.reshape(-1)),
                           stencil.table(bias), Step(partial(convolve, shape=shape, slope=slope)))

    def __call__(self, *features: list[Float]) -> list[Float]:
        """Of evaluated features, which are put beside each other."""
        return self.step(self.input(features), self.matrix, self.bias)


@dataclass(frozen=True)
class _Views:
    """Copies features into planes, which are seen from nine places."""

    planes: Planes = field(repr=False)
    taps: Taps[list[Float]] = field(repr=False)

    @staticmethod
    def make(stencil: Stencil, inputs: int) -> _Views:
        planes = stencil.planes([0.0] * inputs)
        return _Views(planes, planes.taps(_TAPS))

    def __call__(self, features: Sequence[list[Float]]) -> Taps[list[Float]]:
        first = 0
        for some in features:
            self.planes.store(some, first)
            first += len(some)
        return self.taps


def _joined(features: Sequence[list[Float]]) -> Float:
    planes = [plane for some in features for plane in some]
    joined = dr.concat(planes)
    dr.eval(joined)
    return joined


def convolve(taps: Taps[list[Float]], matrix: Float, bias: Float, shape: tuple[int, int],
             slope: float) -> list[Float]:
    """One output a row of the matrix."""
    around = [x for t in range(len(taps)) for x in taps.at(t)]
    tensor: Any = dr.tensor_t(type(matrix))
    rows = nn.view(tensor(matrix, shape))
    return _rectified([*nn.matvec(rows, nn.CoopVec(*around), nn.view(bias))], slope)


def convolve_by_loop(stencil: Stencil, planes: Float, matrix: Float, bias: Float, outputs: int,
                     slope: float) -> list[Float]:
    """The same of planes one after the other, with a matrix of one output a column."""
    s, (row, column) = stencil, stencil.pixel()
    inputs = dr.width(planes) // s.lanes
    zero = dr.zeros(s.Float, s.lanes)

    def add(j: Any, *sums: Any) -> tuple[Any, ...]:
        tap, plane = j // inputs, j % inputs
        y, x = s.Int(row) + s.Int(tap // 3) - 1, s.Int(column) + s.Int(tap % 3) - 1
        inside = (y >= 0) & (y < s.height) & (x >= 0) & (x < s.width)
        lane = s.Int(plane * s.lanes) + y * s.stride + x
        value = dr.gather(s.Float, planes, s.UInt(lane), inside)
        weights = [dr.gather(s.Float, matrix, j * outputs + k) for k in range(outputs)]
        return j + 1, *(dr.fma(w, value, a) for w, a in zip(weights, sums))

    _, *found = while_loop(
        (dr.zeros(s.UInt, s.lanes), *(zero + dr.gather(s.Float, bias, s.UInt(k))
                                      for k in range(outputs))),
        lambda j, *_: j < 9 * inputs, add)
    return _rectified(found, slope)


def _rectified(found: list[Float], slope: float) -> list[Float]:
    if slope != 1:
        found = [dr.maximum(x, slope * x) for x in found]
    dr.eval(found)
    return found


def pool(fine: Stencil, coarse: Stencil, features: list[Float]) -> list[Float]:
    """The greatest of each 2x2 pixels."""
    row, column = coarse.pixel()
    at = [(2 * row + dy) * fine.stride + 2 * column + dx for dy in (0, 1) for dx in (0, 1)]
    found = []
    for plane in features:
        a, b, c, d = (dr.gather(fine.Float, plane, i) for i in at)
        found.append(dr.maximum(dr.maximum(a, b), dr.maximum(c, d)))
    dr.eval(found)
    return found


def upsample(coarse: Stencil, fine: Stencil, features: list[Float]) -> list[Float]:
    """Twice as large, each pixel the nearest one."""
    row, column = fine.pixel()
    at = (row // 2) * coarse.stride + column // 2
    found = [dr.gather(fine.Float, plane, at) for plane in features]
    dr.eval(found)
    return found
