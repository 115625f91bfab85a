"""What each part of a method is worth, as a Markdown table.

A part is a parameter that is true or false; each row turns one of them to what it is not by
default. Nothing is written: frames are denoised in memory, all variants side by side.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from onespp.denoise.catalog import Method, build, channels_read, configured, parameters
from onespp.denoise.metrics.means import mean_over_frames
from onespp.denoise.metrics.table import MEASURES
from onespp.denoise.score.frame_truth import read_frame_truth
from onespp.denoise.score.scorer import MethodScorer
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.progress import Progress, silent

COLUMNS = ("psnr_srgb", "flip", "flicker")
WHOLE = "as it is"


@dataclass(frozen=True)
class Variant:
    """A method with one part changed: mean of each measure over the frames of a sequence."""

    name: str
    means: dict[str, float | None]


def variants(name: str) -> dict[str, Method]:
    """What to call it -> method: the method as it is, then with each part turned over.

    Raises:
        InputError: no such method, or none of its parameters is true or false.
    """
    whole = build(name)
    parts = {k: v for k, v in parameters(whole).items() if isinstance(v, bool)}
    if not parts:
        raise InputError(f"the method '{name}' has no parts to switch off")
    return {WHOLE: whole, **{f"{'without' if on else 'with'} {part}":
                             configured(whole, {part: str(not on)}) for part, on in parts.items()}}


def ablate(sequence: FrameSequence, methods: dict[str, Method],
           progress: Progress = silent) -> list[Variant]:
    """Denoise and judge the frames that have a reference; `progress` counts frames.

    Raises:
        InputError: the sequence has no reference, or a frame lacks what a method needs.
    """
    frames = [i for i in sequence.frames if sequence.has_frame(i)]
    if not any(map(sequence.has_reference, frames)):
        raise InputError(f"{sequence.folder} has no reference to compare with: "
                         "render one with --reference-spp")
    scorers = {name: MethodScorer() for name in methods}
    states: dict[str, Any] = {name: m.init(*sequence.size) for name, m in methods.items()}
    channels = dict.fromkeys(c for m in methods.values()
                             for c in channels_read(m, sequence.channels))
    before, ground = {b: a for a, b in pairwise(sequence.frames)}, None
    for done, number in enumerate(frames):
        last = ground if done and frames[done - 1] == before.get(number) else None
        ground, _ = read_frame_truth(sequence, number, last)
        frame = sequence.read_frame(number, list(channels))
        for name, method in methods.items():
            image, states[name] = method(frame, states[name])
            scorers[name].see(number, before.get(number), image, ground, None, COLUMNS[:2])
        progress(done + 1, len(frames), f"ablate {sequence.folder.name}")
    return [Variant(name, {c: mean_over_frames(MEASURES[c], {row.frame: row[c]
                                                            for row in judge.rows})
                           for c in COLUMNS})
            for name, judge in scorers.items()]


def markdown(method: str, results: dict[str, list[Variant]]) -> str:
    """The table; results: title of a sequence -> its variants. Differences are to the first row."""
    heads = [f"{title} {MEASURES[c].label}" for title in results for c in COLUMNS]
    lines = ["| " + " | ".join([f"`{method}`", *heads]) + " |",
             "| " + " | ".join(["---"] * (1 + len(heads))) + " |"]
    for row in zip(*results.values()):
        cells = [_cell(c, variant.means[c], rows[0].means[c])
                 for variant, rows in zip(row, results.values()) for c in COLUMNS]
        lines.append("| " + " | ".join([row[0].name, *cells]) + " |")
    return "\n".join(lines)


def _cell(column: str, value: float | None, whole: float | None) -> str:
    if value is None or whole is None:
        return "-"
    text = format(value, MEASURES[column].format)
    return text if column != COLUMNS[0] or value == whole else f"{text} ({value - whole:+.2f})"
