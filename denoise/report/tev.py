"""A sequence's pictures sent to tev, the image viewer, as it runs.

Two packets of its protocol (`src/Ipc.cpp` of github.com/Tom94/tev; create, version 1, and update,
version 3), little endian, strings end with a 0 byte:

    u32 length of the packet, u8 type, u8 grab focus, name, then
    4 create: i32 width, height, number of channels, their names
    6 update: i32 number of channels, their names, i32 x, y, width, height,
              i64 offset of each channel in the pixels, i64 stride of each, float32 pixels

Written by hand: the package tevclient asks for Python 3.11, and the rest of it we don't use.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator, Sequence

import numpy as np

from onespp.denoise.score.scorecard import INPUT
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.progress import Progress, silent

from .contact_sheets import display_error

HOST, PORT = "localhost", 14158
SECONDS = 10.0
_CREATE, _UPDATE = 4, 6
_ROWS = 128  # of an update: the first are shown while the others are on their way


def view(sequence: FrameSequence, methods: Sequence[str] = (), frames: Sequence[int] = (),
         host: str = HOST, port: int = PORT, progress: Progress = silent) -> list[str]:
    """Send input, results, their errors and the reference of frames to a running tev.

    An image is SCENE/FRAME/WHAT, linear; an error is `display_error`, as on contact sheets.

    Args:
        methods: default all that have results. frames: default all of the sequence.
        progress: counts frames.
    Returns:
        names of the images sent.

    Raises:
        InputError: no tev listens there, or it went away; a method or frame is not there.
    """
    there = sequence.methods()
    for name in methods:
        if name not in there:
            raise InputError(f"{sequence.folder} has no results of '{name}': it has "
                             f"{', '.join(there) or 'none yet'}; make some with `onespp denoise`")
    if missing := [i for i in frames if i not in sequence.frames]:
        raise InputError(f"{sequence.folder} has no frame {missing[0]}: it has "
                         f"{sequence.frames[0]} to {sequence.frames[-1]}")
    chosen, sent = frames or sequence.frames, []
    try:
        with socket.create_connection((host, port), SECONDS) as tev:
            for n, i in enumerate(chosen):
                for what, image in _images(sequence, methods or there, i):
                    sent.append(f"{sequence.manifest.scene}/{i:04d}/{what}")
                    for packet in packets(sent[-1], image):
                        tev.sendall(packet)
                progress(n + 1, len(chosen), "view")
    except OSError as error:
        if isinstance(error, (socket.gaierror, ConnectionRefusedError, TimeoutError)) and not sent:
            raise InputError(f"no tev listens at {host}:{port}: start tev, then run the same "
                             "command again, or say where it is by --tev HOST:PORT") from None
        raise InputError(f"tev at {host}:{port} went away after {len(sent)} images "
                         f"({error})") from None
    return sent


def packets(name: str, image: np.ndarray) -> Iterator[bytes]:
    """What makes tev show `image`, (h, w) or (h, w, 3), under `name`."""
    image = np.atleast_3d(image).astype("<f4")
    h, w, count = image.shape
    channels = _strings("RGB" if count == 3 else "Y")
    yield _packet(_CREATE, name, struct.pack("<3i", w, h, count) + channels)
    layout = struct.pack(f"<{2 * count}q", *range(count), *[count] * count)
    for y in range(0, h, _ROWS):
        rows = image[y:y + _ROWS]
        place = struct.pack("<4i", 0, y, w, len(rows))
        yield _packet(_UPDATE, name, struct.pack("<i", count) + channels + place + layout
                      + rows.tobytes())


def _packet(kind: int, name: str, body: bytes) -> bytes:
    packet = struct.pack("<BB", kind, 0) + _strings([name]) + body
    return struct.pack("<I", len(packet) + 4) + packet


def _strings(texts: Sequence[str]) -> bytes:
    return b"".join(text.encode() + b"\0" for text in texts)


def _images(sequence: FrameSequence, methods: Sequence[str],
            i: int) -> Iterator[tuple[str, np.ndarray]]:
    """What there is of frame i; results and errors in turns, so that one key goes to and fro."""
    reference = sequence.read_reference(i).color if sequence.has_reference(i) else None
    if sequence.has_frame(i):
        yield INPUT, sequence.read_frame(i, ("color",))["color"]
    for name in methods:
        if sequence.has_result(name, i):
            result = sequence.read_result(name, i)
            yield name, result
            if reference is not None:
                yield f"{name} error", display_error(result, reference)
    if reference is not None:
        yield "reference", reference
