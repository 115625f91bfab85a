"""The recurrent autoencoder in float64 NumPy, as plainly as it can be written. See
denoise/methods/learned/rae_plan.py."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from .learned import beside, convolved, pooled

_LEVELS = 5


def rae(weights: Mapping[str, np.ndarray], inputs: Iterable[np.ndarray]) -> list[np.ndarray]:
    """(h, w, 3) compressed light of each frame, of planes (h, w, 7); sides are multiples of 32."""
    memory: dict[int, np.ndarray] = {}
    return [_frame(weights, planes, memory) for planes in inputs]


def _frame(weights: Mapping[str, np.ndarray], planes: np.ndarray,
           memory: dict[int, np.ndarray]) -> np.ndarray:
    x, skipped = planes, [planes]
    for i in range(_LEVELS):
        x = pooled(_leaky(convolved(weights, f"down{i}", x)))
        x = _leaky(convolved(weights, f"block{i}.input", x))
        x = np.concatenate([x, memory.get(i, np.zeros_like(x))], -1)
        x = _leaky(convolved(weights, f"block{i}.mix", x))
        x = memory[i] = _leaky(convolved(weights, f"block{i}.output", x))
        skipped.append(x)
    for i in reversed(range(_LEVELS)):
        x = _leaky(convolved(weights, f"up{i}.join", beside(x, skipped[i])))
        x = convolved(weights, f"up{i}.out", x)
        x = _leaky(x) if i else x
    return x


def _leaky(x: np.ndarray) -> np.ndarray:
    return np.where(x > 0, x, 0.1 * x)
