"""A frame with all channels timed against Mitsuba's `aov` around `path`, in turns."""

from __future__ import annotations

import numpy as np

from onespp.render.host.timed import timed
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Scene

WARM_UP = 2
AOVS = "albedo:albedo,N:sh_normal,P:position,Z:depth,ID:shape_index"


def time_frames(scene: Scene, side: int, repeats: int) -> tuple[list[float], list[float]]:
    """Milliseconds of our frames and of Mitsuba's, both to NumPy arrays, each seed once."""
    renderer = Renderer(scene, side, side)
    sensor = renderer.stage.sensor(side, side)
    integrator = mi.load_dict({"type": "aov", "aovs": AOVS,
                               "path": {"type": "path", "max_depth": scene.max_depth}})

    def theirs(seed: int) -> None:
        np.array(mi.render(renderer.stage.mi_scene, sensor=sensor, integrator=integrator, spp=1,
                           seed=seed))

    times: tuple[list[float], list[float]] = ([], [])
    for seed in range(WARM_UP + repeats):
        for render, into in zip((lambda k: renderer.frame(0, k), theirs), times):
            _, took = timed(lambda render=render, seed=seed: render(seed))
            into.append(took)
    return times[0][WARM_UP:], times[1][WARM_UP:]
