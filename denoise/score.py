"""Scores a sequence: the input and every method present, against the reference.

Streams: two frames in a row of each method are in memory at a time. The number of a sequence is
the mean of its frames' (for PSNR too: not the PSNR of the pooled squared error, which the worst
frame would dominate).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean
from typing import Any

import numpy as np

from render.atomic import write_text
from render.errors import InputError
from render.sequence import Reference, Sequence

from .bias import split_errors
from .cost import cost
from .ground import read_ground
from .judge import Judge
from .metrics import METRICS, reference_floor, spread
from .pictures import Progress, draw_pictures
from .provenance import commands
from .scorecard import INPUT, MethodScore, Scores
from .stability import MEASURES
from .times import read_times
from .tonemap import TONE_MAP


def score(sequence: Sequence, methods: list[str] | None = None, pictures: bool = True,
          progress: Progress | None = None, seeds: list[Sequence] | None = None,
          command: str = "") -> Scores:
    """Score a sequence, and write scores.json, scores.csv and `pictures/` into its folder.

    Without a reference everything but the error is reported; a method with results for some
    frames only is scored on those, and a note says so. Scores are written before pictures.

    Args:
        methods: which to score beside the input; default: all that have results.
        pictures: also draw contact sheets, the movie and the plot.
        progress: called with (done, total, what).
        seeds: renders of the same with other seeds, to split errors by (`bias.py`).
        command: the command line, for scores.json.

    Raises:
        InputError: an unknown method, no frames, a file that cannot be read or written, or
            `seeds` that are of something else.
    """
    scores = measure_sequence(sequence, methods, progress)
    if seeds:
        splits = split_errors([sequence, *seeds], list(scores.methods))
        scores = scores.model_copy(update={"methods": {
            name: method.model_copy(update={"split": splits.get(name)})
            for name, method in scores.methods.items()}})
    made = [line for s in (sequence, *(seeds or ())) for line in
            commands(s, [name for name in scores.methods if name in s.methods()])]
    scores = scores.model_copy(update={
        "commands": [line for line in dict.fromkeys([*made, command]) if line]})
    write_text(sequence.folder / "scores.json", scores.json_text())
    write_text(sequence.folder / "scores.csv", scores.csv_text())
    if pictures:
        chosen = [m for m in methods if m != INPUT] if methods else None
        trouble = draw_pictures(sequence, scores, chosen, progress)
        scores = scores.model_copy(update={"notes": [*scores.notes, *trouble]})
    return scores


def measure_sequence(sequence: Sequence, methods: list[str] | None = None,
                     progress: Progress | None = None) -> Scores:
    """The scores alone; arguments and errors as for `score`."""
    names = _methods(sequence, methods)
    frames = [i for i in sequence.frames if sequence.has_frame(i)]
    if not frames:
        raise InputError(f"{sequence.folder} has no frames yet: render some first")
    runs = {name: sequence.read_run(name) for name in names}
    judges = {name: Judge() for name in (INPUT, *names)}
    chosen = _chosen(sequence, frames)
    known: dict[int, _Known] = {}
    ground, after = None, {b: a for a, b in pairwise(sequence.frames)}
    for n, number in enumerate(frames):
        before = after.get(number)
        here = ground if n and frames[n - 1] == before else None
        ground, frame = read_ground(sequence, number, here)
        if ground.reference is not None:
            known[number] = _Known(ground.reference.spp, _floor(ground.reference))
        metrics = [name for name in METRICS if number in chosen[name]]
        judges[INPUT].see(number, before, frame["color"], ground, None, metrics)
        for name in names:
            if sequence.has_result(name, number):
                judges[name].see(number, before, sequence.read_result(name, number), ground,
                                 runs[name].ms.get(number), metrics)
        if progress:
            progress(n + 1, len(frames), "score")
    times = read_times(sequence.folder)
    methods_scored = {name: _summary(judge, cost(sequence, runs.get(name), times))
                      for name, judge in judges.items()}
    return _scores(sequence, frames, known, methods_scored)


def _chosen(sequence: Sequence, frames: list[int]) -> dict[str, list[int]]:
    """Metric -> the frames that it is measured on."""
    judged = [i for i in frames if sequence.has_reference(i)]
    return {row.name: spread(judged, row.most_frames) for row in METRICS.values()}


@dataclass(frozen=True)
class _Known:
    """What was read of a frame's reference."""

    spp: int
    floor: float | None


def _methods(sequence: Sequence, wanted: list[str] | None) -> list[str]:
    there = sequence.methods()
    if wanted is None:
        return there
    for name in wanted:
        if name not in there and name != INPUT:
            raise InputError(f"{sequence.folder} has no results of the method '{name}' "
                             f"(it has {', '.join(there) or 'none'}): run "
                             f"`onespp denoise {sequence.folder} --method {name}` first")
    return [name for name in dict.fromkeys(wanted) if name != INPUT]


def _floor(reference: Reference) -> float | None:
    """None where the variance isn't known (a reference of one sample, or from elsewhere)."""
    if not np.isfinite(reference.variance).any():
        return None
    return reference_floor(reference.color, reference.variance)


def _mean(values: Iterable[float | None]) -> float | None:
    """Mean of what was measured, None if nothing was."""
    measured = [v for v in values if v is not None]
    return fmean(measured) if measured else None


def _summary(judge: Judge, spent: dict[str, Any]) -> MethodScore:
    rows = judge.rows
    means: dict[str, Any] = {name: _mean(row[name] for row in rows) for name in MEASURES}
    return MethodScore(
        **spent, non_finite_pixels=sum(row.non_finite_pixels for row in rows),
        by_cause=judge.causes.scores(), by_history=judge.histories.scores(), per_frame=rows,
        **means)


def _scores(sequence: Sequence, frames: list[int], known: dict[int, _Known],
            methods: dict[str, MethodScore]) -> Scores:
    manifest = sequence.manifest
    floors = {frame: k.floor for frame, k in known.items() if k.floor is not None}
    return Scores(
        scene=manifest.scene, frames=frames, size=(manifest.width, manifest.height),
        seed=manifest.seed, spp=manifest.spp,
        reference_spp=min((k.spp for k in known.values()), default=None),
        reference_floor_db=_mean(floors.values()), reference_floor_per_frame=floors,
        tone_map=TONE_MAP, versions=manifest.versions, machine=manifest.machine,
        notes=list(_notes(manifest.frames, frames, known, methods)), methods=methods)


def _notes(wanted: tuple[int, ...], frames: list[int], known: dict[int, _Known],
           methods: dict[str, MethodScore]) -> Iterator[str]:
    """What a reader must know about the numbers, one sentence each."""
    if len(frames) < len(wanted):
        yield f"{len(frames)} of {len(wanted)} frames are rendered; the others are not scored."
    if not known:
        yield "There is no reference, so there is no error: only times and pictures."
    elif len(known) < len(frames):
        yield (f"{len(known)} of {len(frames)} frames have a reference; errors are means over "
               "these.")
    if len({k.spp for k in known.values()}) > 1:
        yield (f"References have {min(k.spp for k in known.values())} to "
               f"{max(k.spp for k in known.values())} samples a pixel.")
    timed = [name for name, method in methods.items() if method.interleaved]
    if timed:
        others = any(m.ms_per_frame for m in methods.values() if not m.interleaved)
        yield (f"Times of {', '.join(timed)} were measured in turns (`onespp time`)"
               + ("; the others are medians of their own runs, and compare less well." if others
                  else "."))
    for name, method in methods.items():
        if len(method.per_frame) < len(frames):
            yield (f"{name} has {len(method.per_frame)} of {len(frames)} frames; its numbers are "
                   "over these alone.")
        if method.non_finite_pixels:
            yield (f"{name} has {method.non_finite_pixels} non-finite pixels, which were scored "
                   "as black.")
