"""How long work tells how far it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


class Progress(Protocol):
    """Called after each step: `done` of `total`, in the work's own unit; `what` names the part of
    the job, and `note` says a word more about the step.

    It may raise KeyboardInterrupt: what was finished is kept, and the work can be gone on with.
    """

    def __call__(self, done: float, total: float, what: str, note: str = "", /) -> None: ...


def silent(done: float, total: float, what: str, note: str = "", /) -> None:
    """Progress that nobody follows."""


@dataclass(frozen=True)
class Pace:
    """Since when one part of the job is followed, in seconds, and how far it was then: what a run
    that was stopped had done before takes no time now."""

    begun: float
    first: float

    def left(self, now: float, done: float, total: float) -> float:
        """Seconds that the rest will take; 0 while nothing tells."""
        steps = done - self.first
        return (now - self.begun) * (total - done) / steps if steps > 0 else 0
