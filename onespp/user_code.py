"""Code of the user's own, from a file or an installed package: how it runs, and who is to blame.

While code of a file runs, and only then,
- it can import the files beside it. Their folder is searched last, so that a neighbour called
  `render.py` or `numpy.py` takes nothing from the library or from Python; between its turns the
  neighbours are put aside, and those of two files do not meet;
- the search path and the working directory are its own: both are put back;
- what it prints goes to standard error, beside figures and not among them.

What it raises becomes one sentence with the last of its own lines that took part. One thread at a
time runs such code.
"""

from __future__ import annotations

import hashlib
import importlib
import inspect
import os
import re
import reprlib
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any

_ONE_AT_A_TIME = threading.RLock()  # the search path and standard output are the process's
_LONGEST = 500  # letters of an error; some libraries write pages
_FILE = re.compile(r"(?P<file>.+\.py)(?::(?P<name>.*))?", re.DOTALL)
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 200


def said(error: BaseException) -> str:
    """An error of a user's code, its kind and its text, on one line."""
    try:
        text = " ".join(str(error).split())
    except Exception:  # its text is the user's code too
        return type(error).__name__
    text = text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def is_file(name: str) -> bool:
    """Whether the name of a method or a metric is that of a file, as f.py or f.py:Name."""
    return _FILE.fullmatch(name) is not None


def file_and_name(text: str) -> tuple[Path, str | None]:
    """File and name of `f.py:Name`; the name is None where there is none."""
    match = _FILE.fullmatch(text)
    assert match
    return Path(match["file"]), match["name"]


def a_kind(value: Any) -> str:
    """What a value is, for a message: "an array"."""
    if value is None:
        return "None"
    name = "array" if type(value).__name__ == "ndarray" else type(value).__name__
    return f"a{'n' if name[0] in 'aeiouAEIOU' else ''} {name}"


class UserCode:
    """Where code comes from, and the errors that it is told of by.

    Attributes:
        shown: how messages call it. error: class of the errors, whose text is one sentence.
        source: hash of what ran; "" where it is not known.
    """

    def __init__(self, shown: str, error: type[Exception]) -> None:
        self.shown, self.error, self.source = shown, error, ""

    @contextmanager
    def running(self) -> Iterator[None]:
        """Code of the user's runs inside.

        Raises:
            error: whatever it raises, SystemExit included; not Ctrl-C and want of memory.
        """
        try:
            with _ONE_AT_A_TIME, redirect_stdout(sys.stderr), self._surroundings():
                yield
        except (KeyboardInterrupt, MemoryError):
            raise
        except BaseException as error:  # a user's code may raise anything, or exit
            raise self.error(f"{self.shown}{self._blame(error)}") from error

    def fault(self, what: str, thing: Any = None) -> Exception:
        """An error that says what is wrong with `thing`, a class or function, and in which line."""
        line = self._line_of(thing)
        return self.error(f"{self.shown}{f', line {line}' if line else ''}: {what}")

    @contextmanager
    def _surroundings(self) -> Iterator[None]:
        yield

    def _owns(self, file: str, module: str) -> bool:
        """Whether a line of a file, in a module of that name, is the user's."""
        raise NotImplementedError

    def _where(self, file: str, line: int | None) -> str:
        raise NotImplementedError

    def _hint(self, error: BaseException) -> str:
        return ""

    def _blame(self, error: BaseException) -> str:
        """The innermost of the user's lines that took part, and what happened, on one line."""
        where, cause = "", error
        while cause is not None and not where:  # the first cause knows the author's line best
            if isinstance(cause, SyntaxError) and self._owns(cause.filename or "", ""):
                where = self._where(cause.filename or "", cause.lineno)
            for frame, line in traceback.walk_tb(cause.__traceback__):
                if self._is_ours(frame):
                    where = self._where(frame.f_code.co_filename, line)
            cause = cause.__cause__
        what = str(error) if isinstance(error, self.error) else said(error)
        return f"{where}: {' '.join(what.split())}{self._hint(error)}"

    def _is_ours(self, frame: FrameType) -> bool:
        return self._owns(frame.f_code.co_filename, str(frame.f_globals.get("__name__", "")))

    def _line_of(self, thing: Any) -> int | None:
        code = getattr(inspect.unwrap(thing) if callable(thing) else thing, "__code__", None)
        if isinstance(code, CodeType) and self._owns(code.co_filename, getattr(
                thing, "__module__", "") or ""):
            return code.co_firstlineno
        return None


class UserFile(UserCode):
    """A Python file, which is run as a module.

    Args:
        path: of the file. kind: as "scene file", for messages; the module is called so too.

    Raises:
        error: there is no such file.
    """

    def __init__(self, path: Path, kind: str, error: type[Exception]) -> None:
        super().__init__(f"{kind} {_brief(str(path))}", error)
        if not _is_file(path):
            what = "it is a folder" if _is_folder(path) else "there is no such file"
            raise error(f"there is no {self.shown}: {what}")
        self.path = path.absolute()
        self.module = ModuleType(kind.replace(" ", "_"))
        self.module.__file__ = str(self.path)
        self._apart: dict[str, ModuleType] = {}  # its modules, while it does not run
        self._taken: frozenset[str] = frozenset()  # names that are others'

    def run(self, then: Callable[[ModuleType], Any] = lambda module: module) -> Any:
        """Run the file, and `then` something with its module, as code of the user's.

        Raises:
            error: what the file or `then` raises.
        """
        with self.running():
            data = self.path.read_bytes()
            code = compile(data, str(self.path), "exec", dont_inherit=True)
            name = self.module.__name__
            sys.modules[name] = self._apart[name] = self.module  # where dataclasses look for names
            exec(code, self.module.__dict__)
            made = then(self.module)
            self.source = self._hash(data)
            return made

    def _hash(self, data: bytes) -> str:
        """Of the file and of those beside it that it imported."""
        found = hashlib.sha256(data)
        for name in sorted((set(sys.modules) | set(self._apart)) - {self.module.__name__}):
            place = next(_of(sys.modules.get(name)), None)
            if place and self._owns(place, name) and Path(place).is_file():
                found.update(Path(place).read_bytes())
        return found.hexdigest()[:16]

    @contextmanager
    def _surroundings(self) -> Iterator[None]:
        path, here = sys.path, _working_directory()
        searched, no_bytecode = list(path), sys.dont_write_bytecode
        before = set(sys.modules) - set(self._apart)
        self._taken = frozenset(name.partition(".")[0] for name in before)
        sys.path.append(str(self.path.parent))
        sys.dont_write_bytecode = True  # no __pycache__ in a folder that is the user's
        sys.modules.update(self._apart)
        importlib.invalidate_caches()
        try:
            yield
        finally:
            sys.dont_write_bytecode = no_bytecode
            sys.path = path  # the same list, if the file put another in its place
            path[:] = searched
            for name in set(sys.modules) - before:
                module = sys.modules[name]
                if module is self.module or any(self._owns(place, name) for place in _of(module)):
                    self._apart[name] = sys.modules.pop(name)
            if here is not None and _working_directory() != here:
                os.chdir(here)

    def _owns(self, file: str, module: str) -> bool:
        place = Path(file)
        if place == self.path:
            return True
        if not place.is_relative_to(self.path.parent):
            return False
        first = place.relative_to(self.path.parent).parts[:1]
        top = module.partition(".")[0] or (first[0].partition(".")[0] if first else "")
        return bool(first) and first[0].partition(".")[0] == top and top not in self._taken

    def _where(self, file: str, line: int | None) -> str:
        beside = "" if Path(file) == self.path else (
            f" of {Path(file).relative_to(self.path.parent).as_posix()}")
        return f", line {line}{beside}" if line else ""

    def _hint(self, error: BaseException) -> str:
        """A word more if an import met a package where the author has a neighbour of that name."""
        module = getattr(error, "obj", None) if isinstance(error, AttributeError) else None
        name = (getattr(module, "__name__", "") if isinstance(module, ModuleType)
                else error.name if isinstance(error, ImportError) else None) or ""
        name, folder = name.split(".")[0], self.path.parent
        if not name or not ((folder / f"{name}.py").is_file() or (folder / name).is_dir()):
            return ""
        return (f" ('{name}' is an installed package, which goes before the one beside the "
                f"{self.module.__name__.replace('_', ' ')}: give yours another name)")


def _of(module: Any) -> Iterator[str]:
    """Where a module lies; a package of no file, in which folders.

    A module may make up attributes that it has not (`torch.classes` does).
    """
    own = getattr(module, "__dict__", {})
    folders = own.get("__path__") or ()
    yield from (place for place in (own.get("__file__"), *folders) if isinstance(place, str))


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that is too long, say
        return False


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def _working_directory() -> str | None:
    try:
        return os.getcwd()
    except FileNotFoundError:  # it was removed
        return None


def _brief(text: str) -> str:
    return " ".join(_SHORT.repr(text).split())
