"""Whether a scene is as bright for us as for Mitsuba's own integrator."""

from __future__ import annotations

from typing import Any

import numpy as np

from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Scene

PARTS = 4


def means(theirs: Any, ours: Scene, spp: int, frame: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """(PARTS, 3) mean colours of independent renders, by Mitsuba and by us.

    Args:
        theirs: a scene of Mitsuba's with a sensor, an integrator and a film of the scene's size.
    """
    height, width = theirs.sensors()[0].film().size()[::-1]
    rendered = np.stack([np.array(mi.render(theirs, spp=spp, seed=i))[..., :3].mean((0, 1))
                         for i in range(PARTS)])
    renderer = Renderer(ours, int(height), int(width))
    return rendered, np.stack([
        renderer.sample_sum(frame, 1, part, spp, antialias=True).mean((0, 1)) / spp
        for part in range(PARTS)])


def assert_as_bright(theirs: np.ndarray, ours: np.ndarray) -> None:
    """Within 1 %, or three standard errors, which have to be small too."""
    error = np.sqrt((theirs.var(0, ddof=1) + ours.var(0, ddof=1)) / PARTS)
    off = abs(ours.mean(0) - theirs.mean(0))
    assert (off < np.maximum(0.01 * theirs.mean(0), 3 * error)).all(), (theirs, ours)
    assert (error < 0.01 * theirs.mean(0)).all()  # else the line above says little
