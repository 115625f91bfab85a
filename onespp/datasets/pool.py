"""Making a data set by a pool of processes, through Dask.distributed: a task a sequence.

A task is known by the plan's hash and its number, makes what is missing in the shared folder, and
returns the hash of what is there. So a task whose worker died is run again by another one, which
goes on with the files that are whole; and one that runs twice, because a scheduler has lost sight
of a worker, waits for the other by the lock on the sequence's folder.

A scheduler that ends takes with it what it knew of tasks, and its workers end as well. What was not
done is given to it anew when it is back, which workers make from the files that are whole.
"""

from __future__ import annotations

import logging
import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
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
_SECONDS_TO_COME_BACK = 300
_MOST_LOSSES = 3  # of the scheduler, while nothing gets done
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
        InputError: Dask is not installed, there is no such scheduler, or it was lost and does not
            come back.
    """
    numbers, there = list(numbers), {*data.numbers()}
    outcome, what = Outcome([n for n in numbers if n in there]), f"data set {data.plan.name}"
    waiting = [n for n in numbers if n not in there]
    folder = str(data.folder.resolve())
    if address == LOCAL:
        threads = threads or max(1, (os.cpu_count() or 1) // _workers(workers))

    def submitted(client: Any, numbers: Iterable[int], last: bool) -> dict[Any, int]:
        # A new key for the second try: a task that has failed is remembered as that.
        return {client.submit(task, folder, n, threads, last, retries=0, pure=False,
                              key=f"{data.plan.key}-{n}-{int(last)}"): n for n in numbers}

    def look() -> None:
        progress(len(outcome.made), len(numbers), what)

    connection = _Connection(address, workers)
    try:
        for last in (False, True):
            failed: list[int] = []
            while waiting:
                lost, before = [], len(outcome.made)
                look()
                for done, number in _as_they_end(submitted(connection.client, waiting, last), look):
                    if done.status == "finished":
                        outcome.made.append(number)
                    elif done.status == "error":
                        failed += note_failure(data, outcome, number, done.exception(), last, tell)
                    else:  # cancelled, or lost
                        lost.append(number)
                if lost:
                    tell(f"the scheduler was lost with {len(lost)} sequences to go, which it is "
                         "given when it is back; its workers have to be started again, too")
                    connection.again(made_some=len(outcome.made) > before)
                waiting = lost
            waiting = sorted(failed)
            look()
    finally:
        connection.close()
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


class _Connection:
    """A client of a scheduler, and another one where that was lost."""

    def __init__(self, address: str, workers: int | None) -> None:
        self._address, self._workers, self._held, self._losses = address, workers, ExitStack(), 0
        self.client = self._held.enter_context(_client(address, workers))

    def again(self, made_some: bool) -> None:
        """Connect anew, as soon as there is a scheduler; InputError where that does not help."""
        self._losses = 1 if made_some else self._losses + 1
        self.close()
        try:
            if self._losses > _MOST_LOSSES:
                raise InputError(f"it was lost {self._losses} times")
            self.client = self._held.enter_context(_client(self._address, self._workers,
                                                           _SECONDS_TO_COME_BACK))
        except InputError as error:
            raise InputError(f"the Dask scheduler at {self._address} was lost, and did not come "
                             f"back for long ({error.__cause__ or error}): start it and its "
                             "workers, and run the same command again, which goes on") from error

    def close(self) -> None:
        self._held.close()


@contextmanager
def _client(address: str, workers: int | None,
            seconds: float = _SECONDS_TO_CONNECT) -> Iterator[Any]:
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
        client = distributed.Client(address, timeout=seconds)  # pyright: ignore
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(f"there is no Dask scheduler at {address} ({in_a_line(error)}): start one "
                         "with `dask scheduler`, or use --dask local") from error
    with client:
        yield client
