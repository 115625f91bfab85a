"""What this machine can do at most, measured: memory bandwidth and arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr

from onespp.denoise.jit.grid import Stencil
from onespp.render.host.timed import timed

_REPEATS = 5
_CHAINS, _STEPS = 12, 64  # independent FMAs in flight, and how often each runs


def memory_bandwidth(lanes: int = 1 << 24) -> float:
    """GB/s of c = a + b, three arrays that no cache holds (64 MB each)."""
    stencil = Stencil(1, 1, 1)
    a, b = (dr.opaque(stencil.Float, value, lanes) for value in (1.0, 2.0))
    return 1e-6 * 3 * 4 * lanes / _quickest(lambda: a + b)


def arithmetic(lanes: int = 1 << 20) -> float:
    """GFLOP/s of fused multiply-adds in registers, two operations each."""
    stencil = Stencil(1, 1, 1)
    start = dr.opaque(stencil.Float, 0.5, lanes)
    factor, term = stencil.opaque(0.999), stencil.opaque(0.001)

    def chains() -> Any:
        values = [start * float(i) for i in range(_CHAINS)]
        for _ in range(_STEPS):
            values = [dr.fma(value, factor, term) for value in values]
        return sum(values[1:], values[0])

    return 1e-6 * 2 * _CHAINS * _STEPS * lanes / _quickest(chains)


def _quickest(kernel: Callable[[], Any]) -> float:
    """ms; the least of a few, since a limit is what the machine can do when left alone."""
    def evaluated() -> None:
        dr.eval(kernel())

    evaluated()
    return min(timed(evaluated)[1] for _ in range(_REPEATS))
