"""The EXR files of an animation: one or several for each frame, numbered at the end of their names.

`beauty.0001.exr`, `Image0012.exr`, `shot_3.EXR`: what comes before the digits is the stem, one for
each pass. Where there are several stems, the channels of a file are called STEM.CHANNEL.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from onespp.render.errors import InputError
from onespp.render.files.exr import read_any_exr

_NAME = re.compile(r"(.*?)[._ -]*?([0-9]{1,9})\.exr", re.IGNORECASE | re.DOTALL)


@dataclass(frozen=True)
class NumberedFiles:
    """frames: number -> stem -> file. done: what was done to files as they were read."""

    folder: Path
    frames: Mapping[int, Mapping[str, Path]]
    done: dict[str, dict[Path, None]] = field(default_factory=dict, compare=False)

    def paths(self, i: int) -> list[Path]:
        return list(self.frames[i].values())

    def read(self, i: int) -> dict[str, np.ndarray]:
        """Channel -> (h, w) image of a frame.

        Raises:
            InputError: as `read_any_exr`, or the files of a frame have several sizes.
        """
        images: dict[str, np.ndarray] = {}
        several = len({stem for files in self.frames.values() for stem in files}) > 1
        for stem, path in self.frames[i].items():
            planes = read_any_exr(
                path, lambda what, path=path: self.done.setdefault(what, {}).setdefault(path))
            size, first = next(iter(planes.values())).shape, next(iter(images.values()), None)
            if first is not None and first.shape != size:
                raise InputError(f"{path} is {size[1]}x{size[0]} pixels, other files of frame {i} "
                                 f"are {first.shape[1]}x{first.shape[0]}")
            images |= {f"{stem}.{name}" if several and stem else name: image
                       for name, image in planes.items()}
        return images

    def notes(self) -> list[str]:
        """What a user should know of how files were read, so far."""
        return [f"{self.folder}: {what} ({len(paths)} files, as {next(iter(paths)).name})"
                for what, paths in self.done.items()]


def numbered_files(folder: Path) -> NumberedFiles:
    """The EXR files in a folder whose names end in a number.

    Raises:
        InputError: it is no folder, has none, or two files of one stem and number.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder")
    frames: dict[int, dict[str, Path]] = {}
    for path in sorted(folder.iterdir()):
        if (match := _NAME.fullmatch(path.name)) and not path.name.startswith("."):
            other = frames.setdefault(int(match[2]), {}).setdefault(match[1], path)
            if other != path:
                raise InputError(f"{folder} has both {other.name} and {path.name}: keep one of "
                                 "them")
    if not frames:
        raise InputError(f"{folder} has no EXR files with a number at the end of their names, as "
                         "beauty_0001.exr")
    return NumberedFiles(folder, dict(sorted(frames.items())))
