"""Turns at Dr.Jit: one thread at a time, never interrupted halfway, never in a forked process, and
never while Python's cycle collector frees what it may be at.

Dr.Jit records kernels in one state for the process, and an interrupt while it traces a loop leaves
that in a bad state. So whatever traces or runs kernels does it in a turn: threads wait for each
other's, and Ctrl-C raises KeyboardInterrupt at the end of the turn (a second one at once).
A forked process has none of Dr.Jit's threads and would wait for them for ever; it is told so.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from onespp.render.errors import InputError


class _Turns:
    """The lock, and whether this process was forked after Dr.Jit was loaded."""

    lock = threading.RLock()
    depth = 0
    forked = False

    @classmethod
    def after_fork(cls) -> None:
        cls.lock = threading.RLock()  # another thread may have held it, which is not here
        cls.depth = 0
        cls.forked = cls.forked or "drjit" in sys.modules


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_Turns.after_fork)


@contextmanager
def turn() -> Iterator[None]:
    """Hold Dr.Jit for a step of the work; may be nested.

    Raises:
        InputError: this process was forked from one that had loaded Dr.Jit.
        KeyboardInterrupt: at the end, if Ctrl-C was pressed meanwhile.
    """
    check_process()
    with _Turns.lock:
        _Turns.depth += 1
        try:
            if _Turns.depth > 1:
                yield
                return
            with _interrupts_after(), no_collection():
                try:
                    yield
                finally:
                    _finish()
        finally:
            _Turns.depth -= 1


@contextmanager
def no_collection() -> Iterator[None]:
    """Keeps Python's cycle collector away. An array that it frees while Dr.Jit records, or a scene
    that it frees while Dr.Jit traces, which calls fewer functions then than a moment before, ends
    the process (`enqueue_host_func(): this function cannot be recorded`, `invalid redefinition of
    function`)."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def check_process() -> None:
    """InputError in a process that was forked after Dr.Jit was loaded."""
    if _Turns.forked:
        raise InputError("this process was forked after Dr.Jit had been loaded, whose threads are "
                         "not in it: start processes with multiprocessing.get_context('spawn'), or "
                         "fork before the first render or denoise")


def _finish() -> None:
    """Wait for this thread's kernels: the next turn may be another thread's, which would not."""
    if (drjit := sys.modules.get("drjit")) is not None:
        drjit.sync_thread()


@contextmanager
def _interrupts_after() -> Iterator[None]:
    """Holds Ctrl-C back until the end, where it is Python's own and would be raised in between.

    (The command line has a handler of its own, which only takes note.)
    """
    if (threading.current_thread() is not threading.main_thread()
            or signal.getsignal(signal.SIGINT) is not signal.default_int_handler):
        yield
        return
    asked = False

    def ask(number: int, frame: FrameType | None) -> None:
        nonlocal asked
        if asked:
            signal.default_int_handler(number, frame)
        asked = True

    signal.signal(signal.SIGINT, ask)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if asked:
        raise KeyboardInterrupt
