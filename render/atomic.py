"""Files that appear complete or not at all: written beside their place, then renamed into it."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError


def temporary_name(path: Path) -> Path:
    """The hidden name a file has while it is written: same folder, same suffix, one a process."""
    return path.with_name(f".{os.getpid()}.tmp.{path.name}")


def is_temporary(path: Path) -> bool:
    """Whether a file is what a killed process left of a write."""
    parts = path.name.split(".")
    return len(parts) > 3 and parts[0] == "" and parts[1].isdigit() and parts[2] == "tmp"


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yields a temporary path in the same folder; renames it to `path` when the block succeeds.

    When the block fails, for whatever reason (an interrupt too), the temporary file is removed
    and an older `path` stays as it was. Missing folders are made.

    Raises:
        InputError: the file system refuses (full, read-only, no permission, not a folder).
    """
    temporary = temporary_name(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.unlink(missing_ok=True)  # a link put there would lead the write elsewhere
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(explain(path, error)) from error
    finally:
        # Nothing to remove after a rename; where the folder is out of reach, the error says so.
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_bytes(path: Path, data: bytes) -> None:
    """Write a whole file; see `replacing`."""
    with replacing(path) as temporary:
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
