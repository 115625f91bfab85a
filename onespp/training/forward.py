"""A network in JAX: its plan (`denoise/methods/learned/`) over arrays.

Images are (batch, height, width, features); sides are multiples of the network's alignment.
"""

# pyright: standard, reportMissingImports=false
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
from jax import lax

from onespp.denoise.methods.learned.architecture import Architecture, Memory

Array = Any  # of JAX, or traced
Parameters = dict[str, Array]


def forward(network: Architecture, weights: Parameters, frames: Array) -> Array:
    """(batch, time, h, w, 3) compressed light, from planes (batch, time, h, w, 7); nothing is
    remembered from before the first frame."""
    on = Arrays(network, weights)
    if not network.remembers:
        found, _ = network.run(on, frames.reshape(-1, *frames.shape[2:]), [])
        return found.reshape(*frames.shape[:-1], -1)
    memory: Memory = []
    images = []
    for t in range(frames.shape[1]):  # in a loop of JAX's, XLA takes three times as long on CPUs
        image, memory = network.run(on, frames[:, t], memory)
        images.append(image)
    return jnp.stack(images, 1)


@dataclass(frozen=True)
class Arrays:
    """The `Operations` of a network with these weights."""

    network: Architecture
    weights: Parameters

    def layer(self, name: str, *features: Array) -> Array:
        x, slope = jnp.concatenate(features, -1), self.network.slope_of(name)
        found = lax.conv_general_dilated(x, self.weights[name], (1, 1), "SAME",
                                         dimension_numbers=("NHWC", "HWIO", "NHWC"))
        found = found + self.weights[f"{name}.bias"]
        return found if slope == 1 else jnp.where(found > 0, found, slope * found)

    def pooled(self, level: int, features: Array) -> Array:
        b, h, w, c = features.shape
        x = features.reshape(b, h // 2, 2, w // 2, 2, c)
        x = _greater(x[:, :, 0], x[:, :, 1])
        return _greater(x[:, :, :, 0], x[:, :, :, 1])

    def upsampled(self, level: int, features: Array) -> Array:
        return features.repeat(2, 1).repeat(2, 2)

    def nothing(self, level: int, features: Array) -> Array:
        return jnp.zeros_like(features)


def _greater(a: Array, b: Array) -> Array:
    """Its slope, and that of the rectifier, is one choice: with `jnp.maximum` in both, which halves
    it between equal ones, a step takes a fifth longer."""
    return jnp.where(a >= b, a, b)
