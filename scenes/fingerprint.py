"""A short hash of what a scene is, so that a data set can tell whether its scene was edited.

It covers all that a renderer reads of a scene: shapes, arrays, materials, lights, the camera, what
moves or changes, and the contents of files that a material or the environment names (not their
paths, so a folder may be moved). What older scenes had not counts only where it is not as it was
then. It does not cover who renders: versions of packages and the device are in the manifest, where
they tell, and do not forbid, that a sequence was continued on another machine.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .description import Scene


def fingerprint(scene: Scene, times: Sequence[float] | None = None) -> str:
    """16 hex digits over everything that decides its frames' pixels.

    Functions of time are sampled at `times`, by default at each of the scene's frames; its name,
    its text and its default size are left out.
    """
    digest = hashlib.sha256()
    times = range(scene.frames) if times is None else times
    for part in (scene.shapes, scene.camera, scene.max_depth):
        _feed(digest, part, times)
    _feed(digest, scene.environment, times, names_a_file=True)
    if scene.lights:
        _feed(digest, scene.lights, times)
    return digest.hexdigest()[:16]


def later_fingerprints(scene: Scene, frames: Iterable[int]) -> dict[int, str]:
    """Of each frame after the scene's last, which `fingerprint` leaves out, a hash of its own.

    It samples the frame before as well, which temporal gradients look at.
    """
    return {i: fingerprint(scene, (i - 1, i)) for i in frames if i >= scene.frames}


def _feed(digest: Any, value: Any, times: Sequence[float], names_a_file: bool = False) -> None:
    """Add a value to the hash: its type, how many parts it has, and those parts."""
    digest.update(f"{type(value).__name__}:".encode())
    if callable(value):
        value = [value(time) for time in times]
    if isinstance(value, os.PathLike) or (names_a_file and isinstance(value, str)):
        _feed_file(digest, Path(value))
        return
    if hasattr(value, "__array__") or hasattr(value, "__array_interface__"):
        array = np.asarray(value)  # an array, a number of NumPy's, an image of Pillow or Mitsuba
        if array.dtype != object:
            digest.update(f"{array.dtype}{array.shape}".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
            return
        value = array.tolist()
    if is_dataclass(value):
        for field in fields(value):
            if field.metadata.get("later") and getattr(value, field.name) == _default(field):
                continue
            _feed(digest, getattr(value, field.name), times)
    elif isinstance(value, Mapping):
        digest.update(f"{len(value)};".encode())
        for key, part in value.items():  # in their order, which nested materials have too
            digest.update(f"{key!r}:".encode())
            _feed(digest, part, times, names_a_file=str(key).endswith("filename"))
    elif isinstance(value, list | tuple):
        digest.update(f"{len(value)};".encode())
        for item in value:
            _feed(digest, item, times)
    else:
        digest.update(f"{value!r};".encode())


def _default(field: Field) -> Any:
    return field.default if field.default_factory is MISSING else field.default_factory()


def _feed_file(digest: Any, path: Path) -> None:
    """A file's contents; its name where it cannot be read, which the renderer will say."""
    if not path.is_file():  # a pipe would wait for ever
        digest.update(repr(str(path)).encode())
        return
    try:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    except OSError:
        digest.update(repr(str(path)).encode())
