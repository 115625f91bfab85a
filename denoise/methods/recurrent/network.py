"""The recurrent autoencoder on a grid: its layers in the order of `architecture.py`."""

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

from .architecture import ALIGNMENT, LEVELS
from .layers import Convolution, pool, upsample
from .weights import Network

Memory = list[list[Float]]
"""The output of each block in the frame before."""


@dataclass(frozen=True)
class Autoencoder:
    """The recorded layers for frames of one size, which are padded (`architecture.ALIGNMENT`).

    Attributes:
        grids: of level 0, which is padded, to the coarsest.
        inside: for each lane of level 0 that of the frame, mirrored, that it shows. outside: for
            each lane of the frame that of level 0.
    """

    grids: list[Stencil]
    layers: dict[str, Convolution] = field(repr=False)
    pools: list[Step[..., list[Float]]]
    upsamples: list[Step[..., list[Float]]]
    inside: UInt = field(repr=False)
    outside: UInt = field(repr=False)
    pad: Step[..., list[Float]]
    crop: Step[..., list[Float]]

    @staticmethod
    def make(stencil: Stencil, network: Network) -> Autoencoder:
        """For frames on a stencil."""
        height, width = (-(-n // ALIGNMENT) * ALIGNMENT for n in (stencil.height, stencil.width))
        grids = [Stencil(height >> i, width >> i, 1, layout=stencil.layout)
                 for i in range(LEVELS + 1)]

        def layer(name: str, level: int, is_linear: bool = False) -> None:
            weights = network.weights
            layers[name] = Convolution.make(grids[level], weights[name], weights[f"{name}.bias"],
                                            is_linear)

        layers: dict[str, Convolution] = {}
        for i in range(LEVELS):
            layer(f"down{i}", i)
            for part in ("input", "mix", "output"):
                layer(f"block{i}.{part}", i + 1)
        for i in reversed(range(LEVELS)):
            layer(f"up{i}.join", i)
            layer(f"up{i}.out", i, is_linear=i == 0)
        pairs = [*pairwise(grids)]
        return Autoencoder(
            grids, layers, [Step(partial(pool, a, b)) for a, b in pairs],
            [Step(partial(upsample, b, a)) for a, b in pairs],
            aligned(stencil.UInt, _mirrored(stencil, grids[0]).astype(np.uint32)),
            aligned(stencil.UInt, _lanes(grids[0], stencil).astype(np.uint32)),
            Step(_taken), Step(_taken))

    def __call__(self, planes: list[Float], memory: Memory) -> tuple[list[Float], Memory]:
        """The three planes of the result, and the memory for the next frame.

        Args:
            planes: evaluated input on the frame's lanes. memory: empty before the first frame.
        """
        x, outputs, layers = self.pad(self.inside, planes), [], self.layers
        skipped = [x]
        for i in range(LEVELS):
            x = self.pools[i](layers[f"down{i}"](x))
            x = layers[f"block{i}.input"](x)
            before = memory[i] if memory else [self.grids[i + 1].constant(0) for _ in x]
            x = layers[f"block{i}.output"](layers[f"block{i}.mix"](x, before))
            outputs.append(x)
            skipped.append(x)
        for i in reversed(range(LEVELS)):
            x = layers[f"up{i}.join"](self.upsamples[i](x), skipped[i])
            x = layers[f"up{i}.out"](x)
        return self.crop(self.outside, x), outputs


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
