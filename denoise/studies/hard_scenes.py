"""Every method on hard scenes: what its history gains or costs, and how soon it recovers.

The yardstick of a method is its own history-free form: the same method, told for each frame that
there was none before. A frame is as good as that one if its PSNR is at most `MARGIN` dB below.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from onespp.denoise.catalog import METHODS, Method
from onespp.denoise.metrics.errors import psnr
from onespp.denoise.metrics.estimate import number
from onespp.denoise.metrics.image import Pair, Target, display_error, non_finite, pair
from onespp.denoise.own_method import OwnMethod
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.frame import Frame
from onespp.render.progress import Progress, silent

MARGIN = 0.3          # dB
ENERGY_MARGIN = 0.02  # of the reference's mean
INPUT = "input"


@dataclass(frozen=True)
class Row:
    """One method on one scene.

    Attributes:
        psnr, alone: dB of each frame (`metrics.HEADLINE`), as it is and history-free.
        event: index of the frame at which everything changes at once, or None.
        energy: mean of its output over mean of the reference, all frames together.
        bad_pixels: non-finite ones, all frames together.
        diffuse: whether the scene has nothing but diffuse surfaces.
    """

    scene: str
    method: str
    psnr: tuple[float, ...]
    alone: tuple[float, ...]
    event: int | None
    energy: float
    bad_pixels: int
    diffuse: bool

    @property
    def gain(self) -> float:
        """dB over the history-free form, mean over frames."""
        return float(np.mean(self.psnr) - np.mean(self.alone))

    @property
    def worst(self) -> float:
        """The least of the gains of the frames."""
        return float(np.min(np.subtract(self.psnr, self.alone)))

    @property
    def recovery(self) -> int | None:
        """Frames after the event until it is as good as history-free for good; 0: at once."""
        if self.event is None:
            return None
        lost = np.flatnonzero(np.subtract(self.psnr, self.alone)[self.event:] < -MARGIN)
        return int(lost[-1]) + 1 if lost.size else 0

    @property
    def recovered(self) -> bool:
        """Whether it was as good again before the scene ended."""
        return self.event is None or (self.recovery or 0) < len(self.psnr) - self.event


def judge(folder: FrameSequence, scene: str, event: int | None, diffuse: bool,
          progress: Progress = silent, methods: Mapping[str, Method] | None = None) -> list[Row]:
    """Rows of the input and of each method, which `progress` counts, for a rendered sequence.

    Args:
        methods: what to call it -> method; default every one of `METHODS`.

    Raises:
        InputError: a frame or a reference is missing, or a channel that a method needs.
    """
    missing = [i for i in folder.frames if not (folder.has_frame(i) and folder.has_reference(i))]
    if missing:
        raise InputError(f"{folder.folder} lacks frame or reference {missing[0]}: render them with "
                         "--reference-spp")
    frames = [folder.read_frame(i) for i in folder.frames]
    truth = [Target(t.color, t.parts) for t in map(folder.read_reference, folder.frames)]
    rows = []
    judged = {name: make() for name, make in METHODS.items()} if methods is None else methods
    for done, (name, method) in enumerate({INPUT: None, **judged}.items(), 1):
        images, alone = _denoised(method, frames)
        psnr, yardstick = _decibels(images, truth), _decibels(alone, truth)
        energy = float(np.mean(images, dtype=np.float64)
                       / np.mean([t.linear for t in truth], dtype=np.float64))
        bad = sum(int(non_finite(image).sum()) for image in images)
        rows.append(Row(scene, name, psnr, yardstick, event, energy, bad, diffuse))
        progress(done, len(judged) + 1, f"judge {scene}")
    return rows


def _denoised(method: Method | None, frames: Sequence[Frame]
              ) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Images of a method (None: the input) with its history, and without."""
    if method is None:
        images = [frame["color"] for frame in frames]
        return images, images
    size = frames[0].height, frames[0].width
    whole = run(method, frames, method.init(*size))
    if isinstance(method, OwnMethod):  # whose state may be written to, and must be new each time
        return whole, [method(frame, method.init(*size))[0] for frame in frames]
    return whole, run_alone(method, frames, method.init(*size))


def run(method: Method, frames: Iterable[Frame], state: object) -> list[np.ndarray]:
    """A method's images of one frame after another."""
    images = []
    for frame in frames:
        image, state = method(frame, state)
        images.append(image)
    return images


def run_alone(method: Method, frames: Iterable[Frame], state: object) -> list[np.ndarray]:
    """A method's images of frames that each come first; `state` is one before any frame."""
    return [method(frame, state)[0] for frame in frames]


def _decibels(images: Sequence[np.ndarray], truth: Sequence[Target]) -> tuple[float, ...]:
    return tuple(_psnr(pair(image, target)) for image, target in zip(images, truth))


def _psnr(images: Pair) -> float:
    """By halves of the reference where it has them; a bound where these cannot tell it from 0."""
    estimate = None if images.same else display_error(images)
    return psnr(*images.srgb) if estimate is None else number("dB", [estimate]).value


def misses(rows: Iterable[Row]) -> dict[str, list[str]]:
    """Method and promise -> the scenes on which it is broken, each with its number."""
    found: dict[str, list[str]] = {}
    for row in rows:
        off = row.diffuse and row.method != INPUT and abs(row.energy - 1) > ENERGY_MARGIN
        for broken, promise, figure in (
                (row.bad_pixels, "pixels that are not finite", f"{row.bad_pixels}"),
                (row.gain < -MARGIN, f"more than {MARGIN} dB worse than its history-free form",
                 f"{row.gain:+.1f}"),
                (not row.recovered, "not recovered from a change when the scene ends",
                 f"{row.recovery} frames"),
                (off, f"energy off by more than {ENERGY_MARGIN:.0%} where all is diffuse"
                 .replace("%", " %"), f"{row.energy:.3f}")):
            if broken:
                found.setdefault(f"{row.method}: {promise}", []).append(f"{row.scene} ({figure})")
    return found


def markdown(rows: Sequence[Row]) -> str:
    """Tables of scenes (rows) by methods (columns), and a list of the misses."""
    parts = []
    for title, cell, wanted in (
            ("PSNR, dB (mean over frames)", lambda r: f"{np.mean(r.psnr):.2f}", rows),
            ("Gain over its own history-free form, dB: mean (worst frame)", _gain, rows),
            ("Frames to recover after a change", _recovery,
             [r for r in rows if r.event is not None]),
            ("Energy: mean of the output over mean of the reference", lambda r: f"{r.energy:.3f}",
             rows)):
        parts.append(_table(title, wanted, cell))
    broken = misses(rows)
    parts.append("\n".join(f"- {promise}: {', '.join(scenes)}"
                           for promise, scenes in sorted(broken.items())) or "Nothing is missed.")
    return "\n\n".join(parts)


def _gain(row: Row) -> str:
    return "" if row.psnr == row.alone else f"{row.gain:+.1f} ({row.worst:+.1f})"


def _recovery(row: Row) -> str:
    return "" if row.psnr == row.alone else f"{'' if row.recovered else '> '}{row.recovery}"


def _table(title: str, rows: Sequence[Row], cell: Callable[[Row], str]) -> str:
    cells = {(row.scene, row.method): cell(row) for row in rows}
    scenes = list(dict.fromkeys(row.scene for row in rows))
    methods = [m for m in dict.fromkeys(row.method for row in rows)
               if any(cells[scene, m] for scene in scenes)]
    lines = [f"| {title} | {' | '.join(methods)} |", "| --- |" + " --- |" * len(methods)]
    lines += [f"| {s} | {' | '.join(cells[s, m] for m in methods)} |" for s in scenes]
    return "\n".join(lines)
