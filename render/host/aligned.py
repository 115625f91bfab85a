"""NumPy values as Dr.Jit arrays that give the same kernel every time."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

T = TypeVar("T")
_LINE = 64  # bytes of a cache line, and of the widest vector


def aligned(kind: type[T], values: np.ndarray) -> T:
    """A one-dimensional Dr.Jit array of `kind`, 4 bytes an element, from values of its type.

    Dr.Jit maps NumPy's memory where it lies, and loads from an address that is no multiple of a
    vector are other instructions: by chance of allocation, a frame would compile a kernel anew.
    """
    memory = np.empty(values.size + _LINE // 4, values.dtype)
    start = -memory.ctypes.data % _LINE // 4
    memory[start:start + values.size] = values.ravel()
    return kind(memory[start:start + values.size])  # type: ignore[call-arg]
