"""The layout of the GAMES202 denoising assignment, read and written.

| file                                     | content                                            |
| ---------------------------------------- | -------------------------------------------------- |
| beauty_%d, normal_%d, position_%d (.exr) | float32 channels R, G, B (x, y, z)                 |
| depth_%d, ID_%d (.exr)                   | one float32 channel Y                              |
| matrix_%d.mat                            | int32 n, then n + 2 row-major float32 4x4 matrices |
|                                          | for column vectors, little-endian: world from      |
|                                          | object by ID, camera from world, screen from world |
| result_%d.exr                            | what a program makes of it, channels R, G, B, half |

Frames count from 0, unpadded. Screen: x right, y down, pixel centres at + 0.5, fourth component
the depth, which is camera-space z: as in `render/frame.py`. Background: ID -1, normal, depth and
beauty 0, position the camera's origin.

Their camera space is free (the assignment's own has y up and is left-handed). Nothing but z is
ever used of it, so an import keeps what it finds, and an export has x right, y down, z forward.
An export rounds matrices to float32; an import loses nothing, and exports to the same values.
"""

from __future__ import annotations

import hashlib
import re
import struct
from pathlib import Path

import numpy as np

from .atomic import all_or_none, read_bytes, write_bytes
from .errors import InputError
from .exr import read_exr, read_header, write_exr
from .frame import Frame
from .json_file import checked
from .manifest import Manifest, Run, check_name
from .sequence import Sequence, object_ids

_RGB = ("R", "G", "B")
_FILES = {"color": ("beauty", _RGB), "normal": ("normal", _RGB), "position": ("position", _RGB),
          "depth": ("depth", ("Y",)), "id": ("ID", ("Y",))}
_STEMS = (*(stem for stem, _ in _FILES.values()), "matrix")
_MOST_OBJECTS = 1 << 16
_MATRIX = 64  # bytes


def import_games202(folder: Path | str, out: Path | str, *, scene: str | None = None,
                    fps: float = 24.0, overwrite: bool = False, command: str = "") -> Sequence:
    """Read all frames of a folder in the assignment's layout into a new sequence at `out`.

    `command` is the command line, for the manifest.

    Raises:
        InputError: no frames, or a file of one is missing, damaged, or disagrees with the rest;
            of a sequence that was begun anew nothing is left.
    """
    folder = Path(folder)
    frames = sorted({i for stem in _STEMS for i in _numbers(folder, stem)})
    if not frames:
        raise InputError(f"{folder} has no beauty_0.exr, depth_0.exr ...: give a folder with "
                         "the input of the assignment")
    header = read_header(folder / f"beauty_{frames[0]}.exr")
    objects = len(read_mat(folder / f"matrix_{frames[0]}.mat")) - 2
    digest = hashlib.sha256()
    for i in frames:  # before anything is written
        _check_files(folder, i, (header.height, header.width), objects)
        for stem in _STEMS:
            digest.update((folder / f"{stem}_{i}{_suffix(stem)}").read_bytes())
    name = scene or "".join(c for c in folder.resolve().name if c.isprintable()) or "import"
    digits = len(str(objects - 1))
    new = not (Path(out) / "manifest.json").exists()
    sequence = Sequence.create(out, checked(
        Manifest, f"the sequence to make of {folder}", source="games202", scene=name,
        fingerprint=digest.hexdigest(), frames=tuple(frames), width=header.width,
        height=header.height, fps=fps, seed=None, channels=tuple(_FILES),
        commands=(command,) if command else (),
        objects=tuple(f"object_{i:0{digits}d}" for i in range(objects))), overwrite)
    try:
        for i in frames:
            if not sequence.has_frame(i):
                sequence.write_frame(_read_frame(folder, i, sequence), {"scene": name})
    except InputError:  # a mended file would make another sequence, which this one would refuse
        if new:
            sequence.remove()
        raise
    return sequence


def export_games202(sequence: Sequence, folder: Path | str) -> list[Path]:
    """Write a sequence's frames in the assignment's layout; the files written.

    Frames are numbered from 0 in the sequence's order. All are written, or none.

    Raises:
        InputError: the sequence lacks a channel or a frame, or the disk refuses.
    """
    folder = Path(folder)
    if folder.is_dir() and max(_numbers(folder, "beauty"), default=0) >= len(sequence.frames):
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


def import_result(sequence: Sequence, folder: Path | str, method: str) -> list[int]:
    """Take another program's `result_%d.exr` as the results of `method`; the frames found.

    Result k belongs to the sequence's k-th frame, as `export_games202` numbers them. How long
    the program took is not known.

    Raises:
        InputError: no results, more of them than frames, or one that is damaged or of another size.
    """
    folder, frames = Path(folder), sequence.frames
    check_name(method, "method")
    numbers = _numbers(folder, "result")
    if not numbers:
        raise InputError(f"{folder} has no result_0.exr, result_1.exr ...")
    if numbers[-1] >= len(frames):
        raise InputError(f"{folder}/result_{numbers[-1]}.exr has no frame: {sequence.folder} "
                         f"has {len(frames)} frames, so results end at {len(frames) - 1}")
    try:
        for k in numbers:
            image = _image(folder / f"result_{k}.exr", _RGB, sequence.size)
            sequence.write_result(method, frames[k], image)
    except BaseException:  # the rest would stay without, or under an older run.json
        sequence.remove_results(method)
        raise
    sequence.write_run(method, Run(method=method, parameters={"source": "games202 result files"}))
    return [frames[k] for k in numbers]


def export_results(sequence: Sequence, method: str, folder: Path | str) -> list[Path]:
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


def _suffix(stem: str) -> str:
    return ".mat" if stem == "matrix" else ".exr"


def _numbers(folder: Path, stem: str) -> list[int]:
    """The %d of the files stem_%d.exr (or .mat) in a folder, increasing."""
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder")
    name = re.compile(stem + r"_(0|[1-9][0-9]{0,5})" + re.escape(_suffix(stem)))
    matches = (name.fullmatch(path.name) for path in folder.iterdir())
    return sorted(int(match[1]) for match in matches if match)


def _check_files(folder: Path, i: int, size: tuple[int, int], objects: int) -> None:
    """A frame's files are there, whole, and of the size and number of objects of the first."""
    for stem, names in _FILES.values():
        path = folder / f"{stem}_{i}.exr"
        header = read_header(path)
        if (header.height, header.width) != size:
            raise InputError(f"{path} is {header.width}x{header.height} pixels, the first frame's "
                             f"beauty is {size[1]}x{size[0]}")
        if missing := [name for name in names if name not in header.channels]:
            raise InputError(f"{path} lacks the channel {missing[0]} "
                             f"(it has {', '.join(map(repr, header.channels))})")
    path = folder / f"matrix_{i}.mat"
    if (found := len(read_mat(path)) - 2) != objects:
        raise InputError(f"{path} holds matrices of {found} objects, "
                         f"the first frame's of {objects}")


def _image(path: Path, names: tuple[str, ...], size: tuple[int, int]) -> np.ndarray:
    """(h, w) or (h, w, 3) float32."""
    planes, _ = read_exr(path, names, size)
    image = np.stack([planes[name] for name in names], axis=-1).astype(np.float32)
    return image if len(names) > 1 else image[..., 0]


def _read_frame(folder: Path, i: int, sequence: Sequence) -> Frame:
    images = {channel: _image(folder / f"{stem}_{i}.exr", names, sequence.size)
              for channel, (stem, names) in _FILES.items()}
    path = folder / f"ID_{i}.exr"
    images["id"] = object_ids(path, images["id"], len(sequence.manifest.objects))
    matrices = read_mat(folder / f"matrix_{i}.mat")
    return Frame(i, images, matrices[-2], matrices[-1], matrices[:-2])
