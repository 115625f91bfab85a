"""Making a data set by a pool of processes, through Dask.distributed: a task a sequence.

A task is known by the plan's hash and its number, makes what is missing in the shared folder, and
returns the hash of what is there. So a task whose worker died is run again by another one, which
goes on with the files that are whole; and one that runs twice, because a scheduler has lost sight
of a worker, waits for the other by the lock on the sequence's folder.
"""

from __future__ import annotations

import logging
import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

from onespp.render.errors import InputError
from onespp.render.files.lock import when_free
from onespp.render.host import backend
from onespp.render.progress import Progress, silent

from .folder import DataSet
from .making import Outcome, in_a_line, make, make_alone, note_failure

LOCAL = "local"
_SECONDS_TO_CONNECT = 15
_SECONDS_BETWEEN_LOOKS = 0.2
_SECONDS_FOR_ANOTHER = 3600.0  # that a sequence may take the process that has it


def make_by_pool(data: DataSet, numbers: Iterable[int], address: str, workers: int | None = None,
                 threads: int | None = None, progress: Progress = silent,
                 tell: Callable[[str], None] = lambda sentence: None) -> Outcome:
    """Make sequences that are not whole yet, on the workers of a scheduler.

    One that fails, or whose workers died three times, gets a second try with less memory, and then
    it is listed.

    Args:
        address: of a scheduler, as tcp://HOST:8786, whose workers see the folder by the same path;
            `LOCAL`: workers here, for as long as this runs.
        workers: how many of these; default one a core. threads: of each for kernels; default all
            cores shared out among the workers of a machine.

    Raises:
        InputError: Dask is not installed, or there is no such scheduler.
    """
    numbers, there = list(numbers), {*data.numbers()}
    outcome, what = Outcome([n for n in numbers if n in there]), f"data set {data.plan.name}"
    waiting = [n for n in numbers if n not in there]
    folder = str(data.folder.resolve())
    with _client(address, workers) as client:
        if address == LOCAL:
            threads = threads or max(1, (os.cpu_count() or 1) // _workers(workers))
        for last in (False, True):
            # A new key for the second try: a task that has failed is remembered as that.
            tasks = {client.submit(task, folder, n, threads, last, retries=0, pure=False,
                                   key=f"{data.plan.key}-{n}-{int(last)}"): n for n in waiting}
            waiting = []
            progress(len(outcome.made), len(numbers), what)
            for done, number in _as_they_end(tasks, lambda: progress(len(outcome.made),
                                                                     len(numbers), what)):
                error = done.exception() if done.status == "error" else None
                if error is None and done.status == "finished":
                    outcome.made.append(number)
                else:
                    error = error or InputError(f"its task was {done.status}")
                    waiting += note_failure(data, outcome, number, error, last, tell)
            progress(len(outcome.made), len(numbers), what)
    return outcome


def _as_they_end(tasks: Mapping[Any, int], look: Callable[[], None]) -> Iterator[tuple[Any, int]]:
    """Tasks and their numbers; `look` is called all the while, so that Ctrl-C is heard."""
    pending = dict(tasks)
    while pending:
        ended = [future for future in pending if future.done()]
        for future in ended:
            yield future, pending.pop(future)
        look()
        if not ended:
            time.sleep(_SECONDS_BETWEEN_LOOKS)


def task(folder: str, number: int, threads: int | None, alone: bool = False) -> tuple[str, str]:
    """Make a sequence in a worker, or in a process beside it; its folder, and the hash of its
    files."""
    data = DataSet.open(Path(folder))
    if alone:
        when_free(lambda: make_alone(data, number), _SECONDS_FOR_ANOTHER, 0.5)
    _set_threads_once(threads)
    made = when_free(lambda: make(data, number), _SECONDS_FOR_ANOTHER, 0.5)
    return str(data.place(number)), made.digest


_threads: list[int | None] = []


def _set_threads_once(threads: int | None) -> None:
    if threads is not None and threads not in _threads:
        backend.set_threads(threads)
        _threads[:] = [threads]


def _workers(asked: int | None) -> int:
    return asked or os.cpu_count() or 1


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Threads and processes that are started here never hear of Ctrl-C, which a terminal sends to
    all: the one that is asked to stop ends them. What is pressed meanwhile is heard at the end."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # its start, later, would let interrupts through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _client(address: str, workers: int | None) -> Iterator[Any]:
    """A client of the scheduler, which ends with it if it was started here."""
    try:
        import distributed
    except ImportError:
        raise InputError("--dask needs Dask.distributed, which is not installed: pip install "
                         "'onespp[dask]'") from None
    if address == LOCAL:
        with _without_interrupts():
            cluster = distributed.LocalCluster(
                n_workers=_workers(workers), threads_per_worker=1, processes=True,
                silence_logs=logging.CRITICAL,  # of workers that are ended in the middle of a task
                dashboard_address=None)  # pyright: ignore[reportArgumentType]
        with cluster, distributed.Client(cluster) as client:
            yield client
        return
    try:
        client = distributed.Client(address, timeout=_SECONDS_TO_CONNECT)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(f"there is no Dask scheduler at {address} ({in_a_line(error)}): start one "
                         "with `dask scheduler`, or use --dask local") from error
    with client:
        yield client
