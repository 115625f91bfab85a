"""The scenes there are, and how one of your own is found.

To add a scene: one file with a function that returns it, and one row here. (The hard ones, which
are for testing, have their table in `scenes/hard`, and are called `hard/NAME`.)
"""

from __future__ import annotations

import difflib
import runpy
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .box import box
from .description import Scene, SceneError
from .hard import HARD
from .room import room

SCENES: dict[str, Callable[[], Scene]] = {
    "box": box,
    "room": room,
}
_HARD = "hard/"


def load(name: str) -> Scene:
    """A scene of the table above, or of a Python file that defines `scene()` or `SCENE`.

    The file runs as a script of its own (its `__name__` is 'scene_file'); it can import
    `scenes` and whatever is installed.

    Raises:
        SceneError: no such scene or file, or the file raises or defines no scene; one sentence
            with the file and, where there is one, the line.
    """
    if name in SCENES:
        return SCENES[name]()
    if name.startswith(_HARD) and name[len(_HARD):] in HARD:
        return HARD[name[len(_HARD):]].make()
    if not name.endswith(".py"):
        raise SceneError(_unknown(name))
    path = Path(name)
    if not path.is_file():
        raise SceneError(f"there is no scene file '{name}'")
    try:
        return _scene_of(runpy.run_path(str(path), run_name="scene_file"))
    except (Exception, SystemExit) as error:  # a user's file may raise anything
        raise SceneError(_blame(path, error)) from error


def _scene_of(module: dict[str, Any]) -> Scene:
    """The scene that a file defines, with its first and last frame tried out."""
    made = module["scene"]() if callable(module.get("scene")) else module.get("SCENE")
    if not isinstance(made, Scene):
        raise SceneError("there is no scene here: add a function `scene()` that returns a "
                         "scenes.description.Scene")
    if not made.name or Path(made.name).name != made.name or not made.name.isprintable():
        raise SceneError(f"the scene's name is {made.name[:40]!r}: files are named after it, so "
                         "use letters, digits and spaces")
    for frame in (0, made.frames - 1):
        places = {shape.name: shape.world_from_object_at(frame) for shape in made.shapes}
        for name, place in (("camera", made.camera.world_from_camera_at(frame)), *places.items()):
            if place.shape != (4, 4) or not np.isfinite(place).all():
                raise SceneError(f"the place of '{name}' in frame {frame} is not a 4x4 matrix of "
                                 "numbers")
        if np.linalg.det(made.camera.world_from_camera_at(frame)) == 0:
            raise SceneError(f"the place of 'camera' in frame {frame} cannot be inverted")
    return made


def _unknown(name: str) -> str:
    known = (*SCENES, *(_HARD + hard for hard in HARD))
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean '{close[0]}'? " if close else ""
    return (f"unknown scene '{name}': {hint}there are {', '.join(sorted(SCENES))}, "
            f"{_HARD}NAME (`onespp scenes` lists them), or give the path of a .py file")


def _blame(path: Path, error: BaseException) -> str:
    """One sentence: the file, the last of its lines that took part, and what happened."""
    line: int | None = None
    if isinstance(error, SyntaxError) and error.filename and Path(error.filename) == path:
        line = error.lineno
    for entry in traceback.extract_tb(error.__traceback__):
        if Path(entry.filename) == path:
            line = entry.lineno
    what = str(error) if isinstance(error, SceneError) else f"{type(error).__name__}: {error}"
    where = f"'{path}'" + (f", line {line}" if line else "")
    return f"scene file {where}: {' '.join(what.split())}"
