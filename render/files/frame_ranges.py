"""Frame numbers as text: '0:20' is 0 to 19; and which of some numbers a part '2/8' has."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from onespp.render.errors import InputError

_MOST_FRAMES = 100_000


def parse_frames(text: str) -> tuple[int, ...]:
    """Frame numbers of '0:20' (0 to 19), '0:20:2', '5', or several of these with commas.

    Raises:
        InputError: not of this form, negative, none, or not in increasing order.
    """
    numbers: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*([0-9]{1,9})(?::([0-9]{1,9})(?::([1-9][0-9]{0,8}))?)?\s*", part)
        if not match:
            raise InputError(f"{text[:40]!r} are not frames: write 0:20 for 0 to 19, or 3,5,8")
        start, stop, step = match.groups()
        part_numbers = range(int(start), int(start) + 1 if stop is None else int(stop),
                             int(step or 1))
        if len(part_numbers) + len(numbers) > _MOST_FRAMES:
            raise InputError(f"the frames {text[:40]!r} are more than {_MOST_FRAMES}")
        numbers += part_numbers
    if not numbers:
        raise InputError(f"the frames {text[:40]!r} are none: write 0:20 for 0 to 19")
    if any(b <= a for a, b in pairwise(numbers)):
        raise InputError(f"the frames {text[:40]!r} are not in increasing order")
    return tuple(numbers)


def format_frames(frames: Iterable[int]) -> str:
    """The shortest text that `parse_frames` reads as these increasing numbers."""
    runs: list[list[int]] = []
    for i in frames:
        if runs and runs[-1][-1] == i - 1:
            runs[-1].append(i)
        else:
            runs.append([i])
    return ",".join(f"{r[0]}:{r[-1] + 1}" if len(r) > 1 else str(r[0]) for r in runs)


def spread(frames: list[int], count: int | None) -> list[int]:
    """At most `count` of the frames: first, last, and evenly between; None: all.

    Example:
        >>> spread([0, 1, 2, 3, 5], 3)
        [0, 2, 5]
    """
    if count is None or len(frames) <= count:
        return frames
    return [frames[i] for i in np.linspace(0, len(frames) - 1, count).round().astype(int)]


def part_of(numbers: Iterable[int], part: str | None) -> list[int]:
    """Every N-th of the numbers, from the K-th on, for a part 'K/N'; None: all.

    Example:
        >>> part_of(range(8), "2/3")
        [1, 4, 7]

    Raises:
        InputError: not of this form.
    """
    if part is None:
        return list(numbers)
    k, slash, n = part.partition("/")
    if not (slash and k.isdigit() and n.isdigit() and 1 <= int(k) <= int(n)):
        raise InputError(f"--part is {part[:40]!r}: use K/N, as 1/4 to 4/4")
    return list(numbers)[int(k) - 1::int(n)]
