"""Parameters by measurement: a coordinate search for the best mean PSNR over given sequences.

The PSNR is the headline of the scores: by halves where references have them, so that their noise,
which a filter can no more remove than it can fit, has no part in the choice.

Each parameter in turn is tried a step up and down (numbers above 0 by a factor, whole numbers by 1,
switches turned over); a better value is kept. When a round brings nothing, the factor gets smaller.
It is a local search of a noisy function: what it finds is a default, not an optimum. Tune on other
frames and seeds than those that are reported.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

from onespp.denoise.catalog import (
    Method,
    channels_read,
    configured,
    name_of,
    parameters,
    source_of,
)
from onespp.denoise.methods.parameters import present_parameters
from onespp.denoise.metrics.errors import psnr
from onespp.denoise.metrics.estimate import number
from onespp.denoise.metrics.image import Target, display_error, pair
from onespp.denoise.metrics.means import mean_decibels
from onespp.render.errors import InputError
from onespp.render.files.atomic import read_bytes, write_text
from onespp.render.files.sequence import FrameSequence
from onespp.render.frame import Frame
from onespp.render.progress import Progress, silent

FACTORS = (2.0, 1.4, 1.15)
LEAST_GAIN = 0.003  # dB; less is not worth another number

Settings = dict[str, bool | int | float]


@dataclass(frozen=True)
class Case:
    """A sequence in memory: frames, and what they are judged against."""

    name: str
    frames: list[Frame]
    targets: list[Target]


def read_case(sequence: FrameSequence, method: Method) -> Case:
    """The frames that have a reference.

    Raises:
        InputError: there is none, or a frame lacks what the method needs.
    """
    numbers = [i for i in sequence.frames if sequence.has_frame(i) and sequence.has_reference(i)]
    if not numbers:
        raise InputError(f"{sequence.folder} has no reference to tune on: "
                         "render one with --reference-spp")
    channels = channels_read(method, sequence.channels)
    return Case(sequence.folder.name,
                [sequence.read_frame(i, list(channels)) for i in numbers],
                [Target(r.color, r.parts) for r in map(sequence.read_reference, numbers)])


def mean_psnr(method: Method, cases: list[Case]) -> float:
    """dB on clipped sRGB: mean over the frames of a case, then over cases."""
    means = []
    for case in cases:
        state, images = method.init(case.frames[0].height, case.frames[0].width), []
        for frame, target in zip(case.frames, case.targets):
            image, state = method(frame, state)
            images.append(pair(image, target))
        squares = [e.without_noise() for e in map(display_error, images) if e is not None]
        if len(squares) == len(images):
            means.append(number("dB", squares).value)
        else:  # references of an older version among them: all against the mean
            means.append(mean_decibels([psnr(*i.srgb) for i in images]))
    return fmean(means)


def neighbours(value: Any, factor: float) -> Iterator[Any]:
    """Values a step away."""
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield from (value + 1, value - 1)
    elif isinstance(value, float) and value > 0:
        yield from (float(f"{value * factor:.3g}"), float(f"{value / factor:.3g}"))


class Search:
    """The search, and all that it has tried, which it can go on from.

    Attributes:
        tried: settings as JSON -> dB. expected: how many trials a search without gain takes.
    """

    def __init__(self, method: Method, cases: list[Case], file: Path | None = None,
                 progress: Progress = silent) -> None:
        self.method, self.cases, self.file, self.progress = method, cases, file, progress
        self.name, self.source = name_of(method) or type(method).__name__, source_of(method)
        self.expected = 1
        self.start = starting_point(method)
        self.tried: dict[str, float] = _read(file) if file and file.exists() else {}

    def run(self, names: list[str], factors: tuple[float, ...] = FACTORS
            ) -> tuple[Settings, float]:
        """The best settings found, and their dB."""
        self.expected = 2 * len(names) * len(factors)  # trials; a round that gains adds more
        best = dict(self.start)
        value = self.value(best)
        for factor in factors:
            gained = True
            while gained:
                gained = False
                for name in names:
                    for candidate in neighbours(best[name], factor):
                        other = self.try_value({**best, name: candidate})
                        if other is not None and other > value + LEAST_GAIN:
                            best, value, gained = {**best, name: candidate}, other, True
                            break
        return best, value

    def try_value(self, settings: Settings) -> float | None:
        """dB of settings; None for those that the method refuses."""
        try:
            return self.value(settings)
        except InputError:
            return None

    def value(self, settings: Settings) -> float:
        source = {"source": self.source} if self.source else {}  # another file, other values
        key = json.dumps({**settings, **source}, sort_keys=True)
        if key not in self.tried:
            method = configured(self.method, {k: str(v) for k, v in settings.items()})
            self.tried[key] = mean_psnr(method, self.cases)
            if self.file:
                write_text(self.file, json.dumps(self.tried, indent=1) + "\n")
        self.progress(min(len(self.tried), self.expected), self.expected, f"tune {self.name}",
                      f"{max(self.tried.values()):.2f} dB")
        return self.tried[key]


def starting_point(method: Method) -> Settings:
    """The parameters of a method that can be searched: all but texts."""
    return {k: v for k, v in parameters(method).items() if not isinstance(v, str)}


def _read(file: Path) -> dict[str, float]:
    data = read_bytes(file)
    try:
        tried = json.loads(data)
        return {json.dumps(present_parameters(json.loads(key)), sort_keys=True): float(value)
                for key, value in tried.items()}
    except (ValueError, AttributeError, TypeError, RecursionError) as error:
        raise InputError(f"{file} does not hold an earlier search ({error}): "
                         "remove it, or give another --out") from error
