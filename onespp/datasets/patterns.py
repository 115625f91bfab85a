"""Names of the user's own files that a plan draws from, of the patterns that it gives."""

from __future__ import annotations

import glob
from collections.abc import Iterable
from pathlib import Path

from onespp.render.errors import InputError
from onespp.render.scene_of_file import SUFFIXES, is_scene_file


def names_of(patterns: Iterable[str], folder: Path, what: str) -> list[str]:
    """The files that patterns are for, pattern by pattern, each one's in the order of the alphabet.

    Args:
        patterns: names from `folder`, or with *, ?, [] and ** as of a shell: of those files, the
            ones that are scenes.
        what: who asks, for the error.

    Raises:
        InputError: a pattern without a file, or a file that is no scene.
    """
    names: list[str] = []
    for pattern in patterns:
        if (folder / pattern).is_file():
            if not is_scene_file(pattern):
                raise InputError(f"{what} names '{pattern}', which is none of the scenes that can "
                                 f"be read: use {', '.join(SUFFIXES)}")
            names.append(Path(pattern).as_posix())
            continue
        found = sorted(Path(name).as_posix() for name in glob.glob(pattern, root_dir=folder,
                                                                   recursive=True)
                       if is_scene_file(name) and (folder / name).is_file())
        if not found:
            raise InputError(f"{what} names '{pattern}', and there is no such scene in {folder}: "
                             f"correct it (paths start from there, scenes end with "
                             f"{', '.join(SUFFIXES)})")
        names += found
    return names
