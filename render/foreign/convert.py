"""Frames of another renderer as a sequence: what is there, in our spaces.

Symbols: z depth, t distance along the ray, f focal length in pixels, (x, y) a pixel's centre from
the middle of the screen; z = t / sqrt(1 + (x^2 + y^2) / f^2).

Where positions are given, the camera follows from them (`camera_of_positions.py`), and depth from
both: still surfaces are then found again exactly, and moving ones where `motion` says. Without, a
camera is fitted to depth and normals (`render/guides_camera.py`), and motion is all that tells
where a surface was; without that, too, surfaces stay where they are on the screen.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from onespp.render.errors import InputError
from onespp.render.files.json_file import checked
from onespp.render.files.manifest import Manifest
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.frame import Frame
from onespp.render.games202.layout import gaps

from .camera_of_positions import FEWEST, camera_of_positions
from .channel_maps import COMPONENTS, NONE, channel_map, stacked
from .numbered_files import NumberedFiles, numbered_files

FARTHEST = 1e9  # Blender has 1e10 where there is nothing
_MOST_OBJECTS = 1 << 16
_TOLD = {
    "albedo": "texture is filtered with the light",
    "normal": "every method but a few needs them: surfaces are taken to face the camera",
    "depth": "every method but a few needs it: all is taken to be at one depth",
    "id": "all is one object",
}
"""What it means that something is not there."""


@dataclass(frozen=True)
class Conventions:
    """What the files do not say.

    Attributes:
        layout: one of `channel_maps.LAYOUTS`. channels: name -> source, see there.
        fov: degrees across the image's width, which turns distances into depths.
        motion_from: whether `motion` is where a surface is now, seen from where it was
            ("previous"), instead of the way back ("current").
        motion_up: whether its y points up; None: as the layout has it.
    """

    layout: str = "auto"
    channels: Mapping[str, str] = field(default_factory=dict)
    fov: float | None = None
    motion_from: str = "current"
    motion_up: bool | None = None


def import_foreign(folder: Path | str, out: Path | str, conventions: Conventions | None = None, *,
                   reference: Path | None = None, fps: float = 24.0, overwrite: bool = False,
                   command: str = "",
                   tell: Callable[[str], None] = lambda note: None) -> FrameSequence:
    """Read all frames of a folder of EXR files into a new sequence at `out`.

    Args:
        reference: folder of EXR files with the frames' ground truth, of the same numbers.
        command: the command line, for the manifest.
        tell: called with a sentence on what a user should know.

    Raises:
        InputError: no frames, or a file of one is missing, damaged, or disagrees with the rest;
            of a sequence that was begun anew nothing is left.
    """
    conventions = conventions or Conventions()
    if conventions.fov is not None and not 1 <= conventions.fov < 180:
        raise InputError(f"--fov is {conventions.fov:g} degrees: use 1 to less than 180")
    files = numbered_files(Path(folder))
    truth = None if reference is None else numbered_files(Path(reference))
    reader = _Reader(files, conventions)
    first = reader.read(next(iter(files.frames)), {})
    objects = _objects(reader)
    new = not (Path(out) / "manifest.json").exists()
    sequence = FrameSequence.create(out, checked(
        Manifest, f"the sequence to make of {folder}", source="foreign",
        scene=sequence_name(Path(folder)), fingerprint=_digest(repr(conventions), files, truth),
        frames=tuple(files.frames), width=first.width, height=first.height, fps=fps, seed=None,
        channels=tuple(first.images), commands=(command,) if command else (),
        objects=tuple(f"object_{number}" for number in objects) or ("object_0",),
        moving=()), overwrite)
    try:
        for i in files.frames:
            if not sequence.has_frame(i):
                sequence.write_frame(reader.read(i, objects), {"scene": sequence.manifest.scene})
        if truth is not None:
            _take_references(truth, sequence, conventions, tell)
    except InputError:  # a mended file would make another sequence, which this one would refuse
        if new:
            sequence.remove()
        raise
    for sentence in (*reader.notes(), *(truth.notes() if truth is not None else ())):
        tell(sentence)
    for a, b in gaps(sequence.frames):
        tell(f"there is no frame between {a} and {b}: methods with a history take {b} for the "
             f"frame after {a}")
    return sequence


class _Reader:
    """Reads frames, all by the map of the first."""

    def __init__(self, files: NumberedFiles, conventions: Conventions) -> None:
        self.files, self.conventions = files, conventions
        number = next(iter(files.frames))
        images = files.read(number)
        self.size = next(iter(images.values())).shape
        with _naming(files, number):
            self.map = channel_map(images, conventions.layout, conventions.channels)
            self.solved = "position" in self.map.channels
            if "distance" in self.map.channels and not self.solved and conventions.fov is None:
                raise InputError(
                    "has distances along the rays and no positions: say how wide the camera sees, "
                    "as --fov 39.6 (degrees across the image's width), or write depth or positions")

    def read(self, i: int, objects: Mapping[int, int]) -> Frame:
        """A frame; objects: number in the files -> ID, empty while they are counted."""
        images = self.files.read(i)
        with _naming(self.files, i):
            return self._frame(i, self._stacks(images), objects)

    def numbers(self, i: int) -> np.ndarray:
        """The numbers of objects that a frame shows."""
        images = self.files.read(i)
        with _naming(self.files, i):
            stacks = self._stacks(images)
            return np.unique(stacks["id"][_shown(stacks, self.size)])

    def notes(self) -> list[str]:
        channels = self.map.channels
        found = [f"{name} is {', '.join(sources)}" for name, sources in channels.items()]
        told = [f"took from {self.files.folder}: {'; '.join(found)}", *self.files.notes()]
        missing = [name for name in _TOLD if name not in channels
                   and not (name == "depth" and {"distance", "position"} & set(channels))]
        told += [f"there is no {name}: {_TOLD[name]}" for name in missing]
        if not self.solved:
            told.append("there are no positions: the camera is one that fits depth and normals"
                        + ("" if "motion" in channels else
                           ", and without motion surfaces are taken to stay on their pixels"))
        return told

    def _stacks(self, images: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """name of `channel_maps.COMPONENTS` -> (h, w) or (h, w, c)."""
        for sources in self.map.channels.values():
            if lacking := [name for name in sources if name not in images]:
                raise InputError(f"lacks the channel {lacking[0]}, which the first frame has")
        stacks = {name: stacked(images, sources) for name, sources in self.map.channels.items()}
        if (size := stacks["color"].shape[:2]) != self.size:
            raise InputError(f"is {size[1]}x{size[0]} pixels, the first frame is "
                             f"{self.size[1]}x{self.size[0]}")
        return stacks

    def _frame(self, i: int, stacks: dict[str, np.ndarray], objects: Mapping[int, int]) -> Frame:
        shown = _shown(stacks, self.size)
        camera = (camera_of_positions(stacks["position"], shown) if self.solved else None)
        if self.solved and camera is None:
            if (count := int(shown.sum())) < FEWEST:
                raise InputError(f"shows surfaces in {count} pixels, too few for positions to tell "
                                 "the camera: leave them out with --channel position=none, or the "
                                 "frame")
            raise InputError("has positions that no camera sees in these pixels, or all in one "
                             "plane: check that they are in world space, or leave them out with "
                             "--channel position=none")
        images = {"color": stacks["color"]}
        if "albedo" in stacks:
            images["albedo"] = np.where(shown[..., None], stacks["albedo"], 0)
        if "normal" in stacks:
            images["normal"] = _unit(stacks["normal"], shown)
        images["depth"] = np.where(shown, self._depth(stacks, camera), 0).astype(np.float32)
        if "normal" not in images:
            images["normal"] = _facing(camera, shown)
        images["id"] = _ids(stacks.get("id"), shown, objects)
        if "motion" in stacks:
            images["motion"] = self._motion(stacks["motion"])
        count = max(len(objects), 1)
        matrices = {} if camera is None else {"camera_from_world": camera[0],
                                              "screen_from_world": camera[1]}
        return Frame.from_arrays(index=i, world_from_object=np.tile(np.eye(4), (count, 1, 1)),
                                 **images, **matrices)

    def _depth(self, stacks: Mapping[str, np.ndarray],
               camera: tuple[np.ndarray, np.ndarray] | None) -> np.ndarray:
        if camera is not None:
            row, position = camera[1][3], stacks["position"].astype(np.float64)
            return np.where(np.isfinite(position), position, 0) @ row[:3] + row[3]
        if "depth" in stacks:
            return stacks["depth"]
        if "distance" not in stacks:
            return np.ones(self.size)
        assert self.conventions.fov is not None
        h, w = self.size
        f = w / 2 / math.tan(math.radians(self.conventions.fov) / 2)
        y, x = np.indices(self.size) + 0.5
        return stacks["distance"] / np.sqrt(1 + ((x - w / 2) ** 2 + (y - h / 2) ** 2) / f**2)

    def _motion(self, motion: np.ndarray) -> np.ndarray:
        up = self.map.up if self.conventions.motion_up is None else self.conventions.motion_up
        sign = -1.0 if self.conventions.motion_from == "previous" else 1.0
        signs = np.array([sign, -sign if up else sign], np.float32)
        return np.where(np.isfinite(motion), motion, 0) * signs


@contextmanager
def _naming(files: NumberedFiles, i: int) -> Iterator[None]:
    """Errors inside begin with what is wrong; whoever sees them is told the file of the frame."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{files.paths(i)[0]} {error}") from None


def _objects(reader: _Reader) -> dict[int, int]:
    """Number in the files -> ID, over all frames; empty where files have no IDs."""
    if "id" not in reader.map.channels:
        return {}
    numbers = sorted({float(n) for i in reader.files.frames for n in reader.numbers(i)})
    for number in numbers:
        if number != int(number) or len(numbers) > _MOST_OBJECTS:
            raise InputError(f"{reader.files.folder} has {len(numbers)} object IDs, as {number:g}: "
                             "write whole numbers, and samples of one object a pixel (no filter), "
                             "or leave them out with --channel id=none")
    return {int(number): k for k, number in enumerate(numbers)}


def _shown(stacks: Mapping[str, np.ndarray], size: tuple[int, ...]) -> np.ndarray:
    """(h, w) mask of pixels that show a surface: which may be said by any of the guides.

    Of positions alone, (0, 0, 0) is what renderers write where there is nothing.
    """
    shown = np.ones(size, bool)
    with np.errstate(invalid="ignore"):
        for name in ("depth", "distance"):
            if name in stacks:
                shown &= (stacks[name] > 0) & (stacks[name] < FARTHEST)
        if "normal" in stacks:
            shown &= np.abs(stacks["normal"]).sum(-1) > 0.1
        if "position" in stacks:
            farthest = np.abs(stacks["position"]).max(-1)
            shown &= farthest < FARTHEST
            if not {"depth", "distance", "normal"} & set(stacks):
                shown &= farthest > 0
        if "id" in stacks:
            shown &= np.isfinite(stacks["id"])
    return shown


def _unit(normal: np.ndarray, shown: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.where(shown[..., None], normal / np.maximum(length, 1e-20), 0)


def _facing(camera: tuple[np.ndarray, np.ndarray] | None, shown: np.ndarray) -> np.ndarray:
    """Normals of a plane that faces the camera."""
    back = np.array([0.0, 0, -1]) if camera is None else -camera[0][2, :3]
    return np.where(shown[..., None], back, 0)


def _ids(numbers: np.ndarray | None, shown: np.ndarray,
         objects: Mapping[int, int]) -> np.ndarray:
    if numbers is None or not objects:
        return np.where(shown, 0, -1).astype(np.int32)
    known = np.array(list(objects), np.float64)  # increasing
    return np.where(shown, np.searchsorted(known, numbers), -1).astype(np.int32)


def _take_references(truth: NumberedFiles, sequence: FrameSequence, conventions: Conventions,
                     tell: Callable[[str], None]) -> None:
    taken = [i for i in truth.frames if i in sequence.frames]
    if not taken:
        raise InputError(f"{truth.folder} has no file for any of the frames: number them alike")
    for i in taken:
        images = truth.read(i)
        with _naming(truth, i):
            color = stacked(images, _radiance(images, conventions))
            if color.shape[:2] != sequence.size:
                raise InputError(f"is {color.shape[1]}x{color.shape[0]} pixels, the frames are "
                                 f"{sequence.size[1]}x{sequence.size[0]}")
        sequence.write_reference(i, Reference(color, np.full_like(color, np.nan), None))
    tell(f"took {len(taken)} references from {truth.folder}; how many samples they have, and how "
         "noisy they are, is not known")


def _radiance(images: Mapping[str, np.ndarray], conventions: Conventions) -> tuple[str, ...]:
    """The channels of a reference's radiance: called as the frames', or by a layout's name."""
    alone = {name: NONE for name in COMPONENTS if name != "color"}
    own = alone | {k: v for k, v in conventions.channels.items() if k == "color"}
    for given in (own, alone):
        with suppress(InputError):
            return channel_map(images, conventions.layout, given).channels["color"]
    return channel_map(images, conventions.layout, own).channels["color"]


def _digest(conventions: str, *folders: NumberedFiles | None) -> str:
    digest = hashlib.sha256(conventions.encode())
    for files in folders:
        for paths in () if files is None else files.frames.values():
            for path in paths.values():
                digest.update(path.read_bytes())
    return digest.hexdigest()


def sequence_name(folder: Path) -> str:
    """What the sequence of a folder's frames is called."""
    return "".join(c for c in folder.resolve().name if c.isprintable()) or "import"
