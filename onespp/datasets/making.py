"""Making the sequences of a data set, one after another; several processes may share a folder.

Who makes a sequence holds a lock on its folder (`render/files/lock.py`), which ends with the
process: another one that comes across it goes on to the next. So parts need not be dealt out, and
what a killed process left unfinished is gone on with by the next that comes.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from onespp.render.errors import InputError
from onespp.render.files.lock import Busy, writing
from onespp.render.progress import Progress, silent

from .folder import DataSet, Made

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


def make_all(data: DataSet, numbers: Iterable[int], progress: Progress = silent,
             tell: Callable[[str], None] = lambda sentence: None) -> Outcome:
    """Make sequences that are not whole yet.

    One that fails does not stop the others: what went wrong is in its log, it gets a second try
    when the others are done, and then it is listed.

    Raises:
        InputError: the disk refuses. KeyboardInterrupt: what was finished is kept.
    """
    numbers = list(numbers)
    there = {*data.numbers()}
    outcome = Outcome([n for n in numbers if n in there])
    waiting, what = [n for n in numbers if n not in there], f"data set {data.plan.name}"
    for last in (False, True):
        again: list[int] = []
        outcome.elsewhere = []
        for number in waiting:
            def follow(done: float, total: float, *_: str, number: int = number) -> None:
                progress(len(outcome.made) + 0.99 * done / total, len(numbers), what,
                         f"sequence {number}")

            try:
                make(data, number, follow)
                outcome.made.append(number)
            except Busy:
                again.append(number)
                outcome.elsewhere.append(number)
            except Exception as error:
                if _is_of_the_disk(error):
                    raise
                again += note_failure(data, outcome, number, error, last, tell)
            progress(len(outcome.made), len(numbers), what)
        waiting = again
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


def part_of(numbers: Iterable[int], part: str | None) -> list[int]:
    """Every N-th of the numbers, from the K-th on, for a part 'K/N'; None: all.

    Example:
        >>> part_of(range(8), "2/3")
        [1, 4, 7]

    Raises:
        InputError: not of this form.
    """
    if part is None:
        return list(numbers)
    k, slash, n = part.partition("/")
    if not (slash and k.isdigit() and n.isdigit() and 1 <= int(k) <= int(n)):
        raise InputError(f"--part is {part[:40]!r}: use K/N, as 1/4 to 4/4")
    return list(numbers)[int(k) - 1::int(n)]


def _is_of_the_disk(error: BaseException) -> bool:
    cause = error if isinstance(error, OSError) else error.__cause__
    return isinstance(cause, OSError) and cause.errno in _OF_THE_DISK


def in_a_line(error: BaseException) -> str:
    """What went wrong, for a list."""
    text = str(error) if isinstance(error, (InputError, ValueError)) else repr(error)
    return " ".join(text.split())[:300]
