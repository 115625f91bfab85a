"""A sequence on disk: frames, their references, and what denoisers made of them.

    manifest.json               what the sequence is (render/manifest.py)
    frames/0000.exr, .json      a frame's images (render/channels.py) and its matrices
    reference/0000.exr          ground truth: color, and how four parts of it differ
    denoised/METHOD/0000.exr    a result, R, G, B; run.json beside it says how it came to be
    scores.json, scores.csv, pictures/

File names come from frame numbers and checked names, never from what a file says. Every file is
renamed into place when it is complete, so that a file that exists is whole, and a command that was
interrupted goes on where it stopped. References, and what is kept of unfinished ones, cost hours
and are on the disk before they get their names: no loss of power turns one into an empty file.

A reference's four parts p_0 ... p_3 are in its file as m = color, their mean, in float32, and as
three differences in float16, of which p_0 = m + h + q_0, p_1 = m + h - q_0, p_2 = m - h + q_1 and
p_3 = m - h - q_1: those are noise, and half precision takes less than a thousandth of it. Beyond
65504 they are clipped. References of older versions have the variance of m in their place.
"""

from __future__ import annotations

import contextlib
import html
import io
import re
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from onespp.render.channels import CHANNELS, MOST_GROUPS, REFERENCE, SUN
from onespp.render.derived import available, sources, with_derived
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from onespp.show.html import WIDEST, strip_html
from onespp.show.pictures import fitted

from .atomic import read_bytes, write_bytes, write_text
from .cleaning import remove_files, remove_sequence
from .exr import read_exr, read_header, write_exr
from .frame_ranges import spread
from .json_file import format_json, read_json
from .manifest import Manifest, Run, check_result_name, first_difference
from .matrices import format_matrices, read_matrices

_HALF_MAX = float(np.finfo(np.float16).max)
_UNKNOWN = "unknown"
MOST_SHOWN = 24
"""Frames that a notebook shows of a sequence, spread evenly."""


@dataclass(frozen=True)
class Reference:
    """Ground truth of a frame.

    Attributes:
        color: (h, w, 3) float32, linear radiance. variance: (h, w, 3) float32, of that mean.
        spp: samples a pixel. Of a reference from elsewhere spp is None and the variance NaN.
        parts: (4, h, w, 3) float32, linear radiance: means of four independent sets of spp / 4
            samples, whose mean `color` is. None of a reference of the old kind, or from elsewhere.
            With parts the variance is estimated between them, so with 3 degrees of freedom:
            Var = 1/12 * sum_p (p - color)^2, the variance of one of 4 divided by 4.
    """

    color: np.ndarray
    variance: np.ndarray
    spp: int | None
    parts: np.ndarray | None = None

    @classmethod
    def of_parts(cls, parts: np.ndarray, spp: int) -> Reference:
        """From parts, (4, h, w, 3), rounded as when it is read from a file."""
        return cls._of_images(_differences(parts), spp)

    @classmethod
    def _of_images(cls, images: Mapping[str, np.ndarray], spp: int | None) -> Reference:
        """From the mean and the differences that a file has."""
        color, half, q0, q1 = (images[name] for name in REFERENCE)
        with np.errstate(invalid="ignore"):  # of infinite radiance
            a, b = color + half, color - half
            variance = (4 * half * half + 2 * q0 * q0 + 2 * q1 * q1) / 12
            return cls(color, variance, spp, np.stack([a + q0, a - q0, b + q1, b - q1]))

    @property
    def halves(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Two independent halves, the means of two parts each; None where there are no parts."""
        if self.parts is None:
            return None
        return (self.parts[0] + self.parts[1]) / 2, (self.parts[2] + self.parts[3]) / 2


@dataclass(frozen=True)
class FrameSequence:
    """A folder that holds a sequence. Make one with `create`, read one with `open`.

    All methods raise InputError for files that are missing, damaged or disagree with the
    manifest, and where the disk refuses a write.
    """

    folder: Path
    manifest: Manifest

    @classmethod
    def open(cls, folder: Path | str) -> FrameSequence:
        """The sequence in a folder; InputError if there is none."""
        folder = Path(folder)
        path = folder / "manifest.json"
        if not folder.exists():
            raise InputError(f"{folder} does not exist: make a sequence there with "
                             "`onespp render` or `onespp import`")
        if not path.exists():
            raise InputError(f"{folder} is not a sequence (it has no manifest.json): make one "
                             "with `onespp render` or `onespp import`")
        return cls(folder, read_json(path, Manifest))

    @classmethod
    def create(cls, folder: Path | str, manifest: Manifest,
               overwrite: bool = False) -> FrameSequence:
        """The sequence in a folder, begun, or continued where it has the same settings.

        When continued it keeps its files; its frames become the old and the new ones together,
        and `reference_spp` the new one unless that is None. `overwrite` removes the files of
        the sequence that is there (no others) and begins anew.

        Raises:
            InputError: the folder holds another sequence, or other files.
        """
        folder = Path(folder)
        path = folder / "manifest.json"
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder} is a file: choose another output folder")
        if path.exists():
            if overwrite:
                remove_sequence(folder)
            else:
                manifest = _continued(folder, read_json(path, Manifest), manifest)
        elif folder.exists() and any(not p.name.startswith(".") for p in folder.iterdir()):
            raise InputError(f"{folder} holds files that are no sequence: choose another "
                             "output folder")
        text = format_json(manifest)
        if not path.exists() or read_bytes(path) != text.encode():
            write_text(path, text)
        return cls(folder, manifest)

    @property
    def frames(self) -> list[int]:
        """Frame numbers, increasing."""
        return list(self.manifest.frames)

    @property
    def channels(self) -> tuple[str, ...]:
        """What its frames have: those that files hold, and those that follow from them."""
        return available(self.manifest.channels)

    @property
    def size(self) -> tuple[int, int]:
        """(height, width)."""
        return self.manifest.height, self.manifest.width

    def __iter__(self) -> Iterator[Frame]:
        """The frames that are there, in order, with all channels; one is read at a time."""
        return (self.read_frame(i) for i in self.frames if self.has_frame(i))

    def _repr_html_(self) -> str:
        """Input, results and references of the frame that a slider chooses, for a notebook."""
        frames = spread([i for i in self.frames if self.has_frame(i)], MOST_SHOWN)
        title = (f"{self.manifest.scene}: {len(self.frames)} frames of {self.manifest.width}x"
                 f"{self.manifest.height} in {self.folder}")
        if not frames:
            return f"<div><b>{html.escape(title)}</b>: no frames yet</div>"
        rows: dict[str, list[np.ndarray | None]] = {
            "input": [self.read_frame(i, ("color",))["color"] for i in frames]}
        for name in self.methods():
            rows[name] = [self.read_result(name, i) if self.has_result(name, i) else None
                          for i in frames]
        rows["reference"] = [self.read_reference(i).color if self.has_reference(i) else None
                             for i in frames]
        shown = {label: [None if image is None else fitted(image, WIDEST) for image in images]
                 for label, images in rows.items() if any(image is not None for image in images)}
        return strip_html(title, frames, shown)

    def has_frame(self, i: int) -> bool:
        return self._path("frames", i).exists() and self._path("frames", i, "json").exists()

    def frame_is_whole(self, i: int) -> bool:
        """Whether a frame is there and complete, by its matrices and header; decodes no pixels."""
        if not self.has_frame(i):
            return False
        try:
            self.read_matrices(i)
            header = read_header(self._path("frames", i))
        except InputError:
            return False
        needed = {c for name in self.manifest.channels for c in CHANNELS[name].exr}
        return (header.height, header.width) == self.size and needed <= header.channels.keys()

    def read_frame(self, i: int, channels: Iterable[str] | None = None) -> Frame:
        """A frame with the given channels (None: all that there are)."""
        self._check(i)
        names = list(self.channels if channels is None else channels)
        for name in names:
            if name not in self.channels:
                raise InputError(f"the sequence {self.folder} lacks the channel '{name}' "
                                 f"(it has {', '.join(self.channels)})")
        matrices = self.read_matrices(i)
        images = self._read(self._path("frames", i), sources(names, self.manifest.channels))
        for name in images:
            if CHANNELS[name].is_id:
                count = MOST_GROUPS if name == "group" else len(self.manifest.objects)
                images[name] = object_ids(self._path("frames", i), name, images[name], count)
        return with_derived(Frame(i, images, *matrices), names)

    def read_matrices(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """camera_from_world, screen_from_world, world_from_object of a frame, float64."""
        return read_matrices(self._path("frames", i, "json"), i, self.manifest.objects,
                             self.manifest.moving)

    def write_frame(self, frame: Frame, provenance: Mapping[str, str] | None = None) -> None:
        """Write a frame's images and matrices; `provenance` goes into the EXR header."""
        self._check(frame.index)
        objects = self.manifest.objects
        if frame.world_from_object.shape != (len(objects), 4, 4):
            raise InputError(f"frame {frame.index} has {len(frame.world_from_object)} objects, "
                             f"the manifest of {self.folder} lists {len(objects)}")
        images = {name: frame[name] for name in self.manifest.channels}
        write_text(self._path("frames", frame.index, "json"),
                   format_matrices(frame.index, frame.camera_from_world, frame.screen_from_world,
                                   dict(zip(objects, frame.world_from_object)),
                                   self.manifest.moving))
        self._write(self._path("frames", frame.index), images, provenance, half=self.manifest.half)

    def has_reference(self, i: int) -> bool:
        return self._path("reference", i).exists()

    def reference_spp(self, i: int) -> int | None:
        """Samples a pixel of a frame's reference, None where it came from elsewhere."""
        return self._spp(self._path("reference", i))

    def with_reference_spp(self) -> FrameSequence:
        """The same with its manifest's `reference_spp` as its references have it now."""
        known = [self.reference_spp(i) for i in self.frames if self.has_reference(i)]
        fewest = min((spp for spp in known if spp is not None), default=None)
        if fewest == self.manifest.reference_spp:
            return self
        manifest = self.manifest.model_copy(update={"reference_spp": fewest})
        write_text(self.folder / "manifest.json", format_json(manifest))
        return FrameSequence(self.folder, manifest)

    def read_reference(self, i: int) -> Reference:
        path = self._path("reference", i)
        there = read_header(path).channels
        if _has_any(there, REFERENCE[1:]):
            return Reference._of_images(self._read(path, REFERENCE), self._spp(path))
        if self.manifest.source == "render" or _has_any(there, ("variance",)):
            images = self._read(path, ("color", "variance"))
            return Reference(images["color"], images["variance"], self._spp(path))
        color = self._read(path, ("color",))["color"]  # another program's
        return Reference(color, np.full_like(color, np.nan), self._spp(path))

    def has_parts(self, i: int) -> bool:
        """Whether a frame's reference has independent parts, so is of no older version."""
        return _has_any(read_header(self._path("reference", i)).channels, REFERENCE[1:])

    def write_reference(self, i: int, reference: Reference,
                        provenance: Mapping[str, str] | None = None) -> None:
        self._check(i)
        images = ({"color": reference.color, "variance": reference.variance}
                  if reference.parts is None
                  else {**_differences(reference.parts), "color": reference.color})
        self._write(self._path("reference", i), images,
                    {**(provenance or {}), "spp": str(reference.spp or _UNKNOWN)}, durable=True)

    def has_partial(self, i: int) -> bool:
        return self._path("reference", i, "partial.npz").exists()

    def read_partial(self, i: int) -> dict[str, np.ndarray] | None:
        """State of an unfinished reference, None where there is none."""
        path = self._path("reference", i, "partial.npz")
        if not path.exists():
            return None
        data = io.BytesIO(read_bytes(path))
        try:
            if any(part.compress_type for part in zipfile.ZipFile(data).infolist()):
                raise ValueError("compressed, as we never do: what it holds may be huge")
            with np.load(data, allow_pickle=False) as arrays:
                return dict(arrays)
        except Exception as error:  # of damaged files these readers raise whatever comes up
            raise InputError(f"{path} is damaged: delete it, and the reference of frame {i} "
                             "starts anew") from error

    def write_partial(self, i: int, arrays: Mapping[str, np.ndarray | int]) -> None:
        """Keep the state of an unfinished reference beside where it will be."""
        self._check(i)
        stream = io.BytesIO()
        # (A positional dictionary would be one pickled array.)
        np.savez(stream, allow_pickle=False,
                 **{name: np.asarray(array) for name, array in arrays.items()})
        write_bytes(self._path("reference", i, "partial.npz"), stream.getvalue(), durable=True)

    def remove_partial(self, i: int) -> None:
        self._path("reference", i, "partial.npz").unlink(missing_ok=True)

    def methods(self) -> list[str]:
        """Names of the methods that ran, sorted."""
        return sorted(path.parent.name for path in self.folder.glob("denoised/*/run.json"))

    def has_result(self, method: str, i: int) -> bool:
        return self._result(method, i).exists()

    def read_result(self, method: str, i: int) -> np.ndarray:
        """(h, w, 3) float32 linear radiance."""
        return self._read(self._result(method, i), ("color",))["color"]

    def write_result(self, method: str, i: int, image: np.ndarray,
                     provenance: Mapping[str, str] | None = None) -> None:
        self._check(i)
        self._write(self._result(method, i), {"color": image}, provenance)

    def read_run(self, method: str) -> Run:
        return read_json(self._result_folder(method) / "run.json", Run)

    def write_run(self, method: str, run: Run) -> None:
        write_text(self._result_folder(method) / "run.json", format_json(run))

    def remove_results(self, method: str) -> None:
        """Remove a method's results and what they say about themselves."""
        remove_files(self.folder, self._result_folder(method))

    def remove(self) -> None:
        """Remove the whole sequence, and its folder if that holds nothing else."""
        remove_sequence(self.folder)
        (self.folder / "manifest.json").unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # not empty
            self.folder.rmdir()

    def _check(self, i: int) -> None:
        if i not in self.manifest.frames:
            raise InputError(f"{self.folder} has no frame {i}: its frames are "
                             f"{self.manifest.model_dump()['frames']}")

    def _path(self, kind: str, i: int, suffix: str = "exr") -> Path:
        return self.folder / kind / f"{i:04d}.{suffix}"

    def _result_folder(self, method: str) -> Path:
        return self.folder / "denoised" / check_result_name(method)

    def _result(self, method: str, i: int) -> Path:
        return self._result_folder(method) / f"{i:04d}.exr"

    def _read(self, path: Path, names: Iterable[str]) -> dict[str, np.ndarray]:
        rows = [CHANNELS[name] for name in names]
        planes, _ = read_exr(path, [c for row in rows for c in row.exr], self.size)
        return {row.name: _joined([planes[c] for c in row.exr]) for row in rows}

    def _write(self, path: Path, images: Mapping[str, np.ndarray],
               header: Mapping[str, str] | None, durable: bool = False,
               half: bool = False) -> None:
        planes = {}
        for name, image in images.items():
            row = CHANNELS[name]
            expected = self.size + ((row.components,) if row.components > 1 else ())
            if image.shape != expected:
                raise InputError(f"{path} could not be written because '{name}' has shape "
                                 f"{image.shape}, expected {expected}")
            image = _half(image) if row.is_half(half) else image.astype(np.float32)
            planes.update(zip(row.exr, np.moveaxis(np.atleast_3d(image), 2, 0)))
        write_exr(path, planes, header, durable)

    def _spp(self, path: Path) -> int | None:
        unsaid = "" if self.manifest.source == "render" else _UNKNOWN
        text = read_header(path).attributes.get("spp", unsaid)
        if text == _UNKNOWN:
            return None
        if not re.fullmatch(r"[1-9][0-9]{0,8}", text):
            raise InputError(f"{path} does not say its samples a pixel ('spp' in its header): "
                             "render the reference again")
        return int(text)


def _has_any(there: Iterable[str], names: Iterable[str]) -> bool:
    """Whether a file's channels hold a part of any of these of ours."""
    return not {*there}.isdisjoint(c for name in names for c in CHANNELS[name].exr)


def _half(image: np.ndarray) -> np.ndarray:
    """float16, clipped to what it holds."""
    return np.clip(image, -_HALF_MAX, _HALF_MAX).astype(np.float16)


def _differences(parts: np.ndarray) -> dict[str, np.ndarray]:
    """Mean and differences of four parts, float32, rounded as a file has them."""
    p = parts.astype(np.float64)
    with np.errstate(invalid="ignore"):  # of infinite radiance
        images = {"half": (p[0] + p[1] - p[2] - p[3]) / 4, "quarter0": (p[0] - p[1]) / 2,
                  "quarter1": (p[2] - p[3]) / 2}
        images = {name: _half(image).astype(np.float32) for name, image in images.items()}
        return {"color": p.mean(0).astype(np.float32), **images}


def object_ids(path: Path, name: str, image: np.ndarray, count: int) -> np.ndarray:
    """The image `name` of a file, of object IDs, as int32.

    Kernels index with it unchecked, so all but the whole numbers -1 to count - 1 are refused here,
    and `SUN` where it may be.
    """
    least = SUN if name == "light_id" else -1
    if not ((image >= least) & (image < count) & (image == np.floor(image))).all():
        raise InputError(f"{path} has object IDs other than the whole numbers {least} to "
                         f"{count - 1} in '{name}': make it again")
    return image.astype(np.int32)


def another(folder: Path, what: str, detail: str) -> str:
    """Why a folder's sequence cannot be continued: one sentence."""
    return (f"{folder} holds a sequence with another {what}{detail}: use --overwrite to replace "
            "it, or another --out")


def _joined(planes: list[np.ndarray]) -> np.ndarray:
    """(h, w) or (h, w, c) float32 of one channel's planes."""
    if len(planes) == 1:
        return planes[0].astype(np.float32)
    image = np.empty((*planes[0].shape, len(planes)), np.float32)
    for c, plane in enumerate(planes):
        image[..., c] = plane
    return image


def _continued(folder: Path, old: Manifest, new: Manifest) -> Manifest:
    key = first_difference(old, new)
    if key is not None:
        a, b = getattr(old, key), getattr(new, key)
        detail = f" ({a} there, {b} here)" if len(f"{a}{b}") < 100 else ""
        if key == "fingerprint":
            key, detail = "content", " (what it was made from has changed)"
        elif key == "tracing":
            key, detail = "kind of frames", (" (another version of onespp made them, and this one "
                                             "puts other values into theirs)")
        raise InputError(another(folder, key, detail))
    frames = tuple(sorted({*old.frames, *new.frames}))
    with_references = old if new.reference_spp is None else new
    return old.model_copy(update={
        "frames": frames, "later": old.later | new.later,
        "reference_spp": with_references.reference_spp,
        "commands": tuple(dict.fromkeys((*old.commands, *new.commands))),
        "reference_filter": with_references.reference_filter})
