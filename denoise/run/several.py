"""Several methods over a sequence, one after the other, and what to know of their results."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from itertools import pairwise
from typing import NamedTuple

from onespp.denoise.catalog import PEERS, Method
from onespp.render.channels import REPLAY, SPLIT
from onespp.render.errors import InputError
from onespp.render.files.lock import writing
from onespp.render.files.manifest import Run
from onespp.render.files.sequence import FrameSequence
from onespp.render.games202.layout import gaps
from onespp.render.progress import Progress, silent

from .sequence import Pace, denoise_sequence

BETTER_ON_PLAIN = ("temporal-oidn", "oidn-high")
"""On most frames without visibility apart, as imported ones: up to 4 dB, if not on all."""


class Denoised(NamedTuple):
    """What a method's run says of itself; the pace is None of a short one."""

    run: Run
    pace: Pace | None


def denoise_by(sequence: FrameSequence, methods: Mapping[str, Method],
               progress: Progress = silent, command: str = "") -> dict[str, Denoised]:
    """Denoise by each method into results of its name.

    Args:
        progress: called after each frame. command: the command line, for run.json.

    Raises:
        InputError: there are no frames, or one lacks a channel that a method needs; before
            anything is denoised where that can be known.
    """
    for name, method in methods.items():
        check_replay(name, method.needs, sequence.channels, str(sequence.folder))
    if not any(map(sequence.has_frame, sequence.frames)):
        raise InputError(f"{sequence.folder} has no frames yet: render some first")
    paces: dict[str, Pace] = {}
    runs = {}
    for name, method in methods.items():
        with writing(sequence.folder, f"denoise-{name}"):
            runs[name] = denoise_sequence(sequence, method, name, progress,
                                          partial(paces.__setitem__, name), command)
    return {name: Denoised(run, paces.get(name)) for name, run in runs.items()}


def check_replay(name: str, needs: Iterable[str], channels: Iterable[str], who: str) -> None:
    """InputError where a method needs replayed samples that `who` lacks."""
    if set(REPLAY) & set(needs) - set(channels):
        raise InputError(f"{name} needs the channels {' and '.join(REPLAY)}, which {who} "
                         "lacks: render it with --channels +gradient")


def what_to_know(sequence: FrameSequence, default: bool) -> Iterator[str]:
    """What a user may not know of these frames, a sentence each; `default`: of the method, too."""
    if default and not set(SPLIT) <= set(sequence.channels):
        install = "" if all(PEERS[name].available() for name in BETTER_ON_PLAIN) else (
            ", with Open Image Denoise installed (pip install 'onespp[oidn]')")
        yield (f"these frames lack {' and '.join(SPLIT)}, on which the default method builds: "
               f"without them --method {' or '.join(BETTER_ON_PLAIN)} is sometimes better{install}")
    for a, b in _gaps(sequence):
        yield (f"there is no frame between {a} and {b}: methods with a history took {b} for the "
               f"frame after {a}")


def _gaps(sequence: FrameSequence) -> list[tuple[int, int]]:
    """Neighbours between which frames are missing; a stride that was asked for misses none."""
    there = [i for i in sequence.frames if sequence.has_frame(i)]
    known = gaps(there) if sequence.manifest.source != "render" else []
    return [(a, b) for a, b in pairwise(there)
            if (a, b) in known or any(a < i < b for i in sequence.frames)]
