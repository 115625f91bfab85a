"""How much better references come out than those of Mitsuba's `path`, at equal time.

Symbols: V, variance of one sample's share in the mean (n times that of the mean of n samples) in
clipped sRGB, averaged over pixels and components; t, seconds a sample of all pixels. An estimator's
efficiency is 1 / (V t), ours over theirs

    E = (V' t') / (V t)    (a prime: `path`),

which is how many times less error (squared) it has at equal time, or less time at equal error.

- V is measured between independent renders, so no truth is needed, and both are unbiased. Ours and
  theirs have n samples; for them, V hardly depends on n, ours falls with it (a Sobol sequence).
- t' is the time of `mi.render`, whose samples are spread over the pixel; V' is that of the same
  integrator through pixel centres, where ours go: spread samples would add the pixel's own detail.
- Renders go in turns after a warm-up, and the median times count.
- The standard error of ln E is that of the jackknife over renders.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from onespp.render.host.timed import timed
from onespp.render.progress import Progress, silent
from onespp.render.tracer.lights.candidates import candidates_for
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Scene
from onespp.show.srgb import srgb_from_linear

from .mitsuba_path import MitsubaPath

LEAST_RENDERS = 3  # so that leaving one out leaves a variance


@dataclass(frozen=True)
class Measured:
    """Renders of one estimator: (r, h, w, 3) linear means, r times in seconds, their samples."""

    images: np.ndarray
    seconds: np.ndarray
    samples: int

    def variance(self) -> float:
        """V."""
        shown = srgb_from_linear(self.images)
        return float(shown.var(axis=0, ddof=1, dtype=np.float64).mean()) * self.samples

    def time(self) -> float:
        """t."""
        return float(np.median(self.seconds)) / self.samples

    def without(self, left_out: int) -> Measured:
        keep = np.arange(len(self.images)) != left_out
        return Measured(self.images[keep], self.seconds[keep], self.samples)


@dataclass(frozen=True)
class Efficiency:
    """One scene's row: E with its standard error, and what it is made of.

    variance, time: V' / V and t' / t. seconds: of our render. lights: of the scene. candidates: M.
    """

    scene: str
    lights: int
    candidates: int
    variance: float
    time: float
    error: float
    seconds: float

    @property
    def better(self) -> float:
        """E."""
        return self.variance * self.time


def compare(name: str, ours: Measured, theirs: Measured, lights: int,
            candidates: int) -> Efficiency:
    """The row of two estimators that were measured in turns."""
    def logarithm(a: Measured, b: Measured) -> float:
        return math.log(b.variance() * b.time() / (a.variance() * a.time()))

    count = len(ours.images)
    left_out = np.array([logarithm(ours.without(k), theirs.without(k)) for k in range(count)])
    error = math.sqrt((count - 1) * left_out.var())
    variance, time_ratio = theirs.variance() / ours.variance(), theirs.time() / ours.time()
    return Efficiency(name, lights, candidates, variance, time_ratio,
                      variance * time_ratio * error, float(np.median(ours.seconds)))


def measure(scene: Scene, height: int, width: int, spp: int, renders: int,
            progress: Progress = silent) -> Efficiency:
    """Measure one scene at the middle of its animation.

    Args:
        spp: samples of each render, ours and theirs. renders: of each, 3 or more.
        progress: told of each round of renders.
    """
    renderer = Renderer(scene, height, width)
    frame = scene.frames // 2
    renderer.stage.set_frame(frame)
    path = MitsubaPath(renderer)
    renderer.sample_sum(frame, 0, 0, 1)  # compiles: the number of samples is no part of a kernel
    path.render(0, spp)
    images: tuple[list, list] = ([], [])
    milliseconds: tuple[list, list] = ([], [])
    for k in range(1, renders + 1):
        image, took = timed(lambda k=k: renderer.sample_sum(frame, 0, k, spp) / spp)
        images[0].append(image)
        milliseconds[0].append(took)
        _, took = timed(lambda k=k: path.render(k, spp))
        images[1].append(path.through_centres(k, spp))
        milliseconds[1].append(took)
        progress(k, renders, scene.name)
    ours, theirs = (Measured(np.stack(i), 1e-3 * np.array(ms), spp)
                    for i, ms in zip(images, milliseconds))
    mi_scene = renderer.stage.mi_scene
    return compare(scene.name, ours, theirs, len(mi_scene.emitters()), candidates_for(mi_scene))


def size_of(scene: Scene, pixels: int) -> tuple[int, int]:
    """(height, width) of about that many pixels in the scene's own shape."""
    height = max(1, round(math.sqrt(pixels * scene.height / scene.width)))
    return height, max(1, round(pixels / height))

