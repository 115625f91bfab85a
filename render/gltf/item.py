"""A value of a glTF file's JSON that knows where it stands, so that whoever cannot use it says so.

Whatever a file holds, asking for it gives a value of the kind that was asked for, or a SceneError
with the path: "scene file 'a.gltf', materials[3].alphaCutoff: it is 'half': use a number".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from onespp.scenes.description import SceneError
from onespp.scenes.validity import LARGEST, brief

_LARGEST_WHOLE = 1 << 40


@dataclass(frozen=True, eq=False)
class Item:
    """One value. path: as "nodes[4].camera", "" of the whole. file: "scene file 'a.gltf'"."""

    value: Any
    path: str
    file: str

    def error(self, what: str) -> SceneError:
        """What is wrong here, in one sentence."""
        return SceneError(f"{self.file}{', ' if self.path else ''}{self.path}: {what}")

    def __contains__(self, name: str) -> bool:
        return name in self.value

    def _inside(self, name: str) -> Item:
        return Item(self.value.get(name), f"{self.path}.{name}" if self.path else name, self.file)

    def part(self, name: str) -> Item:
        """The object of that name, an empty one where there is none."""
        inside = self._inside(name)
        if inside.value is None:
            return Item({}, inside.path, self.file)
        if not isinstance(inside.value, dict):
            raise inside.error(f"it is {brief(inside.value)}: use an object")
        return inside

    def extension(self, name: str) -> Item:
        """What an extension says here, an empty object where it says nothing."""
        return self.part("extensions").part(name)

    def parts(self, name: str) -> list[Item]:
        """The objects of a list, none where there is no list."""
        parts = self._elements(name)
        for part in parts:
            if not isinstance(part.value, dict):
                raise part.error(f"it is {brief(part.value)}: use an object")
        return parts

    def texts(self, name: str) -> list[tuple[Item, str]]:
        """The texts of a list, each with its place."""
        return [(part, part._text()) for part in self._elements(name)]

    def wholes(self, name: str) -> list[tuple[Item, int]]:
        """The indices of a list, each with its place."""
        return [(part, part._whole(0, _LARGEST_WHOLE)) for part in self._elements(name)]

    def _elements(self, name: str) -> list[Item]:
        inside = self._inside(name)
        if not isinstance(inside.value, list | None):
            raise inside.error(f"it is {brief(inside.value)}: use a list")
        return [Item(value, f"{inside.path}[{i}]", self.file)
                for i, value in enumerate(inside.value or ())]

    def text(self, name: str, default: str = "") -> str:
        return self._inside(name)._text() if name in self.value else default

    def _text(self) -> str:
        if not isinstance(self.value, str):
            raise self.error(f"it is {brief(self.value)}: use a text")
        return self.value

    def flag(self, name: str) -> bool:
        inside = self._inside(name)
        if not isinstance(inside.value, bool | None):
            raise inside.error(f"it is {brief(inside.value)}: use true or false")
        return bool(inside.value)

    def number(self, name: str, default: float, least: float = -LARGEST,
               most: float = LARGEST) -> float:
        """A number from `least` to `most`."""
        inside = self._inside(name)
        if name not in self.value:
            return default
        return inside._number(least, most)

    def _number(self, least: float, most: float) -> float:
        value = self.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(f"it is {brief(value)}: use a number")
        if not least <= value <= most:  # false for NaN
            raise self.error(f"it is {brief(value)}: use {_range(least, most)}")
        return float(value)

    def whole(self, name: str, default: int | None = None, least: int = 0,
              most: int = _LARGEST_WHOLE) -> int:
        """A whole number from `least` to `most`; without a default it has to be there."""
        inside = self._inside(name)
        if inside.value is not None:
            return inside._whole(least, most)
        if default is None:
            raise inside.error("it is not there: export the file again")
        return default

    def _whole(self, least: int, most: int) -> int:
        number = self._number(least, most)
        if not number.is_integer():
            raise self.error(f"it is {number:g}: use a whole number")
        return int(number)

    def numbers(self, name: str, default: Sequence[float], least: float = -LARGEST,
                most: float = LARGEST) -> np.ndarray:
        """As many numbers as the default has, (n,) float64."""
        inside, count = self._inside(name), len(default)
        if name not in self.value:
            return np.array(default, float)
        if not isinstance(inside.value, list) or len(inside.value) != count:
            raise inside.error(f"it is {brief(inside.value)}: use {count} numbers")
        return np.array([Item(value, f"{inside.path}[{i}]", self.file)._number(least, most)
                         for i, value in enumerate(inside.value)])


def _range(least: float, most: float) -> str:
    if most >= LARGEST:
        return "a finite number" if least <= -LARGEST else f"{least:g} or more"
    return f"{least:g} to {most:g}" if math.isfinite(least) else f"at most {most:g}"
