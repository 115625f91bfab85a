"""Frames of a data set's sequences: decoded each time, or kept as memory maps.

In the cache there is an .npy file for each channel of each render, all frames in one, in the type
that the sequence stores. It is named after the hash of the sequence's files: of one that was made
anew nothing old is read. Results of methods, which may be made anew while the frames stay, are
decoded each time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from onespp.datasets.folder import DataSet
from onespp.render.channels import CHANNELS
from onespp.render.errors import InputError
from onespp.render.files.atomic import replacing
from onespp.render.files.sequence import FrameSequence

from .motion import Matrices

REFERENCE, HALF = "reference", "reference-half"
RESULT = "denoised/"  # and its name: what a method has made of the frames
_MOST_OPEN = 4096
MATRICES = ("camera_from_world", "screen_from_world", "world_from_object")


@dataclass(frozen=True)
class Store:
    """Where frames come from.

    Attributes:
        cache: a folder for memory maps, or None. digests: of sequences that were read.
    """

    data: DataSet
    cache: Path | None = None
    digests: dict[int, str] = field(default_factory=dict)

    def images(self, number: int, k: int, i: int, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Channels of frame i of the k-th render of a sequence, (h, w) or (h, w, c), whole.

        `REFERENCE` is the reference, `HALF` its first half minus itself, `RESULT` and a name what
        `onespp denoise` has made.
        """
        sequence = _sequence(self.data, number, k)
        found = {name: sequence.read_result(name.removeprefix(RESULT), i) for name in names
                 if name.startswith(RESULT)}
        names = [name for name in names if name not in found]
        if self.cache is not None:
            return {**found, **{name: array[i] for name, array in self._mapped(
                number, k, names).items()}}
        return {**found, **_decoded(sequence, i, names)}

    def matrices(self, number: int, i: int) -> Matrices:
        """Of frame i."""
        if self.cache is None:
            return Matrices(*_sequence(self.data, number, 0).read_matrices(i))
        return Matrices(*(np.array(a[i]) for a in self._mapped(number, 0, MATRICES).values()))

    def _mapped(self, number: int, k: int, names: Sequence[str]) -> dict[str, np.ndarray]:
        assert self.cache is not None
        if number not in self.digests:
            made = self.data.made(number)
            if made is None:
                raise InputError(f"{self.data.place(number)} is not whole: run `onespp dataset` "
                                 "again")
            self.digests[number] = made.digest[:24]
        paths = {name: self.cache / f"{self.digests[number]}-{k}-{name}.npy" for name in names}
        missing = [name for name, path in paths.items() if not path.exists()]
        for name, array in (whole(self.data, number, k, missing).items() if missing else ()):
            with replacing(paths[name]) as temporary, open(temporary, "wb") as file:
                np.save(file, array, allow_pickle=False)
        try:
            return {name: _opened(path) for name, path in paths.items()}
        except (OSError, ValueError) as error:
            raise InputError(f"a file of the cache {self.cache} is damaged ({error}): delete it"
                             ) from error


@lru_cache(_MOST_OPEN)
def _opened(path: Path) -> np.ndarray:
    """A memory map: one a process, for it cannot be sent to another one."""
    return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))


def _sequence(data: DataSet, number: int, k: int) -> FrameSequence:
    return _opened_sequence(data.place(number) / f"seed{k}")


@lru_cache(_MOST_OPEN)
def _opened_sequence(folder: Path) -> FrameSequence:
    return FrameSequence.open(folder)


def whole(data: DataSet, number: int, k: int, names: Sequence[str]) -> dict[str, np.ndarray]:
    """All frames of channels, or of `MATRICES`, of a render, in the types that files have."""
    sequence = _sequence(data, number, k)
    found: dict[str, np.ndarray] = {}
    if set(names) & {*MATRICES}:
        parts = zip(*(sequence.read_matrices(i) for i in sequence.frames))
        found = {name: np.stack(part) for name, part in zip(MATRICES, parts) if name in names}
    images = [name for name in names if name not in MATRICES]
    frames = [_decoded(sequence, i, images) for i in sequence.frames] if images else []
    for name in images:
        array = np.stack([frame[name] for frame in frames])
        stored = name in sequence.manifest.channels and CHANNELS[name].is_half(
            sequence.manifest.half)
        found[name] = array.astype(np.float16) if stored or name == HALF else array
    return found


def _decoded(sequence: FrameSequence, i: int, names: Sequence[str]) -> dict[str, np.ndarray]:
    truth = [name for name in names if name in (REFERENCE, HALF)]
    channels = [name for name in names if name not in truth]
    found = dict(sequence.read_frame(i, channels).images) if channels else {}
    if truth:
        reference = sequence.read_reference(i)
        found[REFERENCE] = reference.color
        if HALF in truth:
            if reference.parts is None:
                raise InputError(f"{sequence.folder} has references without halves: render them "
                                 "again")
            half = (reference.parts[0] + reference.parts[1]) / 2 - reference.color
            found[HALF] = half.astype(np.float16).astype(np.float32)  # as it is stored
    return found
