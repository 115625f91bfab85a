"""Images of Mitsuba's own path tracer, to compare ours with."""

from __future__ import annotations

import numpy as np

from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.renderer import Renderer


def path_images(renderer: Renderer, spp: int, replicates: int) -> list[np.ndarray]:
    """So many independent (h, w, 3) images of the scene that a renderer is set to, at its frame;
    through a box filter, since Mitsuba jitters its camera rays, and without roulette."""
    path = mi.load_dict({"type": "path", "max_depth": renderer.scene.max_depth, "rr_depth": 1000})
    sensor = renderer.stage.sensor(renderer.height, renderer.width)
    return [mi.render(renderer.stage.mi_scene, sensor=sensor, integrator=path, spp=spp,
                      seed=k).numpy() for k in range(replicates)]
