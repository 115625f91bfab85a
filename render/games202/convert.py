"""The layout of the GAMES202 denoising assignment, read and written.

| file                                     | content                                            |
| ---------------------------------------- | -------------------------------------------------- |
| beauty_%d, normal_%d, position_%d (.exr) | float32 channels R, G, B (x, y, z)                 |
| depth_%d, ID_%d (.exr)                   | one float32 channel Y                              |
| matrix_%d.mat                            | int32 n, then n + 2 row-major float32 4x4 matrices |
|                                          | for column vectors, little-endian: world from      |
|                                          | object by ID, camera from world, screen from world |
| result_%d.exr                            | what a program makes of it, channels R, G, B, half |

Frames count from 0, unpadded (an import takes more names, see `layout.py`). Screen: x
right, y down, pixel centres at + 0.5, fourth component the depth, which is camera-space z: as in
`render/frame.py`. Background: ID -1, normal, depth and beauty 0, position the camera's origin.

Their camera space is free (the assignment's own has y up and is left-handed). Nothing but z is
ever used of it, so an import keeps what it finds, and an export has x right, y down, z forward.
An export rounds matrices to float32; an import loses nothing, and exports to the same values.

What an import cannot know is null in its manifest: seed, samples a pixel, estimator, sampler. A
gap in the frame numbers is kept: matrices say what moved from the one frame to the other, so
history is carried over it as it is over a stride (`--frames 0:32:2`).
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from onespp.render.errors import InputError
from onespp.render.files.atomic import all_or_none, read_bytes, write_bytes
from onespp.render.files.exr import read_exr, read_header, write_exr
from onespp.render.files.frame_ranges import format_frames
from onespp.render.files.json_file import checked
from onespp.render.files.manifest import Manifest, Run, check_result_name
from onespp.render.files.sequence import FrameSequence, Reference, object_ids
from onespp.render.frame import Frame

from .conventions import check_frame, check_motion
from .layout import STEMS, Found, find_files, gaps, numbered

_RGB = ("R", "G", "B")
_FILES = {"color": ("beauty", _RGB), "normal": ("normal", _RGB), "position": ("position", _RGB),
          "depth": ("depth", ("Y",)), "id": ("ID", ("Y",))}
_MOST_OBJECTS = 1 << 16
_MATRIX = 64  # bytes
_CHECKED = 6  # frames whose conventions are checked before anything is written
RESULTS = "result"
"""The name of results that are found beside frames."""


def import_games202(folder: Path | str, out: Path | str, *, scene: str | None = None,
                    fps: float = 24.0, overwrite: bool = False, command: str = "",
                    check: bool = True,
                    tell: Callable[[str], None] = lambda note: None) -> FrameSequence:
    """Read all frames of a folder in the assignment's layout into a new sequence at `out`.

    Results and references beside the frames come along (`layout.py`): results as those of
    `RESULTS`, references with unknown samples and variance.

    Args:
        command: the command line, for the manifest.
        check: refuse frames of other conventions (`conventions.py`).
        tell: called with a sentence on what a user should know, as gaps in the numbers.

    Raises:
        InputError: no frames, or a file of one is missing, damaged, or disagrees with the rest;
            of a sequence that was begun anew nothing is left.
    """
    folder = Path(folder)
    found = find_files(folder)
    frames = found.frames
    header = read_header(found.file("beauty", frames[0]))
    size = header.height, header.width
    objects = len(read_mat(found.file("matrix", frames[0]))) - 2
    digest = hashlib.sha256()
    for i in frames:  # before anything is written
        _check_files(found, i, size, objects)
        for stem in STEMS:
            digest.update(found.file(stem, i).read_bytes())
    for path in (*found.results.values(), *found.references.values()):
        _check_image(path, _RGB, size, "the first frame's beauty")
    if check:
        _check_conventions(found, size, objects)
    name = scene or found.name
    digits = len(str(objects - 1))
    new = not (Path(out) / "manifest.json").exists()
    sequence = FrameSequence.create(out, checked(
        Manifest, f"the sequence to make of {folder}", source="games202", scene=name,
        fingerprint=digest.hexdigest(), frames=tuple(frames), width=header.width,
        height=header.height, fps=fps, seed=None, channels=tuple(_FILES),
        commands=(command,) if command else (),
        objects=tuple(f"object_{i:0{digits}d}" for i in range(objects))), overwrite)
    negative = []
    try:
        for i in frames:
            if not sequence.has_frame(i):
                frame = _read_frame(found, i, size, objects)
                if check:
                    _check_convention(found, frame)
                if (frame["color"] < 0).any():
                    negative.append(i)
                sequence.write_frame(frame, {"scene": name})
        _tell_negative("beauty", negative, tell)
        for a, b in gaps(frames):
            tell(f"there is no frame between {a} and {b}: methods with a history take {b} for the "
                 f"frame after {a}")
        _take_references(found, sequence, tell)
        _take_results(found, sequence, tell)
    except InputError:  # a mended file would make another sequence, which this one would refuse
        if new:
            sequence.remove()
        raise
    return sequence


def _check_conventions(found: Found, size: tuple[int, int], objects: int) -> None:
    """Of a few frames, spread, and of the motion from one to the next."""
    frames = found.frames
    step = -(-len(frames) // _CHECKED)
    for i, before in zip(frames[::step], [None, *frames][::step]):
        frame = _read_frame(found, i, size, objects)
        _check_convention(found, frame)
        if before is not None:
            _check_convention(found, frame, _read_frame(found, before, size, objects))


def _check_convention(found: Found, frame: Frame, before: Frame | None = None) -> None:
    try:
        if before is None:
            check_frame(frame)
        else:
            check_motion(before, frame)
    except InputError as error:
        raise InputError(f"frame {frame.index} of {found.folder} {error} (--no-check takes frames "
                         "as they are)") from None


def _take_references(found: Found, sequence: FrameSequence, tell: Callable[[str], None]) -> None:
    taken = [i for i in found.references if i in sequence.frames]
    negative = []
    for i in taken:
        color = _image(found.references[i], _RGB, sequence.size)
        if (color < 0).any():
            negative.append(i)
        sequence.write_reference(i, Reference(color, np.full_like(color, np.nan), None))
    if taken:
        tell(f"took {len(taken)} references from {found.references[taken[0]].parent}; how many "
             "samples they have, and how noisy they are, is not known")
    _tell_negative("reference", negative, tell)
    _tell_strangers("references", found.references, sequence, tell)


def _take_results(found: Found, sequence: FrameSequence, tell: Callable[[str], None]) -> None:
    taken = [i for i in found.results if i in sequence.frames]
    if taken:
        sequence.remove_results(RESULTS)
        for i in taken:
            sequence.write_result(RESULTS, i, _image(found.results[i], _RGB, sequence.size))
        sequence.write_run(RESULTS, _run_of_files(found.results[taken[0]].parent))
        tell(f"took {len(taken)} results from {found.results[taken[0]].parent}, as those of "
             f"the method '{RESULTS}'")
    _tell_strangers("results", found.results, sequence, tell)


def _tell_negative(what: str, frames: list[int], tell: Callable[[str], None]) -> None:
    """As a renderer's filter with negative lobes makes it, or a difference of images."""
    if frames:
        tell(f"the {what} has negative radiance in frames {format_frames(frames)}: methods take it "
             "as it is, scores as black")


def _tell_strangers(what: str, files: Mapping[int, Path], sequence: FrameSequence,
                    tell: Callable[[str], None]) -> None:
    strangers = [i for i in files if i not in sequence.frames]
    if strangers:
        tell(f"left out {what} without a frame: {format_frames(strangers)}")


def _run_of_files(folder: Path) -> Run:
    return Run(method="files", parameters={"source": f"result files in {folder.resolve().name}"})


def export_games202(sequence: FrameSequence, folder: Path | str) -> list[Path]:
    """Write a sequence's frames in the assignment's layout; the files written.

    Frames are numbered from 0 in the sequence's order. All are written, or none.

    Raises:
        InputError: the sequence lacks a channel or a frame, or the disk refuses.
    """
    folder = Path(folder)
    if folder.is_dir() and max(numbered(folder, "beauty"), default=0) >= len(sequence.frames):
        raise InputError(f"{folder} holds frames of a longer sequence, which would be taken for "
                         "this one's: choose another folder")
    if missing := [i for i in sequence.frames if not sequence.has_frame(i)]:
        raise InputError(f"{sequence.folder} lacks frame {missing[0]}: render all frames first")
    with all_or_none() as written:
        for k, i in enumerate(sequence.frames):
            frame = sequence.read_frame(i, _FILES)
            for channel, (stem, names) in _FILES.items():
                image = frame[channel].astype(np.float32)
                if channel == "position" and sequence.manifest.source == "render":
                    origin = np.linalg.inv(frame.camera_from_world)[:3, 3]
                    image = np.where(frame["id"][..., None] < 0, origin.astype(np.float32), image)
                written.append(folder / f"{stem}_{k}.exr")
                planes = np.moveaxis(np.atleast_3d(image), 2, 0)
                write_exr(written[-1], dict(zip(names, planes)))
            written.append(folder / f"matrix_{k}.mat")
            write_mat(written[-1], np.concatenate([
                frame.world_from_object, frame.camera_from_world[None],
                frame.screen_from_world[None]]))
    return written


def import_result(sequence: FrameSequence, folder: Path | str, method: str) -> list[int]:
    """Take another program's `result_%d.exr` as the results of `method`; the frames found.

    Result k belongs to the sequence's k-th frame, as `export_games202` numbers them. How long
    the program took is not known.

    Raises:
        InputError: no results, more of them than frames, or one that is damaged or of another size.
    """
    folder, frames = Path(folder), sequence.frames
    check_result_name(method, sequence.methods())
    files = numbered(folder, "result")
    if not files:
        raise InputError(f"{folder} has no result_0.exr, result_1.exr ...")
    if (last := max(files)) >= len(frames):
        raise InputError(f"{files[last]} has no frame: {sequence.folder} "
                         f"has {len(frames)} frames, so results end at {len(frames) - 1}")
    try:
        for k, path in files.items():
            sequence.write_result(method, frames[k], _image(path, _RGB, sequence.size))
    except BaseException:  # the rest would stay without, or under an older run.json
        sequence.remove_results(method)
        raise
    sequence.write_run(method, _run_of_files(folder))
    return [frames[k] for k in files]


def export_results(sequence: FrameSequence, method: str, folder: Path | str) -> list[Path]:
    """Write a method's results as `result_%d.exr`, half, all or none; the files written.

    Raises:
        InputError: the method has no results, or the disk refuses.
    """
    with all_or_none() as written:
        for k, i in enumerate(sequence.frames):
            if sequence.has_result(method, i):
                image = np.clip(sequence.read_result(method, i), -65504, 65504).astype(np.float16)
                written.append(Path(folder) / f"result_{k}.exr")
                write_exr(written[-1], dict(zip(_RGB, np.moveaxis(image, 2, 0))))
    if not written:
        raise InputError(f"{sequence.folder} has no results of the method '{method}': "
                         "run `onespp denoise` first")
    return written


def read_mat(path: Path) -> np.ndarray:
    """The n + 2 matrices of a `.mat` file, (n + 2, 4, 4) float64; InputError if it is not one."""
    data = read_bytes(path)
    if len(data) < 4:
        raise InputError(f"{path} is {len(data)} bytes long, too short for a matrix file")
    count, = struct.unpack_from("<i", data)
    if not 0 < count <= _MOST_OBJECTS:
        raise InputError(f"{path} claims to hold matrices of {count} objects: "
                         "it is damaged or not a matrix file")
    if len(data) != 4 + (count + 2) * _MATRIX:
        raise InputError(f"{path} is {len(data)} bytes long, but {count} objects take "
                         f"{4 + (count + 2) * _MATRIX}: it is damaged or not a matrix file")
    matrices = np.frombuffer(data, "<f4", offset=4).reshape(-1, 4, 4)
    if not np.isfinite(matrices).all():
        raise InputError(f"{path} holds a number that is not finite: make it again")
    return matrices.astype(np.float64)


def write_mat(path: Path, matrices: np.ndarray) -> None:
    """Write (n + 2, 4, 4) matrices, rounded to float32; InputError where the disk refuses."""
    write_bytes(path, struct.pack("<i", len(matrices) - 2) + matrices.astype("<f4").tobytes())


def _check_files(found: Found, i: int, size: tuple[int, int], objects: int) -> None:
    """A frame's files are there, whole, and of the size and number of objects of the first."""
    for stem, names in _FILES.values():
        _check_image(found.file(stem, i), names, size, "the first frame's beauty")
    path = found.file("matrix", i)
    if (there := len(read_mat(path)) - 2) != objects:
        raise InputError(f"{path} holds matrices of {there} objects, "
                         f"the first frame's of {objects}")


def _check_image(path: Path, names: tuple[str, ...], size: tuple[int, int], other: str) -> None:
    header = read_header(path)
    if (header.height, header.width) != size:
        raise InputError(f"{path} is {header.width}x{header.height} pixels, {other} is "
                         f"{size[1]}x{size[0]}")
    if missing := [name for name in names if name not in header.channels]:
        raise InputError(f"{path} lacks the channel {missing[0]} "
                         f"(it has {', '.join(map(repr, header.channels))})")


def _image(path: Path, names: tuple[str, ...], size: tuple[int, int]) -> np.ndarray:
    """(h, w) or (h, w, 3) float32."""
    planes, _ = read_exr(path, names, size)
    image = np.stack([planes[name] for name in names], axis=-1).astype(np.float32)
    return image if len(names) > 1 else image[..., 0]


def _read_frame(found: Found, i: int, size: tuple[int, int], objects: int) -> Frame:
    images = {channel: _image(found.file(stem, i), names, size)
              for channel, (stem, names) in _FILES.items()}
    images["id"] = object_ids(found.file("ID", i), "id", images["id"], objects)
    matrices = read_mat(found.file("matrix", i))
    return Frame(i, images, matrices[-2], matrices[-1], matrices[:-2])
