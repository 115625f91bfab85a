"""Scores a sequence: the input and every method present, against the reference.

Streams: one frame of one method is in memory at a time, next to its reference. The number of a
sequence is the mean of its frames' (for PSNR too: not the PSNR of the pooled squared error, which
the worst frame would dominate).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from statistics import fmean, median

import numpy as np

from render.atomic import write_text
from render.errors import InputError
from render.manifest import Run
from render.sequence import Reference, Sequence

from .metrics import METRICS, measure, non_finite, reference_floor
from .pictures import Progress, draw_pictures
from .scorecard import INPUT, FrameScore, MethodScore, Scores
from .tonemap import TONE_MAP


def score(sequence: Sequence, methods: list[str] | None = None, pictures: bool = True,
          progress: Progress | None = None) -> Scores:
    """Score a sequence, and write scores.json, scores.csv and `pictures/` into its folder.

    Without a reference everything but the error is reported; a method with results for some
    frames only is scored on those, and a note says so. Scores are written before pictures.

    Args:
        methods: which to score beside the input; default: all that have results.
        pictures: also draw contact sheets, the movie and the plot.
        progress: called with (done, total, what).

    Raises:
        InputError: an unknown method, no frames, or a file that cannot be read or written.
    """
    scores = measure_sequence(sequence, methods, progress)
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
    rows: dict[str, list[FrameScore]] = {name: [] for name in (INPUT, *names)}
    known: dict[int, _Known] = {}
    for n, frame in enumerate(frames):
        reference = None
        if sequence.has_reference(frame):
            reference = sequence.read_reference(frame)
            known[frame] = _Known(reference.spp, _floor(reference))
        truth = reference and reference.color
        color = sequence.read_frame(frame, ("color",))["color"]
        rows[INPUT].append(_score_frame(frame, color, truth, None))
        for name in names:
            if sequence.has_result(name, frame):
                rows[name].append(_score_frame(frame, sequence.read_result(name, frame), truth,
                                               runs[name].ms.get(frame)))
        if progress:
            progress(n + 1, len(frames), "score")
    methods_scored = {name: _summary(rows[name], runs.get(name)) for name in rows}
    return _scores(sequence, frames, known, methods_scored)


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


def _score_frame(frame: int, image: np.ndarray, reference: np.ndarray | None,
                 ms: float | None) -> FrameScore:
    values: dict[str, float | None] = dict.fromkeys(METRICS)
    bad = int(non_finite(image).sum())
    if reference is not None:
        values.update(measure(image, reference))
    return FrameScore(frame=frame, ms=ms, non_finite_pixels=bad, **values)  # pyright: ignore


def _floor(reference: Reference) -> float | None:
    """None where the variance isn't known (a reference of one sample, or from elsewhere)."""
    if not np.isfinite(reference.variance).any():
        return None
    return reference_floor(reference.color, reference.variance)


def _mean(values: Iterable[float | None]) -> float | None:
    """Mean of what was measured, None if nothing was."""
    measured = [v for v in values if v is not None]
    return fmean(measured) if measured else None


def _summary(rows: list[FrameScore], run: Run | None) -> MethodScore:
    """Means over frames; the time leaves out the first frame, in which kernels compile."""
    warm = [row.ms for row in rows[1:] if row.ms is not None]
    run = run or Run(method=INPUT)
    return MethodScore(
        ms_per_frame=median(warm) if warm else None, first_ms=run.first_ms,
        non_finite_pixels=sum(row.non_finite_pixels for row in rows),
        device=run.device, threads=run.threads, parameters=run.parameters, versions=run.versions,
        per_frame=rows,
        **{name: _mean(row[name] for row in rows) for name in METRICS})  # pyright: ignore


def _scores(sequence: Sequence, frames: list[int], known: dict[int, _Known],
            methods: dict[str, MethodScore]) -> Scores:
    manifest = sequence.manifest
    floors = {frame: k.floor for frame, k in known.items() if k.floor is not None}
    return Scores(
        scene=manifest.scene, frames=frames, size=(manifest.width, manifest.height),
        seed=manifest.seed, spp=manifest.spp,
        reference_spp=min((k.spp for k in known.values()), default=None),
        reference_floor_db=_mean(floors.values()), reference_floor_per_frame=floors,
        tone_map=TONE_MAP, versions=manifest.versions,
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
    for name, method in methods.items():
        if len(method.per_frame) < len(frames):
            yield (f"{name} has {len(method.per_frame)} of {len(frames)} frames; its numbers are "
                   "over these alone.")
        if method.non_finite_pixels:
            yield (f"{name} has {method.non_finite_pixels} non-finite pixels, which were scored "
                   "as black.")
