"""Functions that launch kernels, recorded once and replayed after that.

To trace a function and to find its kernel among those that were compiled takes as long as to run
it, for images of a few tens of thousands of pixels. A recording (`dr.freeze`) launches the kernel
at once. What a recorded function reads is among its arguments, in memory of Dr.Jit's own
(`aligned.owned`): of another array Dr.Jit says so, of mapped memory it may read what was there.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import drjit as dr


class Recorded:
    """A function, called as it is the first time, so that what is built when it is first needed is
    there by then; recorded the second; replayed after that.

    It is recorded anew where an argument is of another form or another Python object, or there are
    other Mitsuba scenes than there were. What Dr.Jit cannot record is called as it is for ever.
    """

    def __init__(self, function: Callable[..., Any], enabled: bool = True) -> None:
        self._function, self._calls, self._enabled = function, 0, enabled
        self._frozen: Any = dr.freeze(function, warn_after=1000)

    def __call__(self, *arguments: Any) -> Any:
        self._calls += 1
        if self._enabled and self._calls > 1:
            try:
                with no_collection():
                    return self._frozen(*arguments)
            except RuntimeError as error:  # of Dr.Jit, or one of the function's that it wraps
                if not str(error).startswith("record()"):
                    raise
                self._enabled = False
        return self._function(*arguments)

    @property
    def recordings(self) -> int:
        """How many there are; 0 where there can be none."""
        return self._frozen.n_recordings if self._enabled else 0


@contextmanager
def no_collection() -> Iterator[None]:
    """Keeps Python's cycle collector away: an array that it frees while Dr.Jit records ends the
    process (`enqueue_host_func(): this function cannot be recorded`)."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
