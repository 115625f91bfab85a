"""Clips a second: by one process and by several, beside files that are only decoded.

Processes are fresh ones that read at the same time: each opens the data set, reads a clip, and
waits for a moment that all have. "Decoded" are the frames of a clip with the channels that it
needs, and their references; the rest of a clip's time is its motion, its cut and its turn.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from onespp.datasets.folder import DataSet
from onespp.datasets.processes import CallFailed, calls
from onespp.render.errors import InputError

from .clips import MOTION, Clips
from .store import REFERENCE, Store


@dataclass(frozen=True)
class Speed:
    """Clips a second of all processes together; decoded: of their files alone."""

    processes: int
    decoded: float
    clips: float


def speeds(folder: Path | str, processes: Sequence[int] = (1, 2, 4), seconds: float = 5.0,
           look: Callable[[], None] = lambda: None, **options: Any) -> list[Speed]:
    """The speeds of some numbers of processes.

    Args:
        seconds: that each of them reads, files alone and clips.
        options: of `Clips`.

    Raises:
        InputError: no data set, or what it does not have.
    """
    Clips(folder, **options)  # what it does not have is told here
    if not (0 < seconds <= 3600 and all(1 <= count <= 256 for count in processes)):
        raise InputError("read for more than 0 and at most 3600 seconds, by 1 to 256 processes")
    started = time.monotonic()
    _rate(folder, options, "clips", 1, 0.0, 0.0, look)
    start = time.monotonic() - started
    return [Speed(count, *(_rate(folder, options, kind, count, seconds, start * (1 + count), look)
                           for kind in ("decoded", "clips")))
            for count in processes]


def _rate(folder: Path | str, options: dict[str, Any], kind: str, count: int, seconds: float,
          start: float, look: Callable[[], None]) -> float:
    """Clips a second of `count` processes, which need `start` seconds to be ready."""
    begin = time.time() + start
    total = 0.0
    for _, found in calls(f"{__name__}:read", [
            (str(folder), options, kind, k, count, begin, seconds) for k in range(count)], count,
            look):
        if isinstance(found, CallFailed):
            raise found
        total += found
    return total


def read(folder: str, options: dict[str, Any], kind: str, first: int, step: int, begin: float,
         seconds: float) -> float:
    """Clips a second of this process, of every `step`-th one from `first` on, in turns."""
    given: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value
                             for key, value in options.items()}  # JSON has no tuples
    clips = Clips(folder, **given)
    one = clips.__getitem__ if kind == "clips" else _decoding(clips, folder)
    one(first % len(clips))
    time.sleep(max(0.0, begin - time.time()))
    started, done = time.perf_counter(), 0
    while True:
        one((first + done * step) % len(clips))
        done += 1
        took = time.perf_counter() - started
        if took >= seconds:
            return done / took


def _decoding(clips: Clips, folder: str) -> Callable[[int], None]:
    """Reads the files of a clip, without what is made of them."""
    store = Store(DataSet.open(folder))
    has_reference = clips.plan.reference_spp or clips.plan.reference_error
    names = sorted({*clips.channels, "depth", "id"} - {MOTION})
    windows = len(clips) // len(clips.numbers)

    def decode(index: int) -> None:
        number, window = divmod(index, windows)
        for i in range(window * clips.frames, (window + 1) * clips.frames):
            store.images(clips.numbers[number], 0, i, [*names, *[REFERENCE] * bool(has_reference)])
            store.matrices(clips.numbers[number], i)

    return decode
