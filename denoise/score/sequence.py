"""Scores a sequence: the input and every method present, against the reference.

Streams: two frames in a row of each method are in memory at a time. The number of a sequence is
the mean of its frames' (for PSNR too: not the PSNR of the pooled squared error, which the worst
frame would dominate); `means.py` says which frames count, and `estimate.py` what a frame is that is
too good for its reference.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean
from typing import Any

import numpy as np

from onespp.denoise.metrics.errors import PSNR_CAP
from onespp.denoise.metrics.estimate import BOUND, Number
from onespp.denoise.metrics.means import identical, mean_decibels, sequence_number
from onespp.denoise.metrics.metric import Metric
from onespp.denoise.metrics.noise_floor import reference_floor, seen_floors
from onespp.denoise.metrics.table import HEADLINE, MEASURES, METRICS
from onespp.denoise.metrics.tonemap import TONE_MAP
from onespp.denoise.own_method import result_name
from onespp.render.errors import InputError
from onespp.render.files.atomic import write_text
from onespp.render.files.frame_ranges import format_frames, spread
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.files.times import read_times
from onespp.render.progress import Progress, silent

from .bias_variance import check_seeds, split_errors
from .commands import commands
from .cost import cost
from .frame_truth import FrameTruth, read_frame_truth
from .method_score import INPUT, MethodScore
from .paired import PairedErrors
from .scorecard import OwnMetric, Scores, check_own
from .scorer import MethodScorer

MOST_LOST = 0.01
"""Share of a reference's pixels that may be non-finite; they count as no error in every image."""


def score(sequence: FrameSequence, methods: list[str] | None = None,
          progress: Progress = silent, seeds: list[FrameSequence] | None = None,
          command: str = "", metrics: Sequence[Metric] = ()) -> Scores:
    """Score a sequence, and write scores.json and scores.csv into its folder.

    Without a reference everything but the error is reported; a method with results for some
    frames only is scored on those, and a note says so.

    Args:
        methods: which to score beside the input; default: all that have results.
        progress: counts frames.
        seeds: renders of the same with other seeds, to split errors by (`bias_variance.py`).
        command: the command line, for scores.json.
        metrics: to measure beside those of the table (`metrics/own_metric.py`).

    Raises:
        InputError: an unknown method, a metric of a name that is taken, no frames, a file that
            cannot be read or written, or `seeds` that are of something else.
    """
    if seeds:  # before the minutes that scoring takes
        check_seeds([sequence, *seeds])
    scores = measure_sequence(sequence, methods, progress, metrics)
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
    return scores


def measure_sequence(sequence: FrameSequence, methods: list[str] | None = None,
                     progress: Progress = silent, own: Sequence[Metric] = ()) -> Scores:
    """The scores alone; arguments and errors as for `score`."""
    check_own(own)
    names = _methods(sequence, methods)
    frames = [i for i in sequence.frames if sequence.has_frame(i)]
    if not frames:
        raise InputError(f"{sequence.folder} has no frames yet: render some first")
    runs = {name: sequence.read_run(name) for name in names}
    scorers = {name: MethodScorer(own) for name in (INPUT, *names)}
    chosen = _chosen(sequence, frames, own)
    known: dict[int, _Known] = {}
    paired = PairedErrors()
    ground, after = None, {b: a for a, b in pairwise(sequence.frames)}
    for n, number in enumerate(frames):
        before = after.get(number)
        here = ground if n and frames[n - 1] == before else None
        ground, frame = read_frame_truth(sequence, number, here)
        if ground.reference is not None:
            known[number] = _known(sequence, number, ground, number in chosen["flip"])
        metrics = [name for name in chosen if number in chosen[name]]
        seen = [INPUT]
        scorers[INPUT].see(number, before, frame["color"], ground, None, metrics)
        for name in names:
            if sequence.has_result(name, number):
                scorers[name].see(number, before, sequence.read_result(name, number), ground,
                                 runs[name].ms.get(number), metrics)
                seen.append(name)
        paired.add({name: e for name in seen if (e := scorers[name].headline) is not None})
        progress(n + 1, len(frames), "score")
    times = read_times(sequence.folder)
    methods_scored = {name: _summary(judge, scorers[INPUT], cost(sequence, runs.get(name), times))
                      for name, judge in scorers.items()}
    return _scores(sequence, frames, known, methods_scored, paired.errors(), own)


def _chosen(sequence: FrameSequence, frames: list[int],
            own: Iterable[Metric]) -> dict[str, list[int]]:
    """Metric -> the frames that it is measured on."""
    judged = [i for i in frames if sequence.has_reference(i)]
    return {row.name: spread(judged, row.most_frames) for row in (*METRICS.values(), *own)}


@dataclass(frozen=True)
class _Known:
    """What was read of a frame's reference; what is not known, or not measured, is None."""

    spp: int | None
    floor: float | None
    non_finite_pixels: int
    halves: bool
    flip_floor: float | None = None
    ssim_floor: float | None = None


def _methods(sequence: FrameSequence, wanted: list[str] | None) -> list[str]:
    there = sequence.methods()
    if wanted is None:
        return there
    for name in wanted:
        if result_name(name) not in there and name != INPUT:
            raise InputError(f"{sequence.folder} has no results of the method '{name}' "
                             f"(it has {', '.join(there) or 'none'}): run "
                             f"`onespp denoise {sequence.folder} --method {name}` first")
    return [name for name in dict.fromkeys(map(result_name, wanted)) if name != INPUT]


def _known(sequence: FrameSequence, number: int, ground: FrameTruth, seen: bool) -> _Known:
    """Of a frame that has a reference. seen: whether its floors of FLIP and SSIM are wanted.

    Raises:
        InputError: so much of it is not finite that the rest says little.
    """
    reference, target = ground.reference, ground.target
    assert reference is not None
    assert target is not None
    lost = int(target.unknown.sum())
    if lost > MOST_LOST * target.unknown.size:
        raise InputError(f"the reference of frame {number} in {sequence.folder} has {lost} of "
                         f"{target.unknown.size} pixels that are not finite: make it "
                         "again, or delete it and the frame is not judged")
    halves = reference.parts is not None
    floors = seen_floors(target.parts) if seen and target.parts is not None else (None, None)
    return _Known(reference.spp, _floor(reference), lost, halves, *floors)


def _floor(reference: Reference) -> float | None:
    """None where the variance isn't known (a reference of one sample, or from elsewhere)."""
    if not np.isfinite(reference.variance).any():
        return None
    return reference_floor(reference.color, reference.variance)


def _summary(judge: MethodScorer, unfiltered: MethodScorer, spent: dict[str, Any]) -> MethodScore:
    """`unfiltered`: the judge of the input."""
    rows = judge.rows
    numbers: dict[str, Number] = {}
    measures = {**MEASURES, **judge.own}
    for name, row in measures.items():
        untouched = identical(row, {r.frame: r[name] for r in unfiltered.rows})
        found = sequence_number(row, {r.frame: r[name] for r in rows},
                                judge.estimates.get(name, {}), untouched)
        if found is not None:
            numbers[name] = found
    values: dict[str, Any] = {name: numbers[name].value if name in numbers else None
                              for name in measures}
    return MethodScore(
        **spent, non_finite_pixels=sum(row.non_finite_pixels for row in rows),
        identical_frames=identical(HEADLINE, {r.frame: r[HEADLINE.name] for r in rows}),
        by_cause=judge.causes.scores(), by_history=judge.histories.scores(), per_frame=rows,
        errors={name: n.error for name, n in numbers.items() if n.error is not None},
        bounds=[name for name, n in numbers.items() if n.bound],
        **values)


def _scores(sequence: FrameSequence, frames: list[int], known: dict[int, _Known],
            methods: dict[str, MethodScore], paired: dict[str, dict[str, float]],
            own: Iterable[Metric]) -> Scores:
    manifest = sequence.manifest
    floors = {frame: k.floor for frame, k in known.items() if k.floor is not None}
    return Scores(
        scene=manifest.scene, frames=frames, size=(manifest.width, manifest.height),
        seed=manifest.seed, spp=manifest.spp,
        reference_spp=min((k.spp for k in known.values() if k.spp), default=None),
        reference_floor_db=mean_decibels(floors.values()) if floors else None,
        reference_floor_per_frame=floors,
        reference_non_finite_pixels=sum(k.non_finite_pixels for k in known.values()),
        reference_halves=bool(known) and all(k.halves for k in known.values()),
        flip_floor=_mean(k.flip_floor for k in known.values()),
        ssim_floor=_mean(k.ssim_floor for k in known.values()), paired_errors=paired,
        tone_map=TONE_MAP, versions=manifest.versions, machine=manifest.machine,
        notes=list(_notes(manifest.frames, frames, known, methods)), methods=methods,
        own_metrics={row.name: OwnMetric.of(row) for row in own})


def _mean(values: Iterable[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return fmean(known) if known else None


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
    samples = {k.spp for k in known.values() if k.spp}
    if len(samples) > 1:
        yield f"References have {min(samples)} to {max(samples)} samples a pixel."
    halved = sum(k.halves for k in known.values())
    if known and not halved:
        yield ("References have no halves: every error has their noise in it, and no PSNR can "
               "exceed their noise floor.")
    elif halved < len(known):
        yield (f"{halved} of {len(known)} references have halves; on the others every error has "
               "their noise in it.")
    holes = {i: k.non_finite_pixels for i, k in known.items() if k.non_finite_pixels}
    if holes:
        yield (f"References have {sum(holes.values())} pixels that are not finite "
               f"(frames {format_frames(holes)}), which were not judged: black in both images.")
    yield from _notes_on_identical(methods)
    timed = [name for name, method in methods.items() if method.interleaved]
    if timed:
        others = any(m.ms_per_frame for m in methods.values() if not m.interleaved)
        yield (f"Times of {', '.join(timed)} were measured in turns (`onespp time`)"
               + ("; the others are medians of their own runs, and compare less well." if others
                  else "."))
    for name, method in methods.items():
        if method.changed:
            yield (f"{name} ran with "
                   + ", ".join(f"{k}={v}" for k, v in method.changed.items())
                   + " instead of the default.")
        if len(method.per_frame) < len(frames):
            yield (f"{name} has {len(method.per_frame)} of {len(frames)} frames; its numbers are "
                   "over these alone.")
        if method.bounds:
            yield (f"{', '.join(MEASURES[m].label for m in method.bounds)} of {name}: beyond what "
                   "the reference can tell; the number is a bound of "
                   f"{BOUND:g} standard errors.")
        if method.non_finite_pixels:
            yield (f"{name} has {method.non_finite_pixels} non-finite pixels, which were scored "
                   "as black.")


def _notes_on_identical(methods: dict[str, MethodScore]) -> Iterator[str]:
    """Which frames `means.py` leaves out."""
    untouched = methods[INPUT].identical_frames
    if untouched:
        off = {name: min(values) for name, method in methods.items()
               if (values := [db for row in method.per_frame if row.frame in untouched
                              and (db := row[HEADLINE.name]) is not None and db < PSNR_CAP])}
        yield (f"The input is identical to the reference on {_frames(untouched)}: means in dB are "
               "without" + (", though " + ", ".join(
                   f"{name} has {db:.1f} {HEADLINE.unit} there" for name, db in off.items())
                   if off else "") + ".")
    for name, method in methods.items():
        own = [i for i in method.identical_frames if i not in untouched]
        if own:
            yield (f"{name} is identical to the reference on {_frames(own)}: its means in dB are "
                   "without.")


def _frames(numbers: list[int]) -> str:
    return f"{len(numbers)} frame{'s' * (len(numbers) > 1)} ({format_frames(numbers)})"
