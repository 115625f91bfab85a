"""How long work tells how far it is."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Called after each step: `done` of `total`, in the work's own unit; `what` names the part of
    the job, and `note` says a word more about the step.

    It may raise KeyboardInterrupt: what was finished is kept, and the work can be gone on with.
    """

    def __call__(self, done: float, total: float, what: str, note: str = "", /) -> None: ...


def silent(done: float, total: float, what: str, note: str = "", /) -> None:
    """Progress that nobody follows."""
