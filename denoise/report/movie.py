"""H.264 movies, by PyAV: `pip install 'onespp[movie]'` brings it."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from onespp.render.errors import InputError
from onespp.render.files.atomic import replacing

# BT.709 by conversion and by tag: players guess otherwise, and tints shift. Numbers of ITU-T H.273.
_BT709, _SRGB_CURVE = 1, 13
_MISSING = "PyAV is not installed: run `pip install 'onespp[movie]'`"


class MovieError(RuntimeError):
    """PyAV is not there or gave up. The message is one sentence."""


def require_av() -> None:
    """InputError where there is no PyAV to write movies with."""
    if importlib.util.find_spec("av") is None:
        raise InputError(f"no movie can be made: {_MISSING}, or leave out --movie")


def write_movie(path: Path, pictures: Iterable[np.ndarray], fps: float) -> None:
    """Write an mp4 (H.264, yuv420p, BT.709), one picture at a time.

    The file appears when it is complete; whatever goes wrong, no part of one stays.

    Args:
        path: file to write.
        pictures: (h, w, 3) uint8 sRGB, all of one size, h and w even.
        fps: frames a second.

    Raises:
        MovieError: PyAV is missing, does not load, or failed.
        InputError: the folder cannot be written.
        ValueError: no picture, one of another size than the first, or of an odd one.
    """
    try:
        import av
        from av.error import FFmpegError
    except ModuleNotFoundError:
        raise MovieError(_MISSING) from None
    except ImportError as error:
        raise MovieError(f"PyAV does not load ({error})") from None
    shape = None
    with replacing(path) as part:
        try:
            with av.open(str(part), "w", format="mp4", options={"movflags": "+faststart"}) as file:
                for picture in pictures:
                    if shape is None:
                        shape = picture.shape
                        stream = _stream(file, shape[0], shape[1], fps)
                    if picture.shape != shape:
                        raise ValueError(f"a picture is {picture.shape}, the first was {shape}")
                    frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture, np.uint8))
                    file.mux(stream.encode(frame.reformat(
                        format="yuv420p", src_color_range="JPEG", dst_color_range="MPEG",
                        dst_colorspace="ITU709")))
                if shape is None:
                    raise ValueError("a movie needs a picture")
                file.mux(stream.encode(None))
        except FFmpegError as error:
            raise MovieError(f"the encoder failed ({error.strerror})") from None


def _stream(file: Any, height: int, width: int, fps: float) -> Any:
    if height % 2 or width % 2:
        raise ValueError(f"pictures are {width}x{height}; H.264 in yuv420p takes even sizes")
    stream = file.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001),
                             options={"crf": "20"})
    stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
    context = stream.codec_context
    context.color_range = context.colorspace = context.color_primaries = _BT709
    context.color_trc = _SRGB_CURVE
    return stream
