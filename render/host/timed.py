"""The time of a call whose kernels run asynchronously."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import drjit as dr


def timed(function: Callable[[], Any]) -> tuple[Any, float]:
    """(result, milliseconds) of a call, kernels included: they run asynchronously otherwise."""
    dr.sync_thread()
    start = time.perf_counter()
    result = function()
    dr.sync_thread()
    return result, 1e3 * (time.perf_counter() - start)
