"""Layers of a network over the lanes of grids: convolutions by shifted views, pooling, upsampling.

A convolution is one kernel: its nine taps of every input side by side are a vector, and the weights
a matrix that it is multiplied by (`drjit.nn.matvec`). Weights are arguments, so that networks share
kernels, and a kernel is short: with weights as literal numbers it would be a millisecond to compile
for each of them.
"""

# pyright: standard
from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import drjit as dr
import drjit.nn as nn
import numpy as np

from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.grid import Planes, Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.taps import Taps

_TAPS = [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]


@dataclass(frozen=True)
class Convolution:
    """A 3x3 convolution of features that are 0 outside the image, and its rectifier, if any."""

    planes: Planes = field(repr=False)
    taps: Taps[list[Float]] = field(repr=False)
    matrix: Float = field(repr=False)
    bias: Float = field(repr=False)
    step: Step[..., list[Float]]

    @staticmethod
    def make(stencil: Stencil, weights: np.ndarray, bias: np.ndarray,
             slope: float) -> Convolution:
        """Of weights (3, 3, inputs, outputs), and the slope below 0; 1: no rectifier."""
        inputs, outputs = weights.shape[2:]
        planes = stencil.planes([0.0] * inputs)
        matrix = np.ascontiguousarray(weights.reshape(-1, outputs).T, np.float32)
        return Convolution(
            planes, planes.taps(_TAPS), stencil.table(matrix.reshape(-1)), stencil.table(bias),
            Step(partial(convolve, shape=(outputs, 9 * inputs), slope=slope)))

    def __call__(self, *features: list[Float]) -> list[Float]:
        """Of evaluated features, which are put beside each other."""
        first = 0
        for some in features:
            self.planes.store(some, first)
            first += len(some)
        return self.step(self.taps, self.matrix, self.bias)


def convolve(taps: Taps[list[Float]], matrix: Float, bias: Float, shape: tuple[int, int],
             slope: float) -> list[Float]:
    """One output a row of the matrix."""
    around = [x for t in range(len(taps)) for x in taps.at(t)]
    tensor: Any = dr.tensor_t(type(matrix))
    rows = nn.view(tensor(matrix, shape))
    found = [*nn.matvec(rows, nn.CoopVec(*around), nn.view(bias))]
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
