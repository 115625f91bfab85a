"""A small sequence with guides, references and two methods: a board that moves before a wall."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from onespp.render.files.manifest import Manifest, Run
from onespp.render.files.sequence import FrameSequence, Reference

from .frames import make_frame, noisy, translation

HEIGHT, WIDTH, COUNT, SPP = 32, 48, 4, 256
CHANNELS = ("color", "albedo", "normal", "position", "depth", "id")
METHODS = {"rough": (0.3, 2.0), "fine": (0.05, 40.0)}  # name: relative noise, ms


def make_report_sequence(folder: Path, frames: int = COUNT, **settings) -> FrameSequence:
    sequence = FrameSequence.create(folder, Manifest(**{
        "scene": "made", "about": "A board before a wall", "frames": tuple(range(frames)),
        "width": WIDTH, "height": HEIGHT, "fps": 12.0, "seed": 7, "reference_spp": SPP,
        "channels": CHANNELS, "objects": ("wall", "board"), "versions": {"maker": "1.0"},
        **settings}))
    rng = np.random.default_rng(1)
    for i in range(frames):
        clean = make_frame(HEIGHT, WIDTH, index=i, board=translation(0.1 * i, 0, 0))
        sequence.write_frame(noisy(clean, seed=i, sigma=1.0))
        sequence.write_reference(i, Reference(
            clean["color"], 1e-6 * np.ones_like(clean["color"]), SPP))
        for name, (sigma, _) in METHODS.items():
            noise = 1 + sigma * rng.standard_normal(clean["color"].shape)
            sequence.write_result(name, i, (clean["color"] * noise).astype(np.float32))
    for name, (_, ms) in METHODS.items():
        sequence.write_run(name, Run(
            method=name, parameters={"radius": 2, "sigma": 0.5}, device="llvm", threads=2,
            first_ms=10 * ms, ms={i: 10 * ms if i == 0 else ms + i for i in range(frames)}))
    return sequence
