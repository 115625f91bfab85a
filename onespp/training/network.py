"""The recurrent autoencoder in JAX: layers by name as in denoise/methods/recurrent/architecture.py.

Images are (batch, height, width, features); sides are multiples of 32.
"""

# pyright: standard, reportMissingImports=false
from __future__ import annotations

from typing import Any

import jax.numpy as jnp
from jax import lax

from onespp.denoise.methods.recurrent.architecture import LEVELS, SLOPE

Array = Any  # of JAX, or traced
Parameters = dict[str, Array]


def forward(weights: Parameters, frames: Array) -> Array:
    """(batch, time, h, w, 3) compressed light, from planes (batch, time, h, w, 7); the memory
    before the first frame is 0."""
    batch, time, h, w, _ = frames.shape
    memory = [jnp.zeros((batch, h >> i + 1, w >> i + 1, weights[f"down{i}"].shape[-1]))
              for i in range(LEVELS)]

    found = []
    for t in range(time):  # in a loop of JAX's own, XLA takes three times as long on CPUs
        memory, image = _frame(weights, frames[:, t], memory)
        found.append(image)
    return jnp.stack(found, 1)


def _frame(weights: Parameters, planes: Array, memory: list[Array]) -> tuple[list[Array], Array]:
    x, outputs = planes, []
    for i in range(LEVELS):
        x = _pooled(_leaky(_convolved(weights, f"down{i}", x)))
        x = _leaky(_convolved(weights, f"block{i}.input", x))
        x = jnp.concatenate([x, memory[i]], -1)
        x = _leaky(_convolved(weights, f"block{i}.mix", x))
        x = _leaky(_convolved(weights, f"block{i}.output", x))
        outputs.append(x)
    skipped = [planes, *outputs]
    for i in reversed(range(LEVELS)):
        x = jnp.concatenate([x.repeat(2, 1).repeat(2, 2), skipped[i]], -1)
        x = _leaky(_convolved(weights, f"up{i}.join", x))
        x = _convolved(weights, f"up{i}.out", x)
        x = _leaky(x) if i else x
    return outputs, x


def _convolved(weights: Parameters, name: str, x: Array) -> Array:
    found = lax.conv_general_dilated(x, weights[name], (1, 1), "SAME",
                                     dimension_numbers=("NHWC", "HWIO", "NHWC"))
    return found + weights[f"{name}.bias"]


def _pooled(x: Array) -> Array:
    b, h, w, c = x.shape
    x = x.reshape(b, h // 2, 2, w // 2, 2, c)
    x = _greater(x[:, :, 0], x[:, :, 1])
    return _greater(x[:, :, :, 0], x[:, :, :, 1])


def _leaky(x: Array) -> Array:
    return jnp.where(x > 0, x, SLOPE * x)


def _greater(a: Array, b: Array) -> Array:
    """Its slope, and that of the rectifier, is one choice: with `jnp.maximum` in both, which halves
    it between equal ones, a step takes a fifth longer."""
    return jnp.where(a >= b, a, b)
