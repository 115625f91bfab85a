"""NumPy values as Dr.Jit arrays that give the same kernel every time.

Dr.Jit maps NumPy's memory where it lies. A kernel that was compiled for one address may have to be
compiled anew for another (`aligned`), and a recording (`recorded.py`) that comes by an array in a
virtual call reads the address that it had when that was recorded (`owned`).
"""

from __future__ import annotations

from typing import Any, TypeVar

import drjit as dr
import numpy as np

T = TypeVar("T")
_LINE = 64  # bytes of a cache line, and of the widest vector


def aligned(kind: type[T], values: np.ndarray) -> T:
    """A one-dimensional Dr.Jit array of `kind`, 4 bytes an element, from values of its type.

    Loads from an address that is no multiple of a vector are other instructions: by chance of
    allocation, a frame would compile a kernel anew.
    """
    memory = np.empty(values.size + _LINE // 4, values.dtype)
    start = -memory.ctypes.data % _LINE // 4
    memory[start:start + values.size] = values.ravel()
    return kind(memory[start:start + values.size])  # type: ignore[call-arg]


def owned(kind: type[T], values: np.ndarray) -> T:
    """The same in memory of Dr.Jit's own, of at least one value; takes a small kernel."""
    array_type: Any = kind
    if values.size == 1:
        return dr.opaque(array_type, values.item())
    index: Any = dr.uint32_array_t(array_type)
    # (From back to front: a gather in order is no copy, but the mapped array itself.)
    mapped = aligned(array_type, values.ravel()[::-1])
    copy = dr.gather(array_type, mapped, values.size - 1 - dr.arange(index, values.size))
    dr.eval(copy)
    return copy
