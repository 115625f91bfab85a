"""Removing a sequence's files from a folder, and nothing else that a person may keep there."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path

from onespp.render.errors import InputError

from .atomic import is_temporary

_OWN = re.compile(r"scores\.(json|csv)|times\.json|pictures/[^/]+\.(png|mp4)"
                  r"|frames/\d{4,}\.(exr|json)"
                  r"|reference/\d{4,}\.(exr|partial\.npz)|denoised/[^/]+/(\d{4,}\.exr|run\.json)"
                  r"|report/(index\.html|scores\.(json|csv)|data/([^/]+/){1,2}\d{4,}\.js)")
_FOLDERS = ("denoised/*", "frames", "reference", "denoised", "pictures", "report/data/*/*",
            "report/data/*", "report/data", "report")


def remove_sequence(folder: Path) -> None:
    """Remove a sequence's files but for the manifest, and those of its folders that get empty.

    Raises:
        InputError: a file cannot be removed.
    """
    check_links(folder)
    folders = list(_folders(folder))
    remove_files(folder, folder, *folders)
    for path in folders:
        with contextlib.suppress(OSError):  # not empty
            path.rmdir()


def check_links(folder: Path) -> None:
    """InputError where a folder of a sequence is a link that leads out of it.

    Writing or removing files would then do so elsewhere, where nobody expects it.
    """
    inside = folder.resolve()
    for path in _folders(folder):
        if path.is_symlink() and inside not in path.resolve().parents:
            raise InputError(f"{path} is a link to a place outside {folder}: "
                             "put a folder in its place")


def remove_leftovers(folder: Path, *patterns: str) -> None:
    """Remove what killed writers left half written, of files that a pattern fits; if possible."""
    for path in (path for pattern in patterns for path in folder.glob(pattern)):
        if is_temporary(path):
            with contextlib.suppress(OSError):
                path.unlink()


def _folders(folder: Path) -> Iterator[Path]:
    """The folders in which a sequence keeps its files, the innermost first."""
    return (path for place in _FOLDERS for path in folder.glob(place) if path.is_dir())


def remove_files(folder: Path, *places: Path) -> None:
    """Remove the files directly in `places` that the sequence in `folder` wrote there.

    Raises:
        InputError: a file cannot be removed.
    """
    for path in (path for place in places for path in place.glob("*")):
        if _OWN.fullmatch(path.relative_to(folder).as_posix()) or is_temporary(path):
            try:
                path.unlink()
            except OSError as error:
                raise InputError(f"{path} could not be removed ({error.strerror}): "
                                 "choose another output folder") from error
