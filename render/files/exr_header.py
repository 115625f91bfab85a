"""What an OpenEXR file says about itself, and whether it is whole.

Header and chunk tables are parsed: a file that passes is complete and no larger than it claims.
Layout: https://openexr.com/en/latest/OpenEXRFileLayout.html
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

_MAGIC = b"\x76\x2f\x31\x01"
TYPES = (np.dtype(np.uint32), np.dtype(np.float16), np.dtype(np.float32))
_ROWS = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32}  # rows a chunk: none, RLE, ZIPS, ZIP, PIZ
_LOSSY = {5: 16, 6: 32, 7: 32, 8: 32, 9: 256}  # PXR24, B44, B44A, DWAA, DWAB
_MAX_SIDE = 1 << 16
_MAX_RATIO = 1100  # deflate, the strongest lossless one, cannot exceed 1032
_MAX_LOSSY_RATIO = 20_000
_TILED, _DEEP, _PARTS = 0x200, 0x800, 0x1000
_MOST_PARTS = 1000
_MOST_SHOWN = 1 << 26  # pixels of a display window that the data do not fill


@dataclass(frozen=True)
class Header:
    """What a part of an EXR file says about itself.

    Attributes:
        height, width: of the data window.
        channels: name -> pixel type.
        attributes: the header's strings.
        at: (row, column) of the data window's first pixel in the display window.
        shown: (height, width) of the display window.
        views: of a stereo image, the one without a name in its channels first.
    """

    height: int
    width: int
    channels: Mapping[str, np.dtype]
    attributes: Mapping[str, str]
    at: tuple[int, int]
    shown: tuple[int, int]
    views: tuple[str, ...]


class MalformedError(Exception):
    """What is wrong with a file, as the end of a sentence that begins with its path."""


def parse(data: bytes, any_kind: bool = False) -> list[Header]:
    """The header of each part of a file that is whole.

    Args:
        any_kind: of any kind but deep or in several resolutions; otherwise one part of scanlines,
            lossless.

    Raises:
        MalformedError, struct.error, IndexError, ValueError: it is not.
    """
    if data[:4] != _MAGIC:
        raise MalformedError("is empty" if not data else "is not an OpenEXR file")
    version, = struct.unpack_from("<I", data, 4)
    if version & _DEEP:
        raise MalformedError("is a deep OpenEXR file: save it as a single-part scanline image")
    for bit, kind in ((_PARTS, "a multi-part"), (_TILED, "a tiled")):
        if version & bit and not any_kind:
            raise MalformedError(f"is {kind} OpenEXR file: save it as a single-part scanline image")
    attributes, at = _attributes(data, 8)
    parts = [attributes]
    while version & _PARTS and data[at] != 0:
        attributes, at = _attributes(data, at)
        parts.append(attributes)
        if len(parts) > _MOST_PARTS:
            raise MalformedError(f"has more than {_MOST_PARTS} parts: save fewer")
    several = bool(version & _PARTS)
    table = at + several
    default = b"tiledimage" if version & _TILED else b"scanlineimage"
    found = [_part(part, default, len(data), any_kind) for part in parts]
    tables = [table]
    for _, leaders in found:
        tables.append(tables[-1] + 8 * len(leaders))
    for number, (_, leaders) in enumerate(found):
        if several:
            leaders = [(number, *leader) for leader in leaders]
        _check_chunks(data, tables[number], tables[-1], leaders)
    return [header for header, _ in found]


def _part(attributes: Mapping[str, tuple[str, bytes]], default: bytes, size: int,
          any_kind: bool) -> tuple[Header, list[tuple[int, ...]]]:
    """The header of a part, and the integers that each of its chunks begins with, in the order of
    the chunk table."""
    kind = _value(attributes, "type", "string", default)
    if kind != b"scanlineimage" and not (any_kind and kind == b"tiledimage"):
        raise MalformedError("is not a scanline OpenEXR file: save it as one")
    channels = _channel_list(_value(attributes, "channels", "chlist"))
    compression = _value(attributes, "compression", "compression")[0]
    rows = (_ROWS | _LOSSY if any_kind else _ROWS).get(compression)
    if rows is None:
        raise MalformedError("is compressed in a way not read here: save it with ZIP compression")
    left, top, right, bottom = struct.unpack("<4i", _value(attributes, "dataWindow", "box2i"))
    width, height = right - left + 1, bottom - top + 1
    if not (0 < width <= _MAX_SIDE and 0 < height <= _MAX_SIDE):
        raise MalformedError(f"claims to be {width}x{height} pixels: make it again")
    pixel_bytes = sum(dtype.itemsize for dtype in channels.values())
    if height * width * pixel_bytes > size * (
            _MAX_LOSSY_RATIO if compression in _LOSSY else _MAX_RATIO):
        raise MalformedError(f"claims to be {width}x{height} pixels but is only {size} bytes "
                             "long: make it again")
    # Our own files are all data.
    display = (_display(attributes, width * height) if any_kind else (left, top, width, height))
    if kind == b"tiledimage":
        leaders = _tiles(attributes, width, height)
    else:
        leaders = [(top + rows * i,) for i in range(math.ceil(height / rows))]
    strings = {name: value.decode() for name, (kind, value) in attributes.items()
               if kind == "string"}
    return Header(height, width, channels, strings, (top - display[1], left - display[0]),
                  (display[3], display[2]), _views(attributes)), leaders


def _display(attributes: Mapping[str, tuple[str, bytes]], pixels: int) -> tuple[int, ...]:
    """(left, top, width, height) of the display window; pixels: of the data window."""
    left, top, right, bottom = struct.unpack("<4i", _value(attributes, "displayWindow", "box2i"))
    width, height = right - left + 1, bottom - top + 1
    if not (0 < width <= _MAX_SIDE and 0 < height <= _MAX_SIDE
            and width * height <= max(pixels, _MOST_SHOWN)):
        raise MalformedError(f"claims to be shown in {width}x{height} pixels: make it again")
    return left, top, width, height


def _views(attributes: Mapping[str, tuple[str, bytes]]) -> tuple[str, ...]:
    if "multiView" not in attributes:
        kind, value = attributes.get("view", ("", b""))
        return (value.decode(),) if kind == "string" else ()
    data, at, views = _value(attributes, "multiView", "stringvector"), 0, []
    while at < len(data):
        size, = struct.unpack_from("<i", data, at)
        views.append(data[at + 4:at + 4 + max(size, 0)].decode())
        at += 4 + max(size, 0)
    return tuple(views)


def _tiles(attributes: Mapping[str, tuple[str, bytes]], width: int,
           height: int) -> list[tuple[int, ...]]:
    """(column, row, 0, 0) of each tile."""
    x, y, mode = struct.unpack("<IIB", _value(attributes, "tiles", "tiledesc"))
    if mode & 15:
        raise MalformedError("holds its image in several resolutions: save it with one")
    if not (0 < x <= _MAX_SIDE and 0 < y <= _MAX_SIDE):
        raise MalformedError(f"claims to have tiles of {x}x{y} pixels: make it again")
    return [(i, j, 0, 0) for j in range(math.ceil(height / y)) for i in range(math.ceil(width / x))]


def _string(data: bytes, start: int) -> tuple[str, int]:
    """A null-terminated name and the offset behind it."""
    end = data.index(b"\0", start, start + 256)
    return data[start:end].decode(), end + 1


def _attributes(data: bytes, at: int) -> tuple[dict[str, tuple[str, bytes]], int]:
    """Name -> (type, value) of the header that begins at an offset, and the offset behind it."""
    attributes = {}
    while data[at] != 0:
        name, at = _string(data, at)
        kind, at = _string(data, at)
        size, = struct.unpack_from("<I", data, at)
        if name in attributes:  # the library might go by the other one
            raise MalformedError(f"has two {name!r} in its header: make it again")
        if at + 4 + size >= len(data):
            raise IndexError
        attributes[name] = (kind, data[at + 4:at + 4 + size])
        at += 4 + size
    return attributes, at + 1


def _value(attributes: Mapping[str, tuple[str, bytes]], name: str, kind: str,
           default: bytes | None = None) -> bytes:
    found, value = attributes.get(name, (kind, default))
    if found != kind or value is None:
        raise MalformedError(f"has no valid '{name}' in its header: make it again")
    return value


def _channel_list(data: bytes) -> dict[str, np.dtype]:
    channels, at = {}, 0
    while data[at] != 0:
        name, at = _string(data, at)
        kind, _, x_step, y_step = struct.unpack_from("<4i", data, at)
        if not 0 <= kind < len(TYPES):
            raise MalformedError(f"has a channel {name!r} of an unknown type: make it again")
        if (x_step, y_step) != (1, 1):
            raise MalformedError(f"has a subsampled channel {name!r}: save it at full resolution")
        if name in channels:
            raise MalformedError(f"has two channels {name!r}: make it again")
        channels[name] = TYPES[kind]
        at += 16
    if not channels:
        raise MalformedError("has no channels: make it again")
    return channels


def _check_chunks(data: bytes, table: int, end: int, leaders: list[tuple[int, ...]]) -> None:
    """Every chunk is there, whole, and where the table says. end: behind all tables."""
    offsets = struct.unpack_from(f"<{len(leaders)}Q", data, table)
    for offset, leader in zip(offsets, leaders):
        numbers = len(leader) + 1
        if not end <= offset <= len(data) - 4 * numbers:
            raise MalformedError("is incomplete or truncated: make it again")
        *found, size = struct.unpack_from(f"<{numbers}i", data, offset)
        if tuple(found) != leader or not 0 <= size <= len(data) - 4 * numbers - offset:
            raise MalformedError("is truncated or damaged: make it again")
