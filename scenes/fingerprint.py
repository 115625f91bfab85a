"""A short hash of what a scene is, so that a data set can tell whether its scene was edited."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from .description import Scene


def fingerprint(scene: Scene) -> str:
    """16 hex digits over everything that decides its frames' pixels.

    Functions of time are sampled at each of the scene's frames; its name, its text and its
    default size are left out.
    """
    digest = hashlib.sha256()
    times = range(scene.frames)
    for part in (scene.shapes, scene.camera, scene.max_depth, scene.environment):
        _feed(digest, part, times)
    return digest.hexdigest()[:16]


def _feed(digest: Any, value: Any, times: range) -> None:
    digest.update(type(value).__name__.encode())
    if callable(value):
        value = [value(time) for time in times]
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif is_dataclass(value):
        for field in fields(value):
            _feed(digest, getattr(value, field.name), times)
    elif isinstance(value, Mapping):
        for key in sorted(value):
            digest.update(key.encode())
            _feed(digest, value[key], times)
    elif isinstance(value, list | tuple):
        for item in value:
            _feed(digest, item, times)
    else:
        digest.update(repr(value).encode())
