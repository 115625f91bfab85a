"""A tiny sequence with every channel, made of random numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from onespp.render.channels import CHANNELS, OFFERED
from onespp.render.files.manifest import Manifest
from onespp.render.files.sequence import FrameSequence
from onespp.render.frame import Frame

HEIGHT, WIDTH = 21, 9  # two blocks of rows in a file
OBJECTS = ("ball", 'a "quoted" wall', "sol é")


def small_frame(index: int = 0, seed: int = 0) -> Frame:
    rng = np.random.default_rng([seed, index])
    images = {}
    for name in OFFERED:
        channel = CHANNELS[name]
        shape = (HEIGHT, WIDTH, channel.components)[:2 if channel.components == 1 else 3]
        images[name] = (rng.integers(-1, len(OBJECTS), shape).astype(np.int32) if channel.is_id
                        else rng.normal(size=shape).astype(np.float32))
    return Frame(index, images, rng.normal(size=(4, 4)), rng.normal(size=(4, 4)) * 1e6,
                 rng.normal(size=(len(OBJECTS), 4, 4)))


def small_manifest(**changes: Any) -> Manifest:
    values: dict[str, Any] = {"scene": "small", "frames": (0, 1, 2), "width": WIDTH,
                              "height": HEIGHT, "channels": OFFERED, "objects": OBJECTS}
    return Manifest(**{**values, **changes})


def small_sequence(folder: Path, frames: tuple[int, ...] = (0, 1)) -> FrameSequence:
    sequence = FrameSequence.create(folder, small_manifest(frames=frames))
    for i in frames:
        sequence.write_frame(small_frame(i), {"scene": "small"})
    return sequence


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a folder, by its path inside it."""
    return {path.relative_to(folder).as_posix(): path.read_bytes()
            for path in folder.rglob("*") if path.is_file()}
