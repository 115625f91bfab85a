"""The scenes there are, and how one of your own is found.

To add a scene: one file with a function that returns it, and one row here. (The hard ones, which
are for testing, have their table in `scenes/hard`, and are called `hard/NAME`; those drawn from a
seed, `generated/NUMBER`, are in `scenes/generated`.)
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from pathlib import Path

from onespp import entry_points
from onespp.scenes.room.room import room

from .box import box
from .description import Scene, SceneError
from .generated import COUNT, generated
from .hard import HARD
from .scene_file import installed, load_file

SCENES: dict[str, Callable[[], Scene]] = {
    "box": box,
    "room": room,
}
_HARD = "hard/"
HARD_NAMES = tuple(_HARD + name for name in HARD)
GENERATED = tuple(f"generated/{number}" for number in range(COUNT))


def names() -> tuple[str, ...]:
    """Of all scenes that come with onespp."""
    return (*SCENES, *HARD_NAMES, *GENERATED)


def load(name: str) -> Scene:
    """A scene of the table above, of a Python file (see `scenes/scene_file.py`), or one that an
    installed package offers.

    Raises:
        SceneError: no such scene or file, or the file raises or defines no scene; one sentence
            with the file and, where there is one, the line.
    """
    if name in SCENES:
        return SCENES[name]()
    if name.startswith(_HARD) and name[len(_HARD):] in HARD:
        return HARD[name[len(_HARD):]].make()
    if name in GENERATED:
        return generated(GENERATED.index(name))
    if name.endswith(".py"):
        return load_file(Path(name))
    scene = installed(name)
    if scene is None:
        raise SceneError(_unknown(name))
    return scene


def offers() -> list[entry_points.Offer]:
    """The scenes that installed packages offer."""
    return entry_points.offers(entry_points.SCENES)


def _unknown(name: str) -> str:
    known = (*names(), *(o.name for o in offers()))
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean '{close[0]}'? " if close else ""
    return (f"unknown scene '{name}': {hint}there are {', '.join(sorted(SCENES))}, "
            f"{_HARD}NAME and {GENERATED[0]} to {COUNT - 1} (`onespp scenes` lists them), "
            "or give the path of a .py, .xml, .glb or .gltf file")
