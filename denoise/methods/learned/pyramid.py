"""A network on grids of Dr.Jit lanes: recorded layers, and what leads from level to level."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

import drjit as dr
import numpy as np

from onespp.denoise.jit.arrays import Float, UInt
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.step import Step
from onespp.render.host.aligned import aligned

from .architecture import Architecture, Memory
from .layers import Convolution, pool, upsample
from .weights import Network


@dataclass(frozen=True)
class Pyramid:
    """The `Operations` of a network for frames of one size, which are padded.

    Attributes:
        grids: of level 0, which is padded, to the coarsest.
        inside: for each lane of level 0 that of the frame, mirrored, that it shows. outside: for
            each lane of the frame that of level 0.
    """

    architecture: Architecture
    grids: list[Stencil]
    layers: dict[str, Convolution] = field(repr=False)
    pools: list[Step[..., list[Float]]]
    upsamples: list[Step[..., list[Float]]]
    inside: UInt = field(repr=False)
    outside: UInt = field(repr=False)
    pad: Step[..., list[Float]]
    crop: Step[..., list[Float]]

    @staticmethod
    def make(stencil: Stencil, network: Network) -> Pyramid:
        """For frames on a stencil."""
        kind, weights = network.architecture, network.weights
        height, width = (-(-n // kind.alignment) * kind.alignment
                         for n in (stencil.height, stencil.width))
        grids = [Stencil(height >> i, width >> i, 1, layout=stencil.layout)
                 for i in range(kind.levels + 1)]
        layers = {name: Convolution.make(grids[layer.level], weights[name], weights[f"{name}.bias"],
                                         kind.slope_of(name))
                  for name, layer in kind.layers(network.width).items()}
        pairs = [*pairwise(grids)]
        return Pyramid(
            kind, grids, layers, [Step(partial(pool, a, b)) for a, b in pairs],
            [Step(partial(upsample, b, a)) for a, b in pairs],
            aligned(stencil.UInt, _mirrored(stencil, grids[0]).astype(np.uint32)),
            aligned(stencil.UInt, _lanes(grids[0], stencil).astype(np.uint32)),
            Step(_taken), Step(_taken))

    def __call__(self, planes: list[Float], memory: Memory) -> tuple[list[Float], Memory]:
        """The three planes of the result, and the memory for the next frame.

        Args:
            planes: evaluated input on the frame's lanes. memory: empty before the first frame.
        """
        found, memory = self.architecture.run(self, self.pad(self.inside, planes), memory)
        return self.crop(self.outside, found), memory

    def layer(self, name: str, *features: list[Float]) -> list[Float]:
        return self.layers[name](*features)

    def pooled(self, level: int, features: list[Float]) -> list[Float]:
        return self.pools[level](features)

    def upsampled(self, level: int, features: list[Float]) -> list[Float]:
        return self.upsamples[level](features)

    def nothing(self, level: int, features: list[Float]) -> list[Float]:
        return [self.grids[level].constant(0) for _ in features]


def _mirrored(stencil: Stencil, padded: Stencil) -> np.ndarray:
    """For each lane of the padded grid the lane of the frame's that it shows."""
    lanes = np.arange(stencil.lanes).reshape(stencil.height, stencil.stride)[:, :stencil.width]
    more = [(0, padded.height - stencil.height), (0, padded.width - stencil.width)]
    rows = np.pad(lanes, more, "symmetric")
    return np.pad(rows, [(0, 0), (0, padded.stride - padded.width)], "edge").reshape(-1)


def _lanes(padded: Stencil, stencil: Stencil) -> np.ndarray:
    """For each lane of the frame's grid that of the padded one."""
    rows, columns = np.arange(stencil.height), np.arange(stencil.stride)
    return (rows[:, None] * padded.stride + np.minimum(columns, stencil.width - 1)).reshape(-1)


def _taken(index: UInt, planes: list[Float]) -> list[Float]:
    found = [dr.gather(type(plane), plane, index) for plane in planes]
    dr.eval(found)
    return found
