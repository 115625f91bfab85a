"""The command lines that made a sequence, its results and its times."""

from __future__ import annotations

from collections.abc import Iterable

from onespp.render.files.sequence import FrameSequence
from onespp.render.files.times import read_times

from .method_score import INPUT


def commands(sequence: FrameSequence, methods: Iterable[str]) -> list[str]:
    """What made a sequence, the methods' results and the times, in that order; each line once."""
    times = read_times(sequence.folder)
    runs = [sequence.read_run(name) for name in methods if name != INPUT]
    lines = [*sequence.manifest.commands, *(run.command for run in runs),
             times.command if times else ""]
    return [line for line in dict.fromkeys(lines) if line]
