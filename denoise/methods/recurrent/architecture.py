"""The layers of the recurrent autoencoder and the shapes of their weights.

Symbols: w_0 to w_4 = 32, 43, 57, 76, 101 features of the encoder; d_0 to d_4 = 64, 32, 43, 57, 76
of the decoder; a narrower network has a share of each, rounded up. Every convolution is 3x3.

    down{i}          features of the level above (i = 0: the input) to w_i; then 2x2 max pooling
    block{i}.input   w_i to w_i; what it gives is put beside the block's last output
    block{i}.mix     2 w_i to w_i
    block{i}.output  w_i to w_i: the block's output, which is its memory as well
    up{i}.join       twice as large by nearest neighbours, beside the skipped features, to d_i
    up{i}.out        d_i to d_i; i = 0: to the three planes of the result, without activation

Level i + 1 has 2^-(i+1) of the image's side; up{i} gives level i. What is skipped to it is the
output of block{i-1}; to up0 the input.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

INPUTS, OUTPUTS = 7, 3
ENCODER, DECODER = (32, 43, 57, 76, 101), (64, 32, 43, 57, 76)
LEVELS = len(ENCODER)
ALIGNMENT = 1 << LEVELS  # sides are padded to a multiple of it, pixels
SLOPE = 0.1              # of the leaky rectifier, below 0
WIDTHS: Mapping[str, int] = MappingProxyType({
    "full": 1, "half": 2, "quarter": 4, "eighth": 8, "sixteenth": 16})
"""Name of a width -> by what the published numbers of features are divided."""

Weights = dict[str, np.ndarray]
"""`NAME` -> (3, 3, inputs, outputs), rows first, and `NAME.bias` -> (outputs,), of each layer."""


class Features(NamedTuple):
    """How many of each level: w and d."""

    encoder: tuple[int, ...]
    decoder: tuple[int, ...]


def features(width: str) -> Features:
    """Of a width of `WIDTHS`."""
    share = WIDTHS[width]
    return Features(*(tuple(-(-n // share) for n in side) for side in (ENCODER, DECODER)))


def layers(width: str) -> dict[str, tuple[int, int]]:
    """Name -> (inputs, outputs) of each convolution, in the order in which they are run."""
    w, d = features(width)
    found = {}
    for i in range(LEVELS):
        found[f"down{i}"] = (w[i - 1] if i else INPUTS, w[i])
        found[f"block{i}.input"] = (w[i], w[i])
        found[f"block{i}.mix"] = (2 * w[i], w[i])
        found[f"block{i}.output"] = (w[i], w[i])
    below = w[-1]
    for i in reversed(range(LEVELS)):
        found[f"up{i}.join"] = (below + (w[i - 1] if i else INPUTS), d[i])
        found[f"up{i}.out"] = (d[i], d[i] if i else OUTPUTS)
        below = d[i]
    return found


def shapes(width: str) -> dict[str, tuple[int, ...]]:
    """Of each array of `Weights`."""
    found: dict[str, tuple[int, ...]] = {}
    for name, (inputs, outputs) in layers(width).items():
        found[name], found[f"{name}.bias"] = (3, 3, inputs, outputs), (outputs,)
    return found


def begun(width: str, seed: int) -> Weights:
    """Weights before training: normal, of He's variance for the rectifier, a hundredth of it in the
    last layer, so that training does not begin with unlearning an image; biases 0. float32."""
    random, found = np.random.default_rng(seed), {}
    for name, shape in shapes(width).items():
        gain = 2 / (1 + SLOPE**2) / np.prod(shape[:3]) if len(shape) == 4 else 0.0
        if name == "up0.out":
            gain /= 100
        found[name] = np.float32(np.sqrt(gain)) * random.standard_normal(shape, np.float32)
    return found
