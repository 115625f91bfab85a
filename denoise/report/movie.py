"""H.264 movies, through the ffmpeg that the imageio-ffmpeg wheel brings."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable
from pathlib import Path

import imageio_ffmpeg
import numpy as np

from onespp.render.files.atomic import replacing

# BT.709 by conversion and by tag: players guess otherwise, and tints shift.
_COLOURS = ("scale=out_color_matrix=bt709:out_range=tv,setparams=colorspace=bt709:"
            "color_primaries=bt709:color_trc=iec61966-2-1")


class MovieError(RuntimeError):
    """ffmpeg is not there or gave up. The message is one sentence."""


def write_movie(path: Path, pictures: Iterable[np.ndarray], fps: float) -> None:
    """Write an mp4 (H.264, yuv420p, BT.709), one picture at a time.

    The file appears when it is complete; whatever goes wrong, no part of one stays.

    Args:
        path: file to write.
        pictures: (h, w, 3) uint8 sRGB, all of one size, h and w even.
        fps: frames a second.

    Raises:
        MovieError: ffmpeg is missing, cannot run, or failed.
        InputError: the folder cannot be written.
        ValueError: no picture, one of another size than the first, or of an odd one.
    """
    process = None
    try:
        with replacing(path) as part:
            for picture in pictures:
                if process is None:
                    shape = picture.shape
                    process = _start(part, shape[0], shape[1], fps)
                if picture.shape != shape:
                    raise ValueError(f"a picture is {picture.shape}, the first was {shape}")
                _send(process, picture)
            if process is None:
                raise ValueError("a movie needs a picture")
            _finish(process)
    finally:
        if process is not None and process.poll() is None:
            process.kill()
            process.communicate()


def _start(path: Path, height: int, width: int, fps: float) -> subprocess.Popen:
    if height % 2 or width % 2:
        raise ValueError(f"pictures are {width}x{height}; H.264 in yuv420p takes even sizes")
    try:
        return subprocess.Popen(
            [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error",
             "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:g}",
             "-i", "-", "-vf", _COLOURS, "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20",
             "-movflags", "+faststart", "-f", "mp4", str(path)],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    except (RuntimeError, OSError) as error:
        raise MovieError(f"ffmpeg cannot run ({error})") from None


def _send(process: subprocess.Popen, picture: np.ndarray) -> None:
    assert process.stdin is not None
    try:
        process.stdin.write(np.ascontiguousarray(picture, np.uint8).tobytes())
    except OSError:  # it died: say why
        _finish(process)
        raise MovieError("ffmpeg stopped reading") from None


def _finish(process: subprocess.Popen) -> None:
    _, words = process.communicate()
    if process.returncode:
        lines = words.decode(errors="replace").strip().splitlines() or ["no reason given"]
        raise MovieError(f"ffmpeg failed ({lines[-1].strip()})")
