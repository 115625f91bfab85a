"""One writer at a time for each part of a sequence: a lock that ends with its process.

The operating system holds the lock on `.PART.lock` for as long as that file is open, so a process
that dies, however it dies, leaves none: a file that is left over is taken by the next writer,
whatever process or host it names. Its text says who writes, for the message to a second writer.

Parts are what commands write: `render` (frames and references; an import too), `denoise-METHOD`,
`time`, `score`, `report`; of a data set `dataset`, and `sequence` in the folder of each of its
scenes. Different parts may be written at once. So may shares of one part, as of other frames, by as
many processes: who writes a share also holds the part's lock, together with those who write others,
so that nobody writes the whole part meanwhile. Where the system or the file system knows no locks
(Windows; some network drives) writers are not told of each other.
"""

from __future__ import annotations

import contextlib
import datetime
import errno
import os
import platform
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TypeVar

from onespp.render.errors import InputError

from .atomic import explain
from .cleaning import check_links, remove_leftovers
from .manifest import check_result_name

try:
    import fcntl
except ImportError:
    fcntl = None

T = TypeVar("T")
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
_RESULTS = "denoise-"
_PLACES = {"render": ("frames/*", "reference/*", "*.manifest.json"), "time": ("*.times.json",),
           "score": ("pictures/*", "*.scores.*"), "report": ("report/**/*",),
           "manifest": ("*.manifest.json",), "dataset": ("*.dataset.json", "*.README.md"),
           "sequence": ("*.sequence.json",)}


class Busy(InputError):
    """Another process writes it."""


def when_free(call: Callable[[], T], seconds: float, pause: float) -> T:
    """What a call gives that may be `Busy`: again after each pause, for so many seconds."""
    end = time.monotonic() + seconds
    while True:
        try:
            return call()
        except Busy:
            if time.monotonic() > end:
                raise
            time.sleep(pause)


@contextmanager
def writing(folder: Path, part: str, alone: bool = False) -> Iterator[None]:
    """Holds the lock on a part of the sequence in a folder, which is made if it is not there.

    What a killed writer of this part left half written is removed first.

    Args:
        part: `render`, `time`, `score`, `report`, or `denoise-` and the name of the results.
        alone: nobody may write another part either, as when all is removed.

    Raises:
        InputError: somebody else writes it, or the folder cannot be written, or a folder in it
            is a link that leads outside.
    """
    if part.startswith(_RESULTS):
        check_result_name(part[len(_RESULTS):],
                          (path.name for path in folder.glob("denoised/*")))
    made = not folder.exists()
    try:
        with ExitStack() as held:
            _take(held, folder, part, alone)
            check_links(folder)
            remove_leftovers(folder, *_PLACES.get(part, (f"denoised/{part[len(_RESULTS):]}/*",)))
            yield
    finally:
        if made:
            with contextlib.suppress(OSError):  # holds something, as it should
                folder.rmdir()


@contextmanager
def writing_share(folder: Path, part: str, share: str) -> Iterator[None]:
    """Holds the lock on a share of a part, as "2-of-8", beside others who write other shares.

    What killed writers left half written is left to who writes the whole part next.

    Raises:
        InputError: as `writing`.
    """
    with ExitStack() as held:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            held.enter_context(_locked(folder / f".{part}.lock", shared=True))
            held.enter_context(_locked(folder / f".{part}-{share}.lock"))
        except OSError as error:
            raise InputError(explain(folder, error)) from error
        check_links(folder)
        yield


def _take(held: ExitStack, folder: Path, part: str, alone: bool) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        others = sorted(folder.glob(".*.lock")) if alone else []
        for path in dict.fromkeys((folder / f".{part}.lock", *others)):
            held.enter_context(_locked(path))
    except OSError as error:
        raise InputError(explain(folder, error)) from error


@contextmanager
def _locked(path: Path, shared: bool = False) -> Iterator[None]:
    descriptor = _open(path, shared)
    try:
        who = (f"process {os.getpid()} on {platform.node()} since "
               f"{datetime.datetime.now().astimezone().isoformat(' ', 'seconds')}")
        with contextlib.suppress(OSError):  # a full disk; --overwrite may be about to help
            os.truncate(descriptor, 0)
            os.write(descriptor, who.encode())
        yield
    finally:
        if not shared:  # others may hold it
            with contextlib.suppress(OSError):
                path.unlink()  # while it is locked, so that it is ours
        os.close(descriptor)


def _open(path: Path, shared: bool) -> int:
    """A descriptor that has the lock; InputError where another has it."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
        try:
            if fcntl is not None:
                fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX)
                            | fcntl.LOCK_NB)
        except BlockingIOError:
            who = os.read(descriptor, 300).decode(errors="replace")
            os.close(descriptor)
            raise Busy(_busy(path, who)) from None
        except OSError as error:
            if error.errno in _NO_LOCKS:
                return descriptor
            os.close(descriptor)
            raise InputError(f"{path} could not be locked ({error.strerror or error}): check the "
                             "file system of the output folder, or use another folder") from error
        with contextlib.suppress(OSError):
            if os.path.samestat(os.stat(path), os.fstat(descriptor)):
                return descriptor
        os.close(descriptor)  # the one before us removed the file between open and lock


def _busy(path: Path, who: str) -> str:
    who = "".join(c for c in who if c.isprintable()) or "another process"
    what = path.name[1:-len(".lock")].replace("-", " ", 1)
    return (f"{path.parent} is being written by another `{what}` ({who}): wait for it, stop it, "
            "or use another folder")
