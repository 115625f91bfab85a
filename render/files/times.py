"""times.json: what methods took, measured in turns (`run/interleaved_timing.py`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import FiniteFloat

from .json_file import JsonFile, read_json


class MethodTime(JsonFile):
    """Milliseconds a frame: median and quartiles, and the same of the ratio to the first method.

    `source` is as in `Run`.
    """

    parameters: dict[str, Any]
    source: str = ""
    first_ms: FiniteFloat
    ms: FiniteFloat
    ms_quartiles: tuple[FiniteFloat, FiniteFloat]
    ratio: FiniteFloat
    ratio_quartiles: tuple[FiniteFloat, FiniteFloat]


class Times(JsonFile):
    """times.json.

    Attributes:
        steps: measurements of each method that count. ratio_to: the first method.
        command: the command line, as it was typed.
    """

    size: tuple[int, int]
    frames: int
    steps: int
    device: str
    threads: int
    machine: str
    command: str = ""
    ratio_to: str
    methods: dict[str, MethodTime]


def read_times(folder: Path) -> Times | None:
    """The times in a sequence's folder, None if there are none; InputError if damaged."""
    path = folder / "times.json"
    return read_json(path, Times) if path.exists() else None
