"""A small sequence made without a renderer: a gradient with a moving square, and its noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from onespp.render.files.manifest import Manifest, Run
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.frame import Frame

HEIGHT, WIDTH, COUNT, SPP = 21, 33, 4, 256
METHODS = {"rough": (0.3, 2.0), "fine": (0.05, 40.0)}  # name: relative noise, ms


def truth(i: int) -> np.ndarray:
    """(h, w, 3) noise-free radiance of frame i, float64."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    image = np.stack([x / WIDTH, y / HEIGHT, 0.3 + 0 * x], axis=-1)
    image[5:12, 4 + i:12 + i] = (0.9, 0.5, 2.0)
    return image


def make_sequence(folder: Path, reference: bool = True, methods: bool = True) -> FrameSequence:
    rng = np.random.default_rng(1)
    sequence = FrameSequence.create(folder, Manifest(
        scene="made", frames=tuple(range(COUNT)), width=WIDTH, height=HEIGHT, fps=12.0, seed=7,
        reference_spp=SPP if reference else None, channels=("color",), objects=("all",),
        versions={"maker": "1.0"}))
    for i in range(COUNT):
        noisy = truth(i) * rng.gamma(0.5, 2.0, (HEIGHT, WIDTH, 1))
        sequence.write_frame(Frame(i, {"color": noisy.astype(np.float32)}, np.eye(4), np.eye(4),
                                   np.eye(4)[None]))
        if reference:
            sigma = 0.01 * truth(i)
            mean = truth(i) + sigma * rng.standard_normal(sigma.shape)
            sequence.write_reference(i, Reference(
                mean.astype(np.float32), (sigma ** 2).astype(np.float32), SPP))
    for name, (sigma, ms) in METHODS.items() if methods else ():
        write_method(sequence, name, sigma, ms)
    return sequence


def write_method(sequence: FrameSequence, name: str, sigma: float, ms: float) -> None:
    """Results with relative noise `sigma`; the first frame takes ten times as long."""
    rng = np.random.default_rng(2)
    for i in sequence.frames:
        image = truth(i) * (1 + sigma * rng.standard_normal((HEIGHT, WIDTH, 3)))
        sequence.write_result(name, i, image.astype(np.float32))
    sequence.write_run(name, Run(
        method=name, parameters={"sigma": sigma}, device="llvm", threads=2, first_ms=10 * ms,
        ms={i: 10 * ms if i == 0 else ms + i for i in sequence.frames}))
