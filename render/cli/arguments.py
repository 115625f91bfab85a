"""What a user types, turned into values. (Frame ranges: `manifest.parse_frames`.)"""

from __future__ import annotations

import re

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
