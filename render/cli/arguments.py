"""What a user types, turned into values. (Frame ranges: `manifest.parse_frames`.)"""

from __future__ import annotations

import re
from collections.abc import Iterable

from onespp.api.rendering import LARGEST_SIDE
from onespp.render.errors import InputError


def parse_size(text: str) -> tuple[int, int]:
    """(height, width) of 'WIDTHxHEIGHT'.

    Raises:
        InputError: no such form, a side of 0 or above 16384.
    """
    match = re.fullmatch(r"([0-9]{1,9})[xX]([0-9]{1,9})", text.strip())
    if not match:
        raise InputError(f"--size '{text}' is not understood: use WIDTHxHEIGHT, as in 640x360")
    width, height = int(match[1]), int(match[2])
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise InputError(f"--size {text} is out of range: both sides must be 1 to {LARGEST_SIDE}")
    return height, width


def parse_settings(texts: Iterable[str], option: str = "-D", last: bool = False,
                   form: str = "NAME=VALUE") -> dict[str, str]:
    """Values by name, of texts NAME=VALUE.

    Args:
        last: a name may hold "=", a value may not. form: how to write one, for the message.

    Raises:
        InputError: one has another form, or a name comes again.
    """
    made: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.rpartition("=") if last else text.partition("=")
        if not (name and equals):
            raise InputError(f"{option} {text} is not understood: use {option} {form}")
        if name in made:
            raise InputError(f"{option} {name}=... is given twice: leave one out")
        made[name] = value
    return made
