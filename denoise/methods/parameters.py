"""Checks of denoiser parameters, their former names, and parameters given as text."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from types import MappingProxyType
from typing import Any, TypeVar

from onespp.render.errors import InputError

T = TypeVar("T")

HISTORY_RENAMED: Mapping[str, str] = MappingProxyType({"longest": "max_history_length"})
"""Of SVGF and A-SVGF: former name of a parameter -> its name. Former names are accepted, with a
note, for one version."""

INNOVATION_RENAMED: Mapping[str, str] = MappingProxyType({
    "follow": "min_gain", "doubt": "noise_threshold", "sharp_follow": "sharp_min_gain",
    "renewal": "change_alpha", "smoothing": "innovation_levels", "levels": "output_levels",
    "sharp_smoothing": "sharp_innovation_levels", "sharp_levels": "sharp_output_levels",
    "fade": "fade_frames", **HISTORY_RENAMED})
"""The same of `onespp`."""


def renamed_parameters(method: Any) -> dict[str, str]:
    """Former name -> name of a method's parameters: `renamed` of its class and of its parts."""
    found = dict(getattr(method, "renamed", {}))
    for f in fields(method):
        value = getattr(method, f.name)
        if is_dataclass(value):
            found.update(renamed_parameters(value))
    return found


def with_present_names(given: Mapping[str, T], renamed: Mapping[str, str],
                       note: Callable[[str], None] = lambda text: None) -> dict[str, T]:
    """Values by name, whatever name they were given by.

    Args:
        note: told of each former name.

    Raises:
        InputError: a value is given by both of its names.
    """
    found = {}
    for key, value in given.items():
        name = renamed.get(key, key)
        if name in found:
            former = next(old for old, new in renamed.items() if new == name)
            raise InputError(f"{former} and {name} are one parameter: give {name} alone")
        if name != key:
            note(f"{key} is now {name}; the old name goes in the next version")
        found[name] = value
    return found


def present_parameters(stored: Mapping[str, T]) -> dict[str, T]:
    """All parameters of a method, as a file of this or of the last version has them, by name."""
    for renamed in (INNOVATION_RENAMED, HISTORY_RENAMED):
        if set(renamed) <= set(stored):
            return with_present_names(stored, renamed)
    return dict(stored)


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
