"""OpenEXR files: one scanline image of any named channels, lossless, checked before it is decoded.

ZIP compression: of the lossless ones that every viewer reads it makes the smallest files of noisy
frames, and decodes as fast as any.

The OpenEXR library trusts a header's size, returns partial images for truncated files, and tells
about damage on the terminal. So the header and the chunk table are parsed here first: a file that
passes is complete and no larger than it claims, and only damage inside a compressed chunk is left
for the library to find. It reads by `OpenEXR.File`: the older `InputFile`, which is deprecated, has
worker threads read a Python stream without the interpreter's lock, and that ends the process from
Python 3.12 on. Layout: https://openexr.com/en/latest/OpenEXRFileLayout.html
"""

from __future__ import annotations

import io
import math
import os
import struct
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from onespp.render.errors import InputError

from .atomic import read_bytes, write_bytes

_MAGIC = b"\x76\x2f\x31\x01"
_TYPES = (np.dtype(np.uint32), np.dtype(np.float16), np.dtype(np.float32))
_ROWS = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32}  # rows a chunk: none, RLE, ZIPS, ZIP, PIZ
_MAX_SIDE = 1 << 16
MOST_NAMED = 24  # channels in one sentence
_MAX_RATIO = 1100  # deflate, the strongest of these, cannot exceed 1032


@dataclass(frozen=True)
class Header:
    """What an EXR file says about itself.

    Attributes:
        height, width: of the data window.
        channels: name -> pixel type.
        attributes: the header's strings.
    """

    height: int
    width: int
    channels: Mapping[str, np.dtype]
    attributes: Mapping[str, str]


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
        if image.dtype not in _TYPES:
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
    header = _check(path, data)
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
    images = _decode(path, data, header, names)
    return images, header


def read_header(path: Path) -> Header:
    """The header of a complete image, without its pixels; InputError as `read_exr`."""
    return _check(path, read_bytes(path))


def _decode(path: Path, data: bytes, header: Header, names: list[str]) -> dict[str, np.ndarray]:
    """name -> read-only pixels of a file that `_check` has passed."""
    import OpenEXR

    stream = io.BytesIO(data)
    with _unprinted() as said:
        try:
            with OpenEXR.File(stream, separate_channels=True, num_threads=_threads()) as file:
                decoded = file.channels()  # ValueError where decoding failed: that is only printed
                images = {name: decoded[name].pixels for name in names}
        except MemoryError:
            raise
        except Exception as error:  # whatever C++ or a strange header's objects come up with
            if any("MemoryError" in line or "bad_alloc" in line for line in said):
                raise MemoryError from error
            why = "".join(said).rpartition(" - ")[2].strip() or str(error)
            why = "".join(c for c in why if c.isprintable())[:100]
            raise InputError(f"{path} is damaged and cannot be decoded ({why}): make it again"
                             ) from error
    for name, image in images.items():
        if image.shape != (header.height, header.width) or image.dtype != header.channels[name]:
            raise InputError(f"{path} is damaged and cannot be decoded: make it again")
        image.flags.writeable = False
    return images


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


class _Malformed(Exception):
    """What is wrong with a file, as the end of a sentence that begins with its path."""


def _check(path: Path, data: bytes) -> Header:
    try:
        return _parse(data)
    except _Malformed as error:
        raise InputError(f"{path} {error}") from None
    except (struct.error, IndexError, ValueError):  # ran past the end, or text that is not UTF-8
        raise InputError(f"{path} is truncated or damaged: make it again") from None


def _parse(data: bytes) -> Header:
    if data[:4] != _MAGIC:
        raise _Malformed("is empty" if not data else "is not an OpenEXR file")
    version, = struct.unpack_from("<I", data, 4)
    for bit, kind in ((0x1000, "a multi-part"), (0x800, "a deep"), (0x200, "a tiled")):
        if version & bit:
            raise _Malformed(f"is {kind} OpenEXR file: save it as a single-part scanline image")
    attributes, table = _attributes(data)
    if _value(attributes, "type", "string", b"scanlineimage") != b"scanlineimage":
        raise _Malformed("is not a scanline OpenEXR file: save it as one")
    channels = _channel_list(_value(attributes, "channels", "chlist"))
    compression = _value(attributes, "compression", "compression")[0]
    if compression not in _ROWS:
        raise _Malformed("is compressed in a way not read here: save it with ZIP compression")
    left, top, right, bottom = struct.unpack("<4i", _value(attributes, "dataWindow", "box2i"))
    width, height = right - left + 1, bottom - top + 1
    if not (0 < width <= _MAX_SIDE and 0 < height <= _MAX_SIDE):
        raise _Malformed(f"claims to be {width}x{height} pixels: make it again")
    pixel_bytes = sum(dtype.itemsize for dtype in channels.values())
    if height * width * pixel_bytes > _MAX_RATIO * len(data):
        raise _Malformed(f"claims to be {width}x{height} pixels but is only {len(data)} bytes "
                         "long: make it again")
    _check_chunks(data, table, _ROWS[compression], top, height)
    strings = {name: value.decode() for name, (kind, value) in attributes.items()
               if kind == "string"}
    return Header(height, width, channels, strings)


def _string(data: bytes, start: int) -> tuple[str, int]:
    """A null-terminated name and the offset behind it."""
    end = data.index(b"\0", start, start + 256)
    return data[start:end].decode(), end + 1


def _attributes(data: bytes) -> tuple[dict[str, tuple[str, bytes]], int]:
    """Name -> (type, value), and the offset of the chunk table behind the header."""
    attributes, at = {}, 8
    while data[at] != 0:
        name, at = _string(data, at)
        kind, at = _string(data, at)
        size, = struct.unpack_from("<I", data, at)
        if name in attributes:  # the library might go by the other one
            raise _Malformed(f"has two {name!r} in its header: make it again")
        if at + 4 + size >= len(data):
            raise IndexError
        attributes[name] = (kind, data[at + 4:at + 4 + size])
        at += 4 + size
    return attributes, at + 1


def _value(attributes: Mapping[str, tuple[str, bytes]], name: str, kind: str,
           default: bytes | None = None) -> bytes:
    found, value = attributes.get(name, (kind, default))
    if found != kind or value is None:
        raise _Malformed(f"has no valid '{name}' in its header: make it again")
    return value


def _channel_list(data: bytes) -> dict[str, np.dtype]:
    channels, at = {}, 0
    while data[at] != 0:
        name, at = _string(data, at)
        kind, _, x_step, y_step = struct.unpack_from("<4i", data, at)
        if not 0 <= kind < len(_TYPES):
            raise _Malformed(f"has a channel {name!r} of an unknown type: make it again")
        if (x_step, y_step) != (1, 1):
            raise _Malformed(f"has a subsampled channel {name!r}: save it at full resolution")
        if name in channels:
            raise _Malformed(f"has two channels {name!r}: make it again")
        channels[name] = _TYPES[kind]
        at += 16
    if not channels:
        raise _Malformed("has no channels: make it again")
    return channels


def _check_chunks(data: bytes, table: int, rows: int, top: int, height: int) -> None:
    """Every block of rows is there, whole, and where the table says."""
    count = math.ceil(height / rows)
    for i, offset in enumerate(struct.unpack_from(f"<{count}Q", data, table)):
        if not table + 8 * count <= offset <= len(data) - 8:
            raise _Malformed("is incomplete or truncated: make it again")
        row, size = struct.unpack_from("<2i", data, offset)
        if row != top + i * rows or not 0 <= size <= len(data) - 8 - offset:
            raise _Malformed("is truncated or damaged: make it again")
