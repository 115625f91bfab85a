"""Where a method fails in its own way, found by measurement, and the picture of it.

Symbols: P(m, s, i) PSNR of method m on frame i of scene s, P(m, s) that of the scene (dB), E(m) the
error of one frame's display values, a value a pixel; M the mean of each over some methods.

    scene = argmin_s P(m, s) - M(s),   frame = argmin_i P(m, s, i) - M(s, i),
    place = the window with the largest sum of E(m) - M

What is hard for all methods alike is in M, so that what is left is this method's.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from pictures import beside_error, jpeg

from onespp.denoise.metrics.table import HEADLINE
from onespp.denoise.report.contact_sheets import display_errors
from onespp.denoise.score.scorecard import Scores
from onespp.render.files.sequence import FrameSequence

WINDOW = 48, 64  # height and width of what is shown, pixels
SCALE, SHOWN = 2, 9  # pixels for each: of the file; in width on the page, of all three


@dataclass(frozen=True)
class Failure:
    """The scene and the frame where a method is farthest behind the mean of some methods.

    Attributes:
        lead: dB over that mean on the scene. usual: the same, mean over all scenes.
        psnr, mean: dB of the frame, of the method and of that mean.
    """

    scene: str
    frame: int
    lead: float
    usual: float
    psnr: float
    mean: float


def find(scenes: Mapping[str, Scores], name: str, among: Iterable[str]) -> Failure:
    """Of the method `name`, which all scenes have scores of; the mean is over `among`."""
    among = list(among)

    def decibels(scores: Scores, method: str) -> float:
        return _number(scores.methods[method][HEADLINE.name])

    leads = {scene: decibels(scores, name) - _mean(decibels(scores, m) for m in among
                                                   if m in scores.methods)
             for scene, scores in scenes.items()}
    scene = min(leads, key=lambda s: (np.nan_to_num(leads[s], nan=np.inf)))
    frames = {m: {row.frame: _number(row[HEADLINE.name]) for row in score.per_frame}
              for m, score in scenes[scene].methods.items()}
    means = {i: _mean(frames[m].get(i, np.nan) for m in among if m in frames)
             for i in frames[name]}
    frame = min(means, key=lambda i: np.nan_to_num(frames[name][i] - means[i], nan=np.inf))
    return Failure(scene, frame, leads[scene], _mean(leads.values()), frames[name][frame],
                   means[frame])


def _number(value: float | None) -> float:
    """NaN for what the reference cannot tell."""
    return np.nan if value is None else value


def _mean(values: Iterable[float]) -> float:
    """Of those that are known."""
    known = [v for v in values if not np.isnan(v)]
    return float(np.mean(known)) if known else np.nan


def markdown(name: str, failure: Failure, about: str) -> str:
    """A sentence, and the picture below it. about: what the scene isolates."""
    text = (f"**`{name}`**, `{failure.scene}` ({about[0].lower()}{about[1:]}): "
            f"{_lead(failure.lead)} the mean of our methods, {_lead(failure.usual)} it over all "
            f"scenes. Frame {failure.frame}: {failure.psnr:.1f} dB, the mean "
            f"{failure.mean:.1f} dB.")
    picture = (f'<img src="failures/{name}.jpg" alt="{name} on {failure.scene}, the reference, and '
               f'the error" width="{SHOWN * WINDOW[1]}">')
    return f"{textwrap.fill(text, 100)}\n\n{picture}"


def _lead(decibels: float) -> str:
    return f"{abs(decibels):.1f} dB {'behind' if decibels < 0 else 'ahead of'}"


def picture(sequence: FrameSequence, name: str, frame: int, among: Iterable[str]) -> bytes:
    """JPEG file of the place where it fails: what it makes, the reference, and its error."""
    reference = sequence.read_reference(frame).color
    image, *others = (sequence.read_result(m, frame) for m in (name, *among)
                      if sequence.has_result(m, frame))
    own, *errors = display_errors([image, *others], reference)
    place = window(own - np.mean(errors, axis=0))
    return jpeg(beside_error([image[place], reference[place]], reference[place]), SCALE)


def window(image: np.ndarray) -> tuple[slice, slice]:
    """Where the sum of an (h, w) image is largest over a window; all of it if it is smaller."""
    height, width = np.minimum(WINDOW, image.shape)
    sums = np.lib.stride_tricks.sliding_window_view(image, (height, width)).sum(axis=(2, 3))
    y, x = np.unravel_index(np.argmax(sums), sums.shape)
    return slice(y, y + height), slice(x, x + width)
