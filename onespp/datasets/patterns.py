"""Names of the user's own files that a plan draws from, of the patterns that it gives."""

from __future__ import annotations

import glob
from collections.abc import Iterable
from pathlib import Path

from onespp.render.errors import InputError
from onespp.render.scene_of_file import SUFFIXES

MESHES = (".obj", ".ply")
READ = {"files": SUFFIXES, "meshes": MESHES}
"""Setting of a plan -> how the files that it may name end."""


def names_of(patterns: Iterable[str], folder: Path, what: str, suffixes: tuple[str, ...]
             ) -> list[str]:
    """The files that patterns are for, pattern by pattern, each one's in the order of the alphabet.

    Args:
        patterns: names from `folder`, or with *, ?, [] and ** as of a shell: of those files, the
            ones that can be read.
        what: who asks, for the error. suffixes: how names of files that can be read end.

    Raises:
        InputError: a pattern without a file, or a file that cannot be read.
    """
    names: list[str] = []
    ends = ", ".join(suffixes)
    for pattern in patterns:
        if (folder / pattern).is_file():
            if not pattern.lower().endswith(suffixes):
                raise InputError(f"{what} names '{pattern}', which is none of the files that can "
                                 f"be read here: use {ends}")
            names.append(Path(pattern).as_posix())
            continue
        found = sorted(Path(name).as_posix() for name in glob.glob(pattern, root_dir=folder,
                                                                   recursive=True)
                       if name.lower().endswith(suffixes) and (folder / name).is_file())
        if not found:
            raise InputError(f"{what} names '{pattern}', and there is no such file in {folder}: "
                             f"correct it (paths start from there, and end with {ends})")
        names += found
    return names
