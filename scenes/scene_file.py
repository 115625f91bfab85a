"""A scene of one's own: a Python file that defines `scene()`, or `SCENE`.

It runs as `onespp/user_code.py` says: it can import the files beside it. While it does, `scenes`
means `onespp.scenes`, as it did before that was the package's name (for one version).

A file name in the scene ("filename" in a material, the path of an environment) is looked up from
the folder of the scene's file, whatever the working directory is.
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

from onespp import entry_points
from onespp.user_code import UserFile

from .description import Scene, SceneError, Shape


def load_file(path: Path) -> Scene:
    """The scene of a file, with everything that moves tried out in each of its frames.

    Raises:
        SceneError: there is no such file, it raises, or it defines no scene.
    """
    file = UserFile(path, "scene file", SceneError)
    with _old_names(file.path):
        return file.run(lambda module: _found_from(_checked(_made(module)), file.path.parent))


def installed(name: str) -> Scene | None:
    """The scene that an installed package offers under a name; None if none does.

    Raises:
        SceneError: it cannot be imported, raises, or is no scene; or several packages have it.
    """
    offer = entry_points.offered(name, entry_points.SCENES, SceneError)
    if offer is None:
        return None
    found, code = offer.load("scene", SceneError)
    with code.running():
        return _checked(found() if callable(found) else found)


def _made(module: ModuleType) -> Any:
    """What a file defines as its scene."""
    made = getattr(module, "scene", None)
    return made() if callable(made) else getattr(module, "SCENE", None)


@contextmanager
def _old_names(path: Path) -> Iterator[None]:
    """`import scenes` finds `onespp.scenes`, unless there is a neighbour of that name."""
    if not _imports_old_names(path):
        yield
        return
    warnings.warn(f"{path.name} imports `scenes`: write `onespp.scenes`, the old name goes with "
                  "the next version", FutureWarning, stacklevel=5)
    package = importlib.import_module("onespp.scenes")
    names = ["onespp.scenes", *(found.name for found in pkgutil.walk_packages(
        package.__path__, "onespp.scenes."))]
    old = {name.removeprefix("onespp."): importlib.import_module(name) for name in names}
    before = {name: sys.modules[name] for name in old if name in sys.modules}
    sys.modules.update(old)
    try:
        yield
    finally:
        for name in old:
            sys.modules.pop(name, None)
        sys.modules.update(before)


def _imports_old_names(path: Path) -> bool:
    if (path.parent / "scenes.py").exists() or (path.parent / "scenes").is_dir():
        return False
    try:
        nodes = list(ast.walk(ast.parse(path.read_bytes())))
    except (OSError, SyntaxError, ValueError):  # told when it is run
        return False
    named = [node.module for node in nodes if isinstance(node, ast.ImportFrom) and not node.level]
    named += [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    return any((name or "").split(".")[0] == "scenes" for name in named)


def _checked(made: Any) -> Scene:
    if not isinstance(made, Scene):
        raise SceneError("there is no scene here: add a function `scene()` that returns a "
                         "onespp.scenes.description.Scene")
    if Path(made.name).name != made.name or not made.name.strip(". "):
        raise SceneError(f"the scene's name is {made.name[:40]!r}: files are named after it, so "
                         "use letters, digits and spaces")
    made.try_frames(range(made.frames))
    return made


def _found_from(scene: Scene, folder: Path) -> Scene:
    """The scene with its file names made absolute."""
    def found(value: Any) -> Any:
        if not isinstance(value, Mapping):
            return value
        return {key: str(folder / part) if key == "filename" else found(part)
                for key, part in value.items()}

    def shape_found(shape: Shape) -> Shape:
        if not (_names_files(shape.material) or _names_files(shape.emission)):
            return shape
        return replace(shape, material=found(shape.material), emission=found(shape.emission))

    return replace(scene, shapes=tuple(map(shape_found, scene.shapes)),
                   environment=found(scene.environment))


def _names_files(value: Any) -> bool:
    return isinstance(value, Mapping) and (
        "filename" in value or any(map(_names_files, value.values())))
