"""Do frames fit each other: is the surface of each pixel found where the frame before had it?

By the rule that scores go by (`geometry/correspondence.py`): the same object, a normal and a plane
near to those expected. Of what is carried by a channel `motion` it is also tried whether another
reading of it would find more, so that a flipped axis or a swapped direction is named.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import fmean

import numpy as np

from onespp.denoise.geometry.correspondence import GUIDES, NOWHERE, has_surface, previous_pixel
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.frame import Frame
from onespp.render.progress import Progress, silent

MOST_PAIRS = 8
GOOD = 0.9
_MOVED = 1.0  # pixels: less tells no reading from another
_FEWER_MISSES = 0.8  # of what is not found, for another reading to be the right one
_LEAST_GAIN = 0.05
_AS_GOOD = 0.01  # of what moves: no more tells one reading from another

AS_IT_IS = "as it is"
EXCHANGED = "x and y exchanged"
_SIGNS = {
    "its y turned over (the other --motion-y)": (1, -1),
    "its direction turned round (--motion previous, or without it where it was given)": (-1, -1),
    "its x turned over (both, the other --motion-y and the other --motion)": (-1, 1),
}
_RIGHTED: Mapping[str, Callable[[Frame], Frame]] = {
    **{name: lambda frame, signs=signs: _with(frame, frame["motion"] * np.array(signs, np.float32))
       for name, signs in _SIGNS.items()},
    "none of it, by matrices alone (--channel motion=none)": lambda frame: replace(frame, images={
        k: v for k, v in frame.images.items() if k != "motion"}),
    EXCHANGED: lambda frame: _with(frame, frame["motion"][..., ::-1]),
}
"""In the order in which they are believed where they explain as much: what no option does last."""


@dataclass(frozen=True)
class Agreement:
    """Shares of pixels whose surface the frame before has where it should be.

    Attributes:
        found: (frame, share of the pixels that show a surface).
        readings: way to read `motion` -> share of those in all frames that move by more than a
            pixel; empty where none do.
    """

    found: list[tuple[int, float]]
    readings: dict[str, float]

    @property
    def share(self) -> float:
        """Over all frames."""
        return fmean(share for _, share in self.found)

    @property
    def better(self) -> str | None:
        """The reading of motion by which far more is found; None where it is read rightly."""
        if not self.readings:
            return None
        most = max(self.readings.values())
        best = next(name for name, share in self.readings.items() if share >= most - _AS_GOOD)
        now, then = 1 - self.readings[AS_IT_IS], 1 - self.readings[best]
        return best if now - then > _LEAST_GAIN and then < _FEWER_MISSES * now else None


def agreement(sequence: FrameSequence, progress: Progress = silent) -> Agreement:
    """Of up to `MOST_PAIRS` frames, spread over the sequence, each with the one before it.

    Raises:
        InputError: fewer than two frames, frames without guides, or no surface in any.
    """
    numbers = [i for i in sequence.frames if sequence.has_frame(i)]
    if len(numbers) < 2:
        raise InputError(f"{sequence.folder} has {len(numbers)} frames: two are needed to see "
                         "whether one leads to the next")
    if lacking := [name for name in GUIDES if name not in sequence.channels]:
        raise InputError(f"{sequence.folder} lacks the channel {lacking[0]}, by which surfaces are "
                         "found again")
    names = [name for name in (*GUIDES, "motion") if name in sequence.channels]
    pairs = list(pairwise(numbers))
    pairs = pairs[::-(-len(pairs) // MOST_PAIRS)]
    found: list[tuple[int, float]] = []
    moved_found: dict[str, list[np.ndarray]] = {name: [] for name in (AS_IT_IS, *_RIGHTED)}
    for done, (a, b) in enumerate(pairs, 1):
        before, now = (sequence.read_frame(i, names) for i in (a, b))
        shown, there = has_surface(now), previous_pixel(before, now) != NOWHERE
        if shown.any():
            found.append((b, float(there[shown].mean())))
        if "motion" in names:
            moved = shown & (np.abs(now["motion"]).max(-1) > _MOVED)
            moved_found[AS_IT_IS].append(there[moved])
            for name, righted in _RIGHTED.items():
                moved_found[name].append(previous_pixel(before, righted(now))[moved] != NOWHERE)
        progress(done, len(pairs), f"check {sequence.folder.name}")
    if not found:
        raise InputError(f"{sequence.folder} shows no surface: every pixel has ID -1, no depth or "
                         "no normal")
    counted = {name: np.concatenate(parts) for name, parts in moved_found.items() if parts}
    return Agreement(found, {name: float(all_.mean()) for name, all_ in counted.items()
                             if all_.size})


def _with(frame: Frame, motion: np.ndarray) -> Frame:
    return replace(frame, images={**frame.images, "motion": motion})
