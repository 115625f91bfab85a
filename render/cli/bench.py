"""`python -m onespp.render.cli.bench SCENE`: a frame with all channels against Mitsuba's `aov` around `path`.

The same channels at 512x512 and 1 spp, in turns, after a warm-up; medians.
"""

from __future__ import annotations

import time
from statistics import median

import click
import drjit as dr
import numpy as np

from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog

from .terminal import run

WARM_UP = 2
AOVS = "albedo:albedo,N:sh_normal,P:position,Z:depth,ID:shape_index"


def time_frames(scene_name: str, side: int, repeats: int) -> tuple[list[float], list[float]]:
    """Milliseconds of our frames and of Mitsuba's, both to NumPy arrays, each seed once."""
    scene = catalog.load(scene_name)
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
            dr.sync_thread()
            started = time.perf_counter()
            render(seed)
            dr.sync_thread()
            into.append(1e3 * (time.perf_counter() - started))
    return times[0][WARM_UP:], times[1][WARM_UP:]


@click.command()
@click.argument("scene", default="box")
@click.option("--side", default=512, show_default=True, metavar="N", help="Pixels a side.")
@click.option("--repeats", default=9, show_default=True, metavar="N", help="Frames that count.")
def bench(scene: str, side: int, repeats: int) -> None:
    """Time a frame of SCENE with all channels against mi.render with the aov integrator."""
    ours, theirs = time_frames(scene, side, repeats)
    ratios = [b / a for a, b in zip(ours, theirs)]
    click.echo(f"{scene} {side}x{side}: {median(ours):.0f} ms, aov around path "
               f"{median(theirs):.0f} ms, {median(ratios):.2f} times as long "
               f"({min(ratios):.2f} to {max(ratios):.2f})")


if __name__ == "__main__":
    run(bench, name="python -m onespp.render.cli.bench")
