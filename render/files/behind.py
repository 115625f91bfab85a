"""Files written by one thread, while what comes next is made."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

HandOver = Callable[..., None]


@contextmanager
def writing_behind() -> Iterator[HandOver]:
    """Yields `hand_over(write, *arguments)`, which has another thread call `write(*arguments)`.

    Calls are in order, one at a time. Handing over waits for the one before: so what is in memory
    are the arguments of one call and what is made meanwhile, and an error of a call is raised here,
    by the next one or at the end. Whatever ends the block, an interrupt too, what was handed over
    is written.
    """
    last: Future[None] | None = None

    def hand_over(write: Callable[..., None], *arguments: object) -> None:
        nonlocal last
        if last is not None:
            last.result()
        last = pool.submit(write, *arguments)

    with ThreadPoolExecutor(1, "writer") as pool:
        yield hand_over
    if last is not None:
        last.result()
