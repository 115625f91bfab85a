"""Checks of denoiser parameters, and parameters given as text."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from render.errors import InputError


def check_positive(denoiser: Any, *names: str) -> None:
    """InputError unless the fields are finite and above 0."""
    for name in names:
        value = getattr(denoiser, name)
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name} is {value}: use a number above 0")


def check_range(denoiser: Any, name: str, low: float, high: float) -> None:
    """InputError unless low <= field <= high."""
    value = getattr(denoiser, name)
    if not low <= value <= high:
        raise InputError(f"{name} is {value}: use {low:g} to {high:g}")


def check_whole(denoiser: Any, name: str, most: int, least: int = 1) -> None:
    """InputError unless the field is a whole number from `least` to `most`."""
    value = getattr(denoiser, name)
    if not isinstance(value, int) or not least <= value <= most:
        raise InputError(f"{name} is {value}: use a whole number from {least} to {most}")


def check_choice(denoiser: Any, name: str, choices: tuple[str, ...]) -> None:
    """InputError unless the field is one of the choices."""
    value = getattr(denoiser, name)
    if value not in choices:
        raise InputError(f"{name} is '{value}': use {', '.join(choices)}")


def pairs(settings: Iterable[str]) -> dict[str, str]:
    """NAME=VALUE texts of `--set` as a dictionary; InputError for anything else."""
    found = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not (key and equals and value):
            raise InputError(f"--set {setting} is not understood: use NAME=VALUE, as in alpha=0.1")
        found[key.strip()] = value.strip()
    return found
