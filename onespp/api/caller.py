"""Who calls: a program or notebook, or the command line, which follows and speaks in its own way.

In a notebook and on a terminal progress is one line of text that updates itself; elsewhere a
library is silent.
"""

from __future__ import annotations

import functools
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import ParamSpec, TextIO, TypeVar

from onespp.render.errors import InputError
from onespp.render.host.turns import check_process
from onespp.render.progress import Pace, Progress, silent

P = ParamSpec("P")
R = TypeVar("R")

SECONDS_BETWEEN_UPDATES = 0.1


@dataclass(frozen=True)
class Caller:
    """What depends on who calls.

    Attributes:
        progress: yields what follows the work. tell: told beforehand what work will take.
        inform: told afterwards what to know of the result. command: what to record as the command
            that made files. options: whether parameters are typed as `--options`.
    """

    progress: Callable[[], AbstractContextManager[Progress]]
    tell: Callable[[str], None]
    inform: Callable[[str], None]
    command: Callable[[], str]
    options: bool = False


class Line:
    """Progress as one line that updates itself.

    Args:
        stream: where to. clock: seconds.
    """

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream, self._clock = stream, clock
        self._paces: dict[str, Pace] = {}
        self._shown, self._length = float("-inf"), 0

    def __call__(self, done: float, total: float, what: str, note: str = "", /) -> None:
        now = self._clock()
        pace = self._paces.setdefault(what, Pace(now, done))
        if done < total and now - self._shown < SECONDS_BETWEEN_UPDATES:
            return
        self._shown = now
        left = pace.left(now, done, total)
        ending = f", {left:.0f} s left" if left else ""
        self._show(f"{what}: {done:.4g} of {total:g} {note}".rstrip() + ending)

    def say(self, sentence: str) -> None:
        """A line of its own."""
        self._show(sentence)
        self._stream.write("\n")
        self._length = 0

    def end(self) -> None:
        """Leave what was said last."""
        if self._length:
            self._stream.write("\n")
            self._stream.flush()
            self._length = 0

    def _show(self, text: str) -> None:
        self._stream.write("\r" + text.ljust(self._length))
        self._stream.flush()
        self._length = len(text)


def in_notebook() -> bool:
    """Whether this runs in a Jupyter kernel, without importing IPython."""
    module = sys.modules.get("IPython")
    shell = module and module.get_ipython()
    return type(shell).__name__ == "ZMQInteractiveShell"


def stream_of_progress() -> TextIO | None:
    """A notebook's output, or a terminal; None: nobody is looking."""
    if in_notebook():
        return sys.stdout
    return sys.stderr if sys.stderr is not None and sys.stderr.isatty() else None


@contextmanager
def _line() -> Iterator[Progress]:
    stream = stream_of_progress()
    if stream is None:
        yield silent
        return
    line = Line(stream)
    try:
        yield line
    finally:
        line.end()


def _tell(sentence: str) -> None:
    if stream := stream_of_progress():
        Line(stream).say(sentence)


_LIBRARY = Caller(_line, _tell, _tell, lambda: "")
_caller: ContextVar[Caller] = ContextVar("caller", default=_LIBRARY)


def caller() -> Caller:
    """Who calls now."""
    return _caller.get()


@contextmanager
def calling(who: Caller) -> Iterator[None]:
    """Inside, `who` is the caller."""
    token = _caller.set(who)
    try:
        yield
    finally:
        _caller.reset(token)


def public(function: Callable[P, R]) -> Callable[P, R]:
    """A function of the library: its errors name parameters as Python does, not as `--options`."""
    @functools.wraps(function)
    def called(*arguments: P.args, **options: P.kwargs) -> R:
        check_process()
        try:
            return function(*arguments, **options)
        except InputError as error:
            if not caller().options:
                error.args = (without_dashes(str(error)),)
            raise

    return called


def without_dashes(text: str) -> str:
    """`--reference-spp` as `reference_spp`.

    Example:
        >>> without_dashes("--reference-spp and --seed, not x--y")
        'reference_spp and seed, not x--y'
    """
    return re.sub(r"(?<![\w-])--([a-z][a-z-]*)", lambda m: m[1].replace("-", "_"), text)
