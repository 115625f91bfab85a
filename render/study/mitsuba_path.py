"""Mitsuba's `path` on a live scene: what users would render references with.

At the scene's own max_depth, with the independent sampler, Mitsuba's default, and Russian roulette
where ours has it: for shorter paths it would be another estimator.
"""

from __future__ import annotations

import drjit as dr
import numpy as np

from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.path import FIRST, SHORT
from onespp.render.tracer.view import View

NO_ROULETTE = 1 << 20  # the depth at which it would begin


class MitsubaPath:
    """`path` at the frame that a view's stage is set to, the same size."""

    def __init__(self, view: View) -> None:
        self.view = view
        depth = view.scene.max_depth
        self.integrator = mi.load_dict({"type": "path", "max_depth": depth,
                                        "rr_depth": FIRST if depth > SHORT else NO_ROULETTE})
        self.sensor = view.stage.sensor(view.height, view.width)

    def render(self, seed: int, spp: int) -> np.ndarray:
        """`mi.render` as users call it, samples spread over the pixel: (h, w, 3), linear."""
        return np.array(mi.render(self.view.stage.mi_scene, sensor=self.sensor,
                                  integrator=self.integrator, spp=spp, seed=seed))

    def through_centres(self, seed: int, spp: int) -> np.ndarray:
        """The same samples through pixel centres: (h, w, 3), linear.

        `mi.render` cannot do that, but the integrator takes any rays.
        """
        view, samples = self.view, self.view.height * self.view.width * spp
        with dr.suspend_grad():
            sampler = mi.load_dict({"type": "independent"})
            sampler.seed(seed, samples)
            pixel = dr.arange(mi.UInt32, samples) // spp
            ray, _ = view.rays().at(*view.centres(pixel))
            radiance, _, _ = self.integrator.sample(view.stage.mi_scene, sampler,
                                                    mi.RayDifferential3f(ray))
            dr.eval(radiance)  # once, and not for each component's sum
            sums = [dr.block_sum(component, spp).numpy() for component in radiance]
        return np.stack(sums, -1).reshape(view.height, view.width, 3) / spp
