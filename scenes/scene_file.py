"""A scene of one's own: a Python file that defines `scene()`, or `SCENE`.

While the file runs, and only then,
- it can import the files beside it. Their folder is searched last, so that a neighbour called
  `render.py` or `numpy.py` takes nothing from the library or from Python; what was imported from
  there is forgotten afterwards, and two scenes' `parts.py` do not meet;
- the search path and the working directory are its own: both are put back;
- `scenes` means `onespp.scenes`, as it did before that was the package's name (for one version).

A file name in the scene ("filename" in a material, the path of an environment) is looked up from
the folder of the scene's file, whatever the working directory is.
"""

from __future__ import annotations

import ast
import importlib
import os
import pkgutil
import sys
import traceback
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

from . import validity
from .description import Scene, SceneError, Shape

_MODULE = "scene_file"  # the file's __name__


def load_file(path: Path) -> Scene:
    """The scene of a file, with everything that moves tried out in each of its frames.

    Raises:
        SceneError: there is no such file, it raises, or it defines no scene.
    """
    shown = validity.brief(str(path))
    try:
        there = path.is_file()
    except (OSError, ValueError):  # a name that is too long, say
        there = False
    if not there:
        raise SceneError(f"there is no scene file {shown}")
    whole = path.absolute()
    try:
        with _neighbours(whole.parent), _old_names(whole):
            scene = _checked(_run(whole))
        return _found_from(scene, whole.parent)
    except (KeyboardInterrupt, MemoryError):
        raise
    except BaseException as error:  # a user's file may raise anything, or exit
        raise SceneError(f"scene file {shown}{_blame(whole, error)}") from error


def _run(path: Path) -> Any:
    """What the file defines as its scene."""
    module = ModuleType(_MODULE)
    module.__file__ = str(path)
    code = compile(path.read_bytes(), str(path), "exec", dont_inherit=True)
    sys.modules[_MODULE] = module  # where dataclasses look for the names of a file's own
    exec(code, module.__dict__)
    made = getattr(module, "scene", None)
    return made() if callable(made) else getattr(module, "SCENE", None)


@contextmanager
def _neighbours(folder: Path) -> Iterator[None]:
    """The files of a folder can be imported."""
    path, modules, here = sys.path, set(sys.modules), _working_directory()
    searched = list(path)
    no_bytecode = sys.dont_write_bytecode
    sys.path.append(str(folder))
    sys.dont_write_bytecode = True  # no __pycache__ in a folder that is the user's
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.dont_write_bytecode = no_bytecode
        sys.path = path  # the same list, if the file put another in its place
        path[:] = searched
        for name in set(sys.modules) - modules:
            if name == _MODULE or _lies_in(sys.modules[name], folder):
                del sys.modules[name]
        if here is not None:
            os.chdir(here)


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
    except (SyntaxError, ValueError):  # told when it is run
        return False
    named = [node.module for node in nodes if isinstance(node, ast.ImportFrom) and not node.level]
    named += [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    return any((name or "").split(".")[0] == "scenes" for name in named)


def _working_directory() -> str | None:
    try:
        return os.getcwd()
    except FileNotFoundError:  # it was removed
        return None


def _lies_in(module: ModuleType, folder: Path) -> bool:
    """Whether a module is a file of the folder, or a package there."""
    places = [getattr(module, "__file__", None), *(getattr(module, "__path__", None) or ())]
    return any(place and Path(place).is_relative_to(folder)
               and "site-packages" not in Path(place).relative_to(folder).parts
               for place in places)


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


def _blame(path: Path, error: BaseException) -> str:
    """The last of the file's lines that took part, and what happened, on one line."""
    line: int | None = None
    cause: BaseException | None = error
    while cause is not None and line is None:  # the first cause knows the author's line best
        if isinstance(cause, SyntaxError) and cause.filename and Path(cause.filename) == path:
            line = cause.lineno
        for entry in traceback.extract_tb(cause.__traceback__):
            if Path(entry.filename) == path:
                line = entry.lineno
        cause = cause.__cause__
    what = str(error) if isinstance(error, SceneError) else validity.said(error)
    where = f", line {line}" if line else ""
    return f"{where}: {' '.join(what.split())}{_shadowed(path.parent, error)}"


def _shadowed(folder: Path, error: BaseException) -> str:
    """A word more if an import met a package where the author has a neighbour of that name."""
    module = getattr(error, "obj", None) if isinstance(error, AttributeError) else None
    name = (getattr(module, "__name__", "") if isinstance(module, ModuleType)
            else error.name if isinstance(error, ImportError) else None) or ""
    name = name.split(".")[0]
    if not name or not ((folder / f"{name}.py").is_file() or (folder / name).is_dir()):
        return ""
    return (f" ('{name}' is an installed package, which goes before the one beside the scene file: "
            "give yours another name)")
