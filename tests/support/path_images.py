"""Images of Mitsuba's own path tracer, and of frames, to compare ours with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from onespp.render.channels import FRAME, GLOSS, SPLIT
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.renderer import Renderer

from .statistics import assert_same_mean, blocks, mean_and_variance


def path_images(renderer: Renderer, spp: int, replicates: int) -> list[np.ndarray]:
    """So many independent (h, w, 3) images of the scene that a renderer is set to, at its frame;
    through a box filter, since Mitsuba jitters its camera rays, and without roulette."""
    path = mi.load_dict({"type": "path", "max_depth": renderer.scene.max_depth, "rr_depth": 1000})
    sensor = renderer.stage.sensor(renderer.height, renderer.width)
    return [mi.render(renderer.stage.mi_scene, sensor=sensor, integrator=path, spp=spp,
                      seed=k).numpy() for k in range(replicates)]


def assert_mean_of_path(renderer: Renderer, frame: int) -> None:
    """Antialiased references have the mean of Mitsuba's `path`, frames that of references."""
    spp, replicates = 64, 16
    ours = [renderer.sample_sum(frame, 0, k, spp, antialias=True) / spp for k in range(replicates)]
    samples = [renderer.sample_sum(frame, 1, k, spp) / spp for k in range(replicates)]
    theirs = path_images(renderer, 4 * spp, replicates)
    frames = [renderer.frame(frame, k, ("color",))["color"] for k in range(100)]
    for a, b in ((ours, theirs), (frames, samples)):
        assert_same_mean(*_mean_of_blocks(a), *_mean_of_blocks(b))


def light_of_frames(renderer: Renderer, seed: int, count: int) -> list[Mapping[str, np.ndarray]]:
    """What frame 0 tells of light, by so many seeds."""
    channels = [c for c in ("direct", "indirect", "specular", "visibility", "emission")
                if c in (*FRAME, *SPLIT, *(GLOSS if renderer.stage.glossy else ()))]
    return [renderer.frame(0, seed + k, channels).images for k in range(count)]


def assert_same_light(ours: Sequence[Mapping[str, np.ndarray]],
                      theirs: Sequence[Mapping[str, np.ndarray]]) -> None:
    """Every channel has the same mean."""
    for name in ours[0]:
        a, b = (_mean_of_blocks([np.atleast_3d(f[name]) for f in of]) for of in (ours, theirs))
        assert_same_mean(*a, *b)


def _mean_of_blocks(images: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return mean_and_variance([blocks(image, 8) for image in images])
