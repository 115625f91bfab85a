"""Files that appear complete or not at all: written beside their place, then renamed into it."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from onespp.render.errors import InputError


def temporary_name(path: Path) -> Path:
    """The hidden name a file has while it is written: same folder, same suffix, one a process."""
    return path.with_name(f".{os.getpid()}.tmp.{path.name}")


def is_temporary(path: Path) -> bool:
    """Whether a file is what a killed process left of a write."""
    parts = path.name.split(".")
    return len(parts) > 3 and parts[0] == "" and parts[1].isdigit() and parts[2] == "tmp"


@contextmanager
def replacing(path: Path, durable: bool = False) -> Iterator[Path]:
    """Yields a temporary path in the same folder; renames it to `path` when the block succeeds.

    When the block fails, for whatever reason (an interrupt too), the temporary file is removed
    and an older `path` stays as it was. Missing folders are made.

    Args:
        durable: the file has reached the disk before it gets its name, and the name when this
            returns. Without, a loss of power soon after may leave an empty file under a name
            that says it is whole: good enough for what is made again in a second.

    Raises:
        InputError: the file system refuses (full, read-only, no permission, not a folder).
    """
    if not path.name:  # as / and .
        raise InputError(f"{path} is a folder, and no name for a file: add one")
    temporary = temporary_name(path)
    try:
        if _is_device(path):  # the rename would put a file in its place, for all who use it
            raise InputError(f"{path} is a device or a pipe: give the name of a file")
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.unlink(missing_ok=True)  # a link put there would lead the write elsewhere
        yield temporary
        if durable:
            _sync(temporary)
        os.replace(temporary, path)
        if durable:
            _sync(path.parent)
    except OSError as error:
        raise InputError(explain(path, error)) from error
    finally:
        # Nothing to remove after a rename; where the folder is out of reach, the error says so.
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _is_device(path: Path) -> bool:
    """Whether a name leads to neither a file nor a folder, nor nowhere."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


@contextmanager
def all_or_none() -> Iterator[list[Path]]:
    """Yields a list, for the paths of files that belong together, each put in before it is written.

    When the block fails, for whatever reason, they are removed, and the folders that this empties:
    half a set would be taken for a whole one.
    """
    paths: list[Path] = []
    try:
        yield paths
    except BaseException:
        for path in paths:
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)
        for folder in sorted({parent for path in paths for parent in path.parents[:3]},
                             key=lambda folder: -len(folder.parts)):
            with contextlib.suppress(OSError):  # not empty
                folder.rmdir()
        raise


def _sync(path: Path) -> None:
    """Wait until a file's bytes, or the names in a folder, are on the disk."""
    folder = path.is_dir()
    try:
        descriptor = os.open(path, os.O_RDONLY if folder else os.O_RDWR)
    except PermissionError:
        if folder:
            return  # Windows opens no folders, and keeps names in a journal
        raise
    try:
        os.fsync(descriptor)
    except OSError as error:  # some network drives cannot; a disk that fails says something else
        if error.errno not in (errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP):
            raise
    finally:
        os.close(descriptor)


def write_bytes(path: Path, data: bytes, durable: bool = False) -> None:
    """Write a whole file; see `replacing`."""
    with replacing(path, durable) as temporary:
        temporary.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Write a whole UTF-8 file; see `replacing`."""
    write_bytes(path, text.encode())


def read_bytes(path: Path) -> bytes:
    """A whole file.

    Raises:
        InputError: missing, unreadable, larger than the memory, or no file: a pipe would wait and
            a device never end.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise InputError(f"{path} cannot be read: it is not a file")
        return path.read_bytes()
    except MemoryError:
        raise InputError(f"{path} is too large to read into memory") from None
    except FileNotFoundError:
        raise InputError(f"{path} does not exist") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error


def explain(path: Path, error: OSError) -> str:
    """Why a file or folder could not be written, and what to do: one sentence."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return (f"{path} could not be written because the disk is full: free some space and run "
                "the same command again, what is already written is kept")
    return f"{path} could not be written ({error.strerror or error}): check the output folder"
