"""Making the sequences of a data set, one after another; several processes may share a folder.

Who makes a sequence holds a lock on its folder (`render/files/lock.py`), which ends with the
process: another one that comes across it goes on to the next. So parts need not be dealt out, and
what a killed process left unfinished is gone on with by the next that comes.

One that failed is made by a fresh process with one thread: it has the memory that a process which
made others still holds (some 400 MiB, at 128x128), and if the system kills it for what
it takes, it alone ends.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from onespp.render.errors import InputError
from onespp.render.files.lock import Busy, writing
from onespp.render.progress import Progress, silent

from .folder import DataSet, Made
from .processes import call

_OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO)


@dataclass
class Outcome:
    """Numbers of sequences that are made, of those that failed twice, and that others make now."""

    made: list[int] = field(default_factory=list)
    failed: dict[int, str] = field(default_factory=dict)
    elsewhere: list[int] = field(default_factory=list)


def make(data: DataSet, number: int, progress: Progress = silent) -> Made:
    """Make a sequence, or what is missing of it.

    Raises:
        Busy: another process makes it. InputError: it cannot be made.
    """
    if made := data.made(number):
        return made
    from onespp.render.job import render_sequence  # imports Mitsuba

    from .look import usable

    place, plan = data.place(number), data.plan
    with writing(place, "sequence"):
        if made := data.made(number):  # by another, until now
            return made
        chosen = usable(plan, number)
        has_reference = chosen.job.fewest_spp is not None
        parts = plan.seeds + 4 * has_reference  # references take the longest
        for k in range(plan.seeds):
            job = (chosen.job if k == 0 else
                   chosen.job.with_other_noise(plan.noise_seed(number, k)))

            def follow(done: float, total: float, what: str, note: str = "", /, k: int = k) -> None:
                before = k + 4 * (has_reference and k > 0)
                after = before + (1 + 3 * done / total if "reference" in what else done / total)
                progress(after, parts, what, note)

            with writing(place / f"seed{k}", "render"):
                sequence = render_sequence(job, place / f"seed{k}", progress=follow)
            fingerprint = sequence.manifest.fingerprint
        return data.finish_sequence(number, fingerprint, chosen.drawn.record, chosen.rejected)


def make_alone(data: DataSet, number: int, progress: Progress = silent) -> None:
    """Make a sequence with less memory: in a process of its own, with one thread.

    Raises:
        Busy, InputError: as `make`; a `CallFailed` where the process died.
    """
    said = call(_MADE_BY, str(data.folder.resolve()), number,
                look=lambda: progress(0, 1, f"sequence {number}, alone"))
    if said == _BUSY:
        raise Busy(f"{data.place(number)} is being written by another process")
    if said is not None:
        raise InputError(said["sentence"]) from OSError(said["errno"], said["sentence"])


_MADE_BY = f"{__name__}:_alone"
_BUSY = "busy"


def _alone(folder: str, number: int) -> str | dict[str, object] | None:
    from onespp.render.host import backend

    backend.set_threads(1)
    try:
        make(DataSet.open(Path(folder)), number)
    except Busy:
        return _BUSY
    except InputError as error:
        if not _is_of_the_disk(error):
            raise
        return {"sentence": str(error), "errno": getattr(_cause(error), "errno", 0)}


def make_all(data: DataSet, numbers: Iterable[int], progress: Progress = silent,
             tell: Callable[[str], None] = lambda sentence: None) -> Outcome:
    """Make sequences that are not whole yet.

    One that fails does not stop the others: what went wrong is in its log, it gets a second try
    with less memory when the others are done, and then it is listed.

    Raises:
        InputError: the disk refuses. KeyboardInterrupt: what was finished is kept.
    """
    numbers = list(numbers)
    there = {*data.numbers()}
    outcome = Outcome([n for n in numbers if n in there])
    waiting, what = [n for n in numbers if n not in there], f"data set {data.plan.name}"
    failed: list[int] = []
    for last in (False, True):
        again: list[int] = []
        outcome.elsewhere = []
        for number in waiting:
            def follow(done: float, total: float, *_: str, number: int = number) -> None:
                progress(len(outcome.made) + 0.99 * done / total, len(numbers), what,
                         f"sequence {number}")

            try:
                (make_alone if number in failed else make)(data, number, follow)
                outcome.made.append(number)
            except Busy:
                again.append(number)
                outcome.elsewhere.append(number)
            except Exception as error:
                if _is_of_the_disk(error):
                    raise
                failed += note_failure(data, outcome, number, error, last, tell)
            progress(len(outcome.made), len(numbers), what)
        waiting = sorted([*again, *failed])
    return outcome


def note_failure(data: DataSet, outcome: Outcome, number: int, error: BaseException, last: bool,
                 tell: Callable[[str], None]) -> list[int]:
    """Log that a sequence failed; it again, for another try, unless this was the last one."""
    data.note_failure(number, error)
    if last:
        outcome.failed[number] = in_a_line(error)
        return []
    tell(f"sequence {number} failed and gets a second try: {in_a_line(error)}")
    return [number]


def _is_of_the_disk(error: BaseException) -> bool:
    cause = _cause(error)
    return isinstance(cause, OSError) and cause.errno in _OF_THE_DISK


def _cause(error: BaseException) -> BaseException | None:
    return error if isinstance(error, OSError) else error.__cause__


def in_a_line(error: BaseException) -> str:
    """What went wrong, for a list."""
    text = str(error) if isinstance(error, (InputError, ValueError)) else repr(error)
    return " ".join(text.split())[:300]
