"""What every command shares: progress that suits the terminal, and errors in one sentence."""

from __future__ import annotations

import errno
import os
import shlex
import signal
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from typing import Any, NoReturn, TextIO

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bar

from onespp.api.caller import Caller, calling
from onespp.render.errors import InputError, readable
from onespp.render.progress import Pace, Progress

SECONDS_BETWEEN_LINES = 5.0
BAD_INPUT, INTERRUPTED = 2, 130


class _Stop:
    """Whether a signal has asked the job to stop.

    Interrupting Dr.Jit while it traces a loop leaves it in a bad state, so a job stops at its
    next step. A second signal does not wait.
    """

    asked = at_once = False

    @classmethod
    def ask(cls, *_: object) -> None:
        if cls.asked:
            cls.at_once = True
            raise KeyboardInterrupt
        cls.asked = True
        click.echo("onespp: stopping after this step (again: at once)", err=True)


class Steps:
    """One part of a job: `advance(done)` with what is done so far, in the part's own unit."""

    def __init__(self, title: str, total: float, bar: Bar | None) -> None:
        self.title, self.total, self._bar = title, total, bar
        self._pace: Pace | None = None
        self._shown = time.monotonic()
        self._finished = False
        self._task = bar.add_task(title, total=total, start=False) if bar else None

    def advance(self, done: float, note: str = "") -> None:
        """`note` says a word more. A safe point: raises KeyboardInterrupt if asked to stop."""
        if _Stop.asked:
            raise KeyboardInterrupt
        if self._bar is not None and self._task is not None:
            if self._pace is None:
                self._bar.start_task(self._task)
            self._bar.update(self._task, completed=done, description=f"{self.title} {note}".strip())
        now = time.monotonic()
        self._pace = self._pace or Pace(now, done)
        last = done >= self.total and not self._finished
        self._finished = done >= self.total
        if self._bar is None and (last or now - self._shown >= SECONDS_BETWEEN_LINES):
            self._shown = now
            left = self._pace.left(now, done, self.total)
            ending = "" if last or not left else f", {left:.0f} s left"
            text = f"{self.title}: {done:.4g} of {self.total:g} {note}".rstrip()
            click.echo(text + ending, err=True)


@contextmanager
def progress() -> Iterator[Progress]:
    """Yields `report(done, total, what, note)`; every new `what` is a part of the job.

    Shown as bars with an ETA on a terminal, as a plain line every few seconds elsewhere (stderr).
    """
    console = Console(stderr=True)
    bar = Bar(TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(),
              TimeElapsedColumn(), TimeRemainingColumn(), console=console)
    parts: dict[str, Steps] = {}

    def report(done: float, total: float, what: str, note: str = "", /) -> None:
        if what not in parts:
            parts[what] = Steps(what, total, bar if console.is_terminal else None)
        parts[what].advance(done, note)

    with bar if console.is_terminal else nullcontext():
        yield report


class _Output:
    """A standard stream that lets a job go on when nobody reads it any more.

    What a job is for are its files: that `head` has seen enough, or a log's disk is full, must not
    end it halfway. What is written after that is dropped.

    Args:
        losses: errors that say so. Others are raised.
    """

    def __init__(self, stream: TextIO, losses: type[OSError]) -> None:
        self._stream, self._losses = stream, losses

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except self._losses:
            self._drop()
            return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except self._losses:
            self._drop()

    def _drop(self) -> None:
        """Lead the stream to nowhere; else Python complains of the rest when it ends."""
        with suppress(OSError, ValueError), open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), self._stream.fileno())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def _lasting_output() -> Iterator[None]:
    """Standard output and error that are there and stay, whatever the caller has closed.

    A file that is opened later must not get the number of a closed stream: libraries print there.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free: this one
    before = sys.stdout, sys.stderr
    with open(os.devnull, "w") as nowhere:
        sys.stdout = _Output(sys.stdout or nowhere, BrokenPipeError)
        sys.stderr = _Output(sys.stderr or nowhere, OSError)
        try:
            yield
        finally:
            with suppress(OSError):  # told already, where it was written
                sys.stdout.flush()
            sys.stderr.flush()
            sys.stdout, sys.stderr = before


def run(command: click.Command, arguments: Sequence[str] | None = None,
        name: str = "onespp") -> None:
    """Run a command line and exit: 0 done, 2 bad input, 130 interrupted.

    Ctrl-C and SIGTERM stop a job at its next step, and what was finished is kept. Errors that are
    not the user's keep their traceback: they are bugs.
    """
    with _lasting_output():
        _run(command, arguments, name)


def _run(command: click.Command, arguments: Sequence[str] | None, name: str) -> None:
    from onespp.scenes.description import SceneError

    _Stop.asked = _Stop.at_once = False
    warnings.showwarning = _tell_warning
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _Stop.ask)
    typed = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with calling(Caller(progress, note, click.echo, command_line, options=True)):
            command.main(args=typed, prog_name=name, standalone_mode=False,
                         obj=readable(shlex.join([*name.split(), *typed])))
    except click.ClickException as error:
        error.show()
        sys.exit(BAD_INPUT)
    except (InputError, SceneError) as error:
        _stop(str(error))
    except (click.Abort, KeyboardInterrupt):
        _interrupted()
    except MemoryError:
        _stop("there is not enough memory: use a smaller --size, or fewer --channels; what was "
              "finished is kept")
    except UnicodeEncodeError as error:
        if error.encoding == "utf-8":
            raise
        _stop(f"{error.object!r} holds letters that this locale ({error.encoding}) has not: use "
              "another name, or a locale of UTF-8, as LC_ALL=C.UTF-8")
    except Exception as error:
        if _Stop.at_once:  # what an interrupt becomes inside an extension's import, say
            _interrupted()
        if not isinstance(error, OSError) or error.errno not in _REASONS:
            raise
        where = f" at {error.filename}" if error.filename else ""
        _stop(_REASONS[error.errno].format(where=where))
    finally:  # Python is about to end, and an interrupt would only make it complain
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)


_show_warning = warnings.showwarning


def _tell_warning(message: Warning | str, category: type[Warning], *where: Any) -> None:
    """What goes with the next version is told in a line of ours."""
    if category is FutureWarning:
        note(str(message))
    else:
        _show_warning(message, category, *where)


def command_line() -> str:
    """The command that runs, as it was typed, quoted for a shell; "" where none was."""
    context = click.get_current_context(silent=True)
    return (context.find_root().obj or "") if context else ""


_REASONS = {
    errno.ENOSPC: "the disk is full{where}: free some space, then run the same command again",
    errno.EDQUOT: "the disk quota is used up{where}: free space, then run the same command again",
    errno.EACCES: "permission denied{where}: choose another --out, or change its permissions",
    errno.EPERM: "operation not permitted{where}: choose another --out",
    errno.EROFS: "the file system is read-only{where}: choose another --out",
    errno.ENOTDIR: "a file is in the way of a folder{where}: choose another --out",
    errno.EISDIR: "a folder is in the way of a file{where}: choose another --out",
    errno.ENAMETOOLONG: "the name of a file is too long{where}: use a shorter one",
    errno.ELOOP: "symbolic links lead in a circle{where}: use another folder",
    errno.EFBIG: "a file would be larger than allowed{where}: choose another --out",
    errno.EIO: "the disk reported an error{where}: check it, then run the same command again",
}


def _interrupted() -> NoReturn:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    click.echo("onespp: stopped; what was finished is kept, and the same command goes on "
               "from there", err=True)
    sys.exit(INTERRUPTED)


def note(sentence: str) -> None:
    """One line beside the output, on standard error."""
    click.echo(f"onespp: {sentence}", err=True)


def _stop(sentence: str) -> NoReturn:
    click.echo(f"onespp: {sentence}", err=True)
    sys.exit(BAD_INPUT)
