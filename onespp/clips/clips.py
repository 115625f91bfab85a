"""Clips of a data set by their index: what a training loop reads.

A class with `__len__` and `__getitem__` is a data set for PyTorch's loader and a source
for Grain's.
A clip follows from (seed, epoch, index) alone, in any process and any order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np

from onespp.datasets.folder import DataSet
from onespp.datasets.plan import SPLITS, Plan
from onespp.render.channels import CHANNELS, LAYER, REPLAY, Group, channels_of
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence

from .motion import Matrices, motion_in_pixels
from .store import HALF, REFERENCE, RESULT, Store
from .view import Turn, seen_through

MOTION = "motion"
_LIGHT = (*channels_of(Group.RADIANCE), "specular",
          *(name for name in CHANNELS if name.startswith("unshadowed")))
_WITHOUT_NOISE = (*channels_of(Group.GUIDES), "roughness", MOTION, *LAYER)
_EVERY = 4  # pixels by which the mean motion of a crop is found


@dataclass(frozen=True)
class _Clip:
    """Frames before they are turned: images of each render, the crop's corner, and matrices."""

    images: list[list[dict[str, np.ndarray]]]
    corners: list[tuple[int, int]]
    matrices: list[Matrices]


class Clips:
    """Clips of frames that follow each other, cut out and turned about, as NumPy arrays.

    `clips[i]` is a dict: each of the channels, (frames, h, w) or (frames, h, w, c) float32, IDs
    int32; `reference`, or `halves` (2, frames, h, w, 3); `camera_from_world`, `screen_from_world`
    (frames, 4, 4) and `world_from_object` (frames, n, 4, 4) float64, by object ID, with as many
    identities behind as make all clips alike; `sequence`, `frame` and `seed`, where it is from.

    Matrices are those of the cut and turned picture: they project positions to its pixels. Frames
    are linear Rec. 709 radiance; `motion` is from a pixel's centre to where its surface was in the
    frame before, in pixels of that frame's crop, x right and y down, 0 in a sequence's first frame.

    Args:
        folder: of the data set, finished or not: sequences that are whole now.
        frames: of a clip. crop: pixels a side, (height, width), or None for whole frames; it
            follows the mean motion of what it shows.
        channels: of the channel table, those that follow from others too, and `motion`;
            `denoised/NAME` is the result of that name, which `onespp denoise` has made.
        split: "train", "validation" or "test".
        seed, epoch: of all that is random; see `set_epoch`.
        augment: random sequence starts, renders, crops, flips, quarter turns (of square crops), and
            exposure; without, crops are in the middle.
        exposure: the most stops that light is made brighter or darker.
        seeds: noisy renders of each frame; where there are several, channels that have noise are
            (seeds, frames, h, w, c).
        halves: independent halves of the reference in place of it, as for Noise2Noise.
        cache: a folder for memory maps, made as clips are read, each sequence once.

    Raises:
        InputError: no data set, nothing in the split, or what it does not have.

    Example:
        >>> import onespp, tempfile
        >>> folder = tempfile.mkdtemp()
        >>> _ = onespp.dataset("simple", folder, sequences=1, frames=2, size=(16, 24),
        ...                    reference_spp=16)
        >>> clips = onespp.Clips(folder, frames=2, crop=16, channels=("color", "depth"))
        >>> len(clips), clips[0]["color"].shape, clips[0]["reference"].shape
        (1, (2, 16, 16, 3), (2, 16, 16, 3))
    """

    def __init__(self, folder: Path | str, frames: int = 8,
                 crop: int | tuple[int, int] | None = 128,
                 channels: Sequence[str] = ("color", "albedo", "normal", "depth", MOTION),
                 split: str = "train", *, seed: int = 0, epoch: int = 0, augment: bool = True,
                 exposure: float = 1.0, seeds: int = 1, halves: bool = False,
                 cache: Path | str | None = None) -> None:
        data = DataSet.open(folder)
        if split not in SPLITS:
            raise InputError(f"split is {split!r}: use {', '.join(SPLITS)}")
        self.numbers = data.numbers(split)
        if not self.numbers:
            raise InputError(f"{folder} has no sequences of the split '{split}' (yet)")
        self.plan, self.split = data.plan, split
        self.seed, self.epoch, self.augment, self.exposure = seed, epoch, augment, exposure
        self.channels, self.halves = tuple(channels), halves
        self.frames, self.seeds = frames, seeds
        self.crop = _checked_crop(crop, self.plan)
        _check_count(frames, self.plan.frames, "frames")
        _check_count(seeds, self.plan.seeds, "seeds")
        self._store = Store(data, None if cache is None else Path(cache))
        sequences = [data.sequence(n) for n in self.numbers]
        self._objects = max(len(sequence.manifest.objects) for sequence in sequences)
        self._has_reference = bool(self.plan.reference_spp or self.plan.reference_error)
        self._check_channels(data, set.intersection(*({*s.channels} for s in sequences)))
        for name in self.channels:
            if name.startswith(RESULT):
                self._check_results(data, name.removeprefix(RESULT))

    def __len__(self) -> int:
        return len(self.numbers) * self._in_sequence

    def __getitem__(self, index: int) -> dict[str, Any]:
        if not -len(self) <= index < len(self):
            raise IndexError(f"clip {index} of {len(self)}")
        index = int(index) % len(self)
        number, window = divmod(index, self._in_sequence)
        number = self.numbers[number]
        random = np.random.default_rng((self.seed, self.epoch, index))
        first, renders = window * self.frames, [*range(self.seeds)]
        turn, stops = Turn(), 0.0
        if self.augment:
            first = int(random.integers(self.plan.frames - self.frames + 1))
            renders = random.permutation(self.plan.seeds)[:self.seeds].tolist()
            turn = Turn.number(int(random.integers(8 if self.crop[0] == self.crop[1] else 4)))
            stops = float(random.uniform(-self.exposure, self.exposure))
        clip = self._cut(number, first, renders, random)
        return {**self._turned(clip, turn, 2.0**stops), "sequence": np.int64(number),
                "frame": np.int64(first), "seed": np.array(renders)}

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return (f"Clips of {self.plan.name}: {len(self)} of {self.frames} frames of "
                f"{self.crop[1]}x{self.crop[0]} to {self.split}")

    def set_epoch(self, epoch: int) -> None:
        """Clips differ from epoch to epoch; call before a loader starts its workers."""
        self.epoch = epoch

    @property
    def _in_sequence(self) -> int:
        return max(1, self.plan.frames // self.frames)

    def _check_channels(self, data: DataSet, there: set[str]) -> None:
        """InputError where `there`, the channels that all sequences have, are too few."""
        needed = {*self.channels, "depth", "id"} - {MOTION}
        for name in (*self.channels, *sorted(needed)):
            if name not in there and name != MOTION and not name.startswith(RESULT):
                raise InputError(f"{data.folder} lacks the channel '{name}' in some sequence (all "
                                 f"have {', '.join(c for c in CHANNELS if c in there)})")
        if self.halves and not self._has_reference:
            raise InputError(f"{data.folder} has no references, so no halves of them")

    def _check_results(self, data: DataSet, name: str) -> None:
        """InputError where a sequence lacks a result of a frame."""
        for number in self.numbers:
            for k in range(self.plan.seeds):
                sequence = FrameSequence.open(data.place(number) / f"seed{k}")
                if not all(sequence.has_result(name, i) for i in sequence.frames):
                    raise InputError(f"{sequence.folder} has no result '{name}' of all frames: run "
                                     f"`onespp denoise {sequence.folder} --name {name}` with a "
                                     "method, and so for all sequences")

    def _cut(self, number: int, first: int, renders: list[int],
             random: np.random.Generator) -> _Clip:
        """Crops of the frames, along the mean motion of what they show."""
        size, (h, w) = (self.plan.height, self.plan.width), self.crop
        at = np.array([(size[0] - h) / 2, (size[1] - w) / 2])
        if self.augment:
            at = np.array([random.integers(size[0] - h + 1), random.integers(size[1] - w + 1)],
                          float)
        clip, before = _Clip([], [], []), None
        if first > 0:
            before = self._store.matrices(number, first - 1)
        for i in range(first, first + self.frames):
            matrices = self._store.matrices(number, i)
            images = [self._images(number, k, i, k == renders[0]) for k in renders]
            guides = images[0]
            if i > first and before is not None:
                y, x = _corner(at, size, self.crop)
                mean = _mean_motion(before, matrices, guides["depth"], guides["id"], (y, x),
                                    self.crop)
                at = at - mean
            y, x = _corner(at, size, self.crop)
            cut = [{name: image[y:y + h, x:x + w] for name, image in one.items()} for one in images]
            if MOTION in self.channels:
                cut[0][MOTION] = np.zeros((h, w, 2), np.float32)
                if before is not None:
                    moved = np.subtract((y, x), clip.corners[-1] if clip.corners else (y, x))
                    cut[0][MOTION] = (motion_in_pixels(before, matrices, cut[0]["depth"],
                                                       cut[0]["id"], (y, x))
                                      + moved[::-1].astype(np.float32))
            clip.images.append(cut)
            clip.corners.append((y, x))
            clip.matrices.append(matrices)
            before = matrices
        return clip

    def _images(self, number: int, k: int, i: int, first: bool) -> dict[str, np.ndarray]:
        names = {name for name in self.channels if name != MOTION
                 and (first or name not in _WITHOUT_NOISE)}
        found = dict(self._store.images(number, k, i, sorted(names | {"depth", "id"} if first
                                                             else names)))
        if first and self._has_reference:  # the first render has it
            found |= self._store.images(number, 0, i, [REFERENCE, *[HALF] * self.halves])
        return found

    def _turned(self, clip: _Clip, turn: Turn, brighter: float) -> dict[str, Any]:
        """The arrays of a clip."""
        world = turn.world(clip.matrices[0])
        seen = [seen_through(matrices, corner, self.crop, turn, world)
                for matrices, corner in zip(clip.matrices, clip.corners)]

        def stacked(name: str, k: int) -> np.ndarray:
            array = np.stack([cut[k][name] for cut in clip.images])
            array = turn.image(array, 1)
            if array.dtype.kind == "f":
                array = turn.vectors(name, array.astype(np.float32), world)
            if name in REPLAY:  # -1 says that there is no sample
                array = np.where(array < 0, array, array * np.float32(brighter))
            elif name in (*_LIGHT, REFERENCE, HALF) or name.startswith(RESULT):
                array = array * np.float32(brighter)
            return np.ascontiguousarray(array)

        found: dict[str, Any] = {}
        for name in self.channels:
            found[name] = (stacked(name, 0) if self.seeds == 1 or name in _WITHOUT_NOISE else
                           np.stack([stacked(name, k) for k in range(self.seeds)]))
        if self._has_reference:
            mean = stacked(REFERENCE, 0)
            if self.halves:
                half = stacked(HALF, 0)
                found["halves"] = np.stack([mean + half, mean - half])
            else:
                found["reference"] = mean
        objects = np.tile(np.eye(4), (len(seen), self._objects, 1, 1))
        for at, matrices in zip(objects, seen):
            at[:len(matrices.world_from_object)] = matrices.world_from_object
        return {**found, "camera_from_world": np.stack([m.camera_from_world for m in seen]),
                "screen_from_world": np.stack([m.screen_from_world for m in seen]),
                "world_from_object": objects}


def _checked_crop(crop: int | tuple[int, int] | None, plan: Plan) -> tuple[int, int]:
    """(height, width); InputError where frames are smaller, or it is none."""
    size = plan.height, plan.width
    if crop is None:
        return size
    h, w = crop if isinstance(crop, tuple) else (crop, crop)
    if not all(isinstance(side, Integral) and side >= 1 for side in (h, w)):
        raise InputError(f"crop is {crop!r}: use a number of pixels, (height, width), or None")
    if h > size[0] or w > size[1]:
        raise InputError(f"crop is {h} rows of {w} pixels, and frames have {size[0]} of {size[1]}: "
                         "use a smaller one, or None")
    return int(h), int(w)


def _check_count(count: int, most: int, name: str) -> None:
    if not isinstance(count, Integral) or not 1 <= count <= most:
        raise InputError(f"{name} is {count!r}, and sequences have {most}: use 1 to {most}")


def _corner(at: np.ndarray, size: tuple[int, int], crop: tuple[int, int]) -> tuple[int, int]:
    """The pixel at which a crop begins that would best begin at `at`."""
    y, x = (int(np.clip(round(float(a)), 0, s - c)) for a, s, c in zip(at, size, crop))
    return y, x


def _mean_motion(before: Matrices, now: Matrices, depth: np.ndarray, id: np.ndarray,
                 corner: tuple[int, int], crop: tuple[int, int]) -> np.ndarray:
    """(rows, columns) of what a crop shows; 0 at a cut, where nothing is followed."""
    (y, x), (h, w) = corner, crop
    some = slice(y, y + h, _EVERY), slice(x, x + w, _EVERY)
    motion = motion_in_pixels(before, now, depth[some], id[some], (y, x), _EVERY)
    mean = motion.mean(axis=(0, 1), dtype=np.float64)[::-1]
    return mean if (np.abs(mean) < np.divide(crop, 2)).all() else np.zeros(2)
