"""A frame with all channels timed against Mitsuba's `path`, alone and in `aov`, in turns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from onespp.render.host.timed import timed
from onespp.render.mitsuba.variant import mi
from onespp.render.progress import Progress, silent
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Scene

from .mitsuba_path import MitsubaPath

WARM_UP = 3  # frames: the second is recorded (`render/host/recorded.py`)
AOVS = "albedo:albedo,N:sh_normal,P:position,Z:depth,ID:shape_index"


@dataclass(frozen=True)
class FrameTimes:
    """Milliseconds, all to NumPy arrays, each seed once: our frames with all channels, `mi.render`
    with `path`, and with `aov` around it."""

    scene: str
    side: int
    max_depth: int
    ms: list[float]
    path_ms: list[float]
    aov_ms: list[float]

    def times_as_long(self, theirs: list[float]) -> float:
        """As theirs: median of the ratios."""
        return median(a / b for a, b in zip(self.ms, theirs))


def time_frames(scene: Scene, side: int, repeats: int, max_depth: int | None = None,
                report: Progress = silent) -> FrameTimes:
    """Frame 0 of a scene as `onespp render` makes it, at its own `max_depth` or another."""
    scene = scene if max_depth is None else replace(scene, max_depth=max_depth)
    renderer = Renderer(scene, side, side, direct="resampled", sampler="zsobol")
    path = MitsubaPath(renderer)
    aov = mi.load_dict({"type": "aov", "aovs": AOVS, "path": path.integrator})

    def around_path(seed: int) -> np.ndarray:
        return np.array(mi.render(renderer.stage.mi_scene, sensor=path.sensor, integrator=aov,
                                  spp=1, seed=seed))

    renders: list[Callable[[int], object]] = [
        lambda seed: renderer.frame(0, seed, renderer.channels),
        lambda seed: path.render(seed, 1), around_path]
    times: list[list[float]] = [[] for _ in renders]
    for seed in range(WARM_UP + repeats):
        for render, into in zip(renders, times):
            _, took = timed(lambda render=render, seed=seed: render(seed))
            into.append(took)
        report(seed + 1, WARM_UP + repeats, scene.name)
    return FrameTimes(scene.name, side, scene.max_depth, *(t[WARM_UP:] for t in times))
