"""What the tests ask Dr.Jit about kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr


def compiled(function: Callable[[], Any]) -> int:
    """How many kernels a call compiles (or fetches from disk), none of which ran before."""
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        function()
        dr.sync_thread()
        history = dr.kernel_history([dr.KernelType.JIT])
    assert history
    return sum(kernel["cache_disk"] or not kernel["cache_hit"] for kernel in history)


def taking_turns(function: Callable[[], Any]) -> tuple[Any, Any]:
    """Results of a call with one thread and with two."""
    before = dr.thread_count()
    try:
        dr.set_thread_count(1)
        one = function()
        dr.set_thread_count(2)
        return one, function()
    finally:
        dr.set_thread_count(before)
