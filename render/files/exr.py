"""OpenEXR files, checked before they are decoded: ours, one scanline image of any named channels,
lossless; and those of other programs, tiled, in several parts or lossy.

ZIP compression: of the lossless ones that every viewer reads it makes the smallest files of noisy
frames, and decodes as fast as any.

The OpenEXR library trusts a header's size, returns partial images for truncated files, and tells
about damage on the terminal. So `exr_header.py` comes first, and only damage inside a compressed
chunk is left for the library to find. It reads by `OpenEXR.File`: the older `InputFile`, which is
deprecated, has worker threads read a Python stream without the interpreter's lock, and that ends
the process from Python 3.12 on.
"""

from __future__ import annotations

import io
import os
import struct
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from onespp.render.errors import InputError

from .atomic import read_bytes, write_bytes
from .exr_header import TYPES, Header, MalformedError, parse

MOST_NAMED = 24  # channels in one sentence


def write_exr(path: Path, channels: Mapping[str, np.ndarray],
              header: Mapping[str, str] | None = None, durable: bool = False) -> None:
    """Write an image: equal input gives equal bytes.

    Args:
        channels: name -> (h, w) array, stored in its own type (float32, float16 or uint32).
        header: string attributes.
        durable: wait for the disk, as `atomic.replacing`.

    Raises:
        InputError: shapes or types that cannot be stored, or the disk refuses.
    """
    import OpenEXR

    shapes = {image.shape for image in channels.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 2 or 0 in next(iter(shapes)):
        raise InputError(f"{path} could not be written because its channels have the shapes "
                         f"{sorted(shapes)}, not one (h, w)")
    for name, image in channels.items():
        if image.dtype not in TYPES:
            raise InputError(f"{path} could not be written because channel '{name}' is "
                             f"{image.dtype}: use float32, float16 or uint32")
    attributes = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage,
                  **(header or {})}
    stream = io.BytesIO()
    # The library writes into the dictionary it is given, so it gets one of its own.
    pixels = {name: np.ascontiguousarray(image) for name, image in channels.items()}
    OpenEXR.File(attributes, pixels, num_threads=_threads()).write(stream)
    write_bytes(path, stream.getvalue(), durable)


def read_exr(path: Path, channels: Iterable[str] | None = None,
             size: tuple[int, int] | None = None) -> tuple[dict[str, np.ndarray], Header]:
    """Read channels of an image.

    Args:
        channels: names to read (None: all).
        size: the (height, width) that the file must have (None: any).

    Returns:
        name -> (h, w) read-only array in the file's own type, and the header.

    Raises:
        InputError: not an EXR, of a kind not read here (tiled, multi-part, deep, lossy),
            incomplete, damaged, of another size, or without a channel that was asked for.
    """
    data = read_bytes(path)
    header, = _check(path, data)
    if size is not None and (header.height, header.width) != tuple(size):
        raise InputError(f"{path} is {header.width}x{header.height} pixels, "
                         f"expected {size[1]}x{size[0]}")
    names = list(header.channels if channels is None else channels)
    missing = [name for name in names if name not in header.channels]
    if missing:
        there = sorted(header.channels)
        more = f" and {len(there) - MOST_NAMED} more" if len(there) > MOST_NAMED else ""
        raise InputError(f"{path} lacks the channel {', '.join(missing[:MOST_NAMED])} "
                         f"(it has {', '.join(map(repr, there[:MOST_NAMED]))}{more})")
    decoded, = _decode(path, data, [header])
    return {name: decoded[name] for name in names}, header


def read_header(path: Path) -> Header:
    """The header of a complete image, without its pixels; InputError as `read_exr`."""
    return _check(path, read_bytes(path))[0]


def read_any_exr(path: Path, tell: Callable[[str], None] = lambda what: None
                 ) -> dict[str, np.ndarray]:
    """All channels of an image of any program: in any number of parts, tiled, lossy.

    Data windows are padded with 0, or cropped, to the display window. Of a stereo image the first
    view is taken.

    Args:
        tell: called with what was done of that.

    Returns:
        name -> (h, w) read-only array. In a file of several parts a channel without a layer is in
        that of its part's name; where several have channels of one name, those of all but the
        first are called PART.NAME.

    Raises:
        InputError: not an EXR, deep, of several resolutions, incomplete, damaged, or in parts of
            different sizes.
    """
    data = read_bytes(path)
    headers = _check(path, data, any_kind=True)
    sizes = list(dict.fromkeys(h.shown for h in headers))
    if len(sizes) > 1:
        texts = " and ".join(f"{w}x{h}" for h, w in sizes[:2])
        raise InputError(f"{path} has parts of {texts} pixels: save one size in a file")
    view = next((h.views[0] for h in headers if h.views), None)
    images: dict[str, np.ndarray] = {}
    for header, planes in zip(headers, _decode(path, data, headers)):
        part = header.attributes.get("name", "")
        if header.views and view != header.views[0]:
            tell(f"of the views only '{view}' is taken")
            continue
        for name, image in planes.items():
            layer, _, _ = name.rpartition(".")
            if layer.rpartition(".")[2] in header.views[1:]:
                tell(f"of the views only '{view}' is taken")
                continue
            if len(headers) > 1 and part and not layer:
                name = f"{part.removesuffix(f'.{view}')}.{name}"
            images[f"{part}.{name}" if name in images else name] = _shown(image, header, tell)
    return images


def _shown(image: np.ndarray, header: Header, tell: Callable[[str], None]) -> np.ndarray:
    """Of a data window what the display window shows, and 0 where it has nothing."""
    if (header.at, image.shape) == ((0, 0), header.shown):
        return image
    first = [max(at, 0) for at in header.at]
    last = [max(min(at + size, most), start) for at, size, most, start in zip(
        header.at, image.shape, header.shown, first)]
    if first != [0, 0] or tuple(last) != header.shown:
        tell("the data window is padded with 0 to the display window")
    if first != list(header.at) or any(
            at + size > most for at, size, most in zip(header.at, image.shape, header.shown)):
        tell("the data window is cropped to the display window")
    shown = np.zeros(header.shown, image.dtype)
    there = tuple(slice(a, b) for a, b in zip(first, last))
    shown[there] = image[tuple(slice(a - at, b - at) for a, b, at in zip(first, last, header.at))]
    shown.flags.writeable = False
    return shown


def _decode(path: Path, data: bytes, headers: list[Header]) -> list[dict[str, np.ndarray]]:
    """name -> read-only pixels of each part of a file that `_check` has passed."""
    import OpenEXR

    stream = io.BytesIO(data)
    with _unprinted() as said:
        try:
            with OpenEXR.File(stream, separate_channels=True, num_threads=_threads()) as file:
                file.channels()  # ValueError where decoding failed: that is only printed
                decoded = [{name: part.channels[name].pixels for name in header.channels}
                           for part, header in zip(file.parts, headers, strict=True)]
        except MemoryError:
            raise
        except Exception as error:  # whatever C++ or a strange header's objects come up with
            if any("MemoryError" in line or "bad_alloc" in line for line in said):
                raise MemoryError from error
            why = "".join(said).rpartition(" - ")[2].strip() or str(error)
            why = "".join(c for c in why if c.isprintable())[:100]
            raise InputError(f"{path} is damaged and cannot be decoded ({why}): make it again"
                             ) from error
    for header, images in zip(headers, decoded):
        for name, image in images.items():
            if image.shape != (header.height, header.width) or image.dtype != header.channels[name]:
                raise InputError(f"{path} is damaged and cannot be decoded: make it again")
            image.flags.writeable = False
    return decoded


class _Listener:
    """Stands for `sys.stdout`: keeps what one thread prints, and passes on all else."""

    def __init__(self, stdout: TextIO | None) -> None:
        self._thread, self._stdout = threading.get_ident(), stdout
        self.lines: list[str] = []

    def write(self, text: str) -> int:
        if threading.get_ident() == self._thread or self._stdout is None:
            self.lines.append(text)
            return len(text)
        return self._stdout.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stdout, name)


_LISTENING = threading.Lock()  # else two threads might leave each other's listener in place


@contextmanager
def _unprinted() -> Iterator[list[str]]:
    """Keeps from the output what the library prints there, for a table may be on its way to it."""
    with _LISTENING:
        stdout, listener = sys.stdout, _Listener(sys.stdout)
        sys.stdout = listener
        try:
            yield listener.lines
        finally:
            sys.stdout = stdout


@cache
def _threads() -> int:
    """Lets the library use the machine's cores (it starts with one); the number of them."""
    import OpenEXR  # not before it is used, so that `doctor` can tell of one that crashes

    count = min(os.cpu_count() or 1, 16)
    OpenEXR.set_global_thread_count(count)
    return count


def _check(path: Path, data: bytes, any_kind: bool = False) -> list[Header]:
    try:
        return parse(data, any_kind)
    except MalformedError as error:
        raise InputError(f"{path} {error}") from None
    except (struct.error, IndexError, ValueError):  # ran past the end, or text that is not UTF-8
        raise InputError(f"{path} is truncated or damaged: make it again") from None
