"""Finds the files of the GAMES202 assignment, as its programs and its students leave them.

Frames are `beauty_%d.exr` and so on in the folder given, or in `input/` in it. Numbers may be
padded, and the case of names and of `.exr` and `.mat` does not matter. Beside the frames, or
beside `input/`, there may be

    result_%d.exr, also in output/ or results/         what a program made of them
    reference_%d.exr; or reference/ with NAME_%d.exr   the ground truth
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from onespp.render.errors import InputError

STEMS = ("beauty", "normal", "position", "depth", "ID", "matrix")
_INPUT = "input"
_RESULTS, _REFERENCES = ("output", "results", "result"), ("reference", "references")
_NUMBER = r"_?([0-9]{1,9})"


@dataclass(frozen=True)
class Found:
    """The files in a folder.

    Attributes:
        folder: where the frames are. name: what their sequence may be called.
        stems: of `STEMS` -> frame number -> file. results, references: frame number -> file.
    """

    folder: Path
    name: str
    stems: Mapping[str, Mapping[int, Path]]
    results: Mapping[int, Path]
    references: Mapping[int, Path]

    @property
    def frames(self) -> list[int]:
        """Numbers of the frames that have any file, increasing."""
        return sorted({i for files in self.stems.values() for i in files})

    def file(self, stem: str, i: int) -> Path:
        """A frame's file, or what its name would be."""
        return self.stems[stem].get(i, self.folder / f"{stem}_{i}{_suffix(stem)}")


def find_files(folder: Path) -> Found:
    """What a folder holds.

    Raises:
        InputError: it is not a folder, has no frames, or two files for one of them.
    """
    frames, home = folder, folder
    if not _has_frames(folder):
        frames = next(iter(_subfolders(folder, (_INPUT,))), folder)
    elif folder.resolve().name.lower() == _INPUT:
        home = folder.resolve().parent
    stems = {stem: numbered(frames, stem) for stem in STEMS}
    if not any(stems.values()):
        raise InputError(f"{folder} has no beauty_0.exr, depth_0.exr ...: give a folder with "
                         "the input of the assignment")
    around = list(dict.fromkeys((frames, home)))
    results = _first(numbered(place, "result")
                     for place in (*around, *_inside(around, _RESULTS)))
    references = _first([*(numbered(place, "reference") for place in around),
                         *(numbered(place, "[a-z]*") for place in _inside(around, _REFERENCES))])
    name = "".join(c for c in home.resolve().name if c.isprintable()) or "import"
    return Found(frames, name, stems, results, references)


def numbered(folder: Path, stem: str) -> dict[int, Path]:
    """Number -> file stem_%d.exr (or .mat) in a folder, increasing; `stem` may be a pattern.

    Raises:
        InputError: it is not a folder, or two files have the same number.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder")
    name = re.compile(stem + _NUMBER + re.escape(_suffix(stem)), re.IGNORECASE)
    files: dict[int, Path] = {}
    for path in sorted(folder.iterdir()):
        if (match := name.fullmatch(path.name)) and not path.name.startswith("."):
            other = files.setdefault(int(match[1]), path)
            if other != path:
                raise InputError(f"{folder} has both {other.name} and {path.name}: "
                                 "keep one of them")
    return dict(sorted(files.items()))


def gaps(frames: list[int]) -> list[tuple[int, int]]:
    """Neighbours in a list of frames that are farther apart than the nearest ones."""
    steps = list(pairwise(frames))
    least = min((b - a for a, b in steps), default=1)
    return [(a, b) for a, b in steps if b - a > least]


def _suffix(stem: str) -> str:
    return ".mat" if stem == "matrix" else ".exr"


def has_matrices(folder: Path) -> bool:
    """Whether it has the assignment's matrices, by itself or in `input`; InputError: no folder."""
    return bool(numbered(folder, "matrix")) or any(
        numbered(place, "matrix") for place in _subfolders(folder, (_INPUT,)))


def _has_frames(folder: Path) -> bool:
    return any(numbered(folder, stem) for stem in STEMS)


def _subfolders(folder: Path, names: Iterable[str]) -> list[Path]:
    """Those folders in a folder that are called so, in any case, in the order of the names."""
    there = {path.name.lower(): path for path in sorted(folder.iterdir()) if path.is_dir()}
    return [there[name] for name in names if name in there]


def _inside(folders: Iterable[Path], names: Iterable[str]) -> list[Path]:
    names = tuple(names)
    return [path for folder in folders for path in _subfolders(folder, names)]


def _first(found: Iterable[dict[int, Path]]) -> dict[int, Path]:
    return next((files for files in found if files), {})
