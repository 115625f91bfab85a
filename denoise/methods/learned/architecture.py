"""What a network is: its convolutions, and how they lead to one another.

A network has levels: level 0 is the image, and each further one has half the side of the one above.
Its plan is run over features of any kind: lanes of Dr.Jit to denoise (`pyramid.py`), arrays of JAX
to train (`onespp/training/forward.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np

INPUTS, OUTPUTS = 7, 3
WIDTHS: Mapping[str, int] = MappingProxyType({
    "full": 1, "half": 2, "quarter": 4, "eighth": 8, "sixteenth": 16})
"""Name of a width -> by what the published numbers of features are divided."""

Features = Any
"""Of one level: an array, or a list of planes."""
Memory = list[Features]
"""What a network keeps of a frame for the next one; empty before the first."""
Weights = dict[str, np.ndarray]
"""`NAME` -> (3, 3, inputs, outputs), rows first, and `NAME.bias` -> (outputs,), of each layer."""


class Layer(NamedTuple):
    """A 3x3 convolution from so many features to so many, at a level."""

    inputs: int
    outputs: int
    level: int


class Operations(Protocol):
    """What a plan is made of."""

    def layer(self, name: str, *features: Features) -> Features:
        """The convolution of that name, of features side by side, and its rectifier."""
        ...

    def pooled(self, level: int, features: Features) -> Features:
        """The greatest of each 2x2 pixels, from a level to the next one."""
        ...

    def upsampled(self, level: int, features: Features) -> Features:
        """Twice as large by nearest neighbours, from the level below to a level."""
        ...

    def nothing(self, level: int, features: Features) -> Features:
        """0, as many as these."""
        ...


@dataclass(frozen=True)
class Architecture:
    """A kind of network.

    Attributes:
        name, about: of the kind, the second in a few words. levels: how often sides are halved.
        slope: of the rectifier, below 0. last: the layer that has none. width: of `WIDTHS`, that
            which is trained unless another is asked for, and which comes along.
        layers: width -> name -> layer, in the order in which they are run.
        run: a frame's planes and the memory of the frame before -> the three planes of the result,
            and the memory for the next frame.
        remembers: whether there is such a memory.
    """

    name: str
    about: str
    levels: int
    slope: float
    last: str
    width: str
    layers: Callable[[str], dict[str, Layer]]
    run: Callable[[Operations, Features, Memory], tuple[Features, Memory]]
    remembers: bool

    @property
    def alignment(self) -> int:
        """Sides are multiples of it, pixels."""
        return 1 << self.levels

    def slope_of(self, layer: str) -> float:
        """Below 0; 1: none."""
        return 1.0 if layer == self.last else self.slope

    def shapes(self, width: str) -> dict[str, tuple[int, ...]]:
        """Of each array of `Weights`."""
        found: dict[str, tuple[int, ...]] = {}
        for name, layer in self.layers(width).items():
            found[name], found[f"{name}.bias"] = (3, 3, *layer[:2]), (layer.outputs,)
        return found

    def begun(self, width: str, seed: int) -> Weights:
        """Weights before training: normal, of He's variance for the rectifier, a hundredth of it in
        the last layer, so that training does not begin with unlearning an image; biases 0. float32.
        """
        random, found = np.random.default_rng(seed), {}
        for name, shape in self.shapes(width).items():
            gain = 2 / (1 + self.slope**2) / np.prod(shape[:3]) if len(shape) == 4 else 0.0
            if name == self.last:
                gain /= 100
            found[name] = np.float32(np.sqrt(gain)) * random.standard_normal(shape, np.float32)
        return found


def share(numbers: tuple[int, ...], width: str) -> tuple[int, ...]:
    """Of the published numbers of features, rounded up."""
    return tuple(-(-n // WIDTHS[width]) for n in numbers)
