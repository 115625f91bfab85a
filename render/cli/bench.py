"""The command `bench render`: how long a frame takes, against Mitsuba's own integrators."""

from __future__ import annotations

from statistics import median

import click

from onespp.render.host.memory import require_memory

from .arguments import LARGEST_SIDE


@click.command("render")
@click.argument("scene", default="box")
@click.option("--side", type=click.IntRange(1, LARGEST_SIDE), default=512, show_default=True,
              metavar="N", help="Pixels a side.")
@click.option("--repeats", type=click.IntRange(1, 1000), default=9, show_default=True, metavar="N",
              help="Frames that count.")
def bench_render(scene: str, side: int, repeats: int) -> None:
    """Time a frame of SCENE, all channels, against mi.render with `aov` around `path`.

    The same channels at 1 spp, in turns, after a warm-up; medians.
    """
    require_memory(side, side)
    from onespp.render.tracer.timing import time_frames

    ours, theirs = time_frames(scene, side, repeats)
    ratios = [b / a for a, b in zip(ours, theirs)]
    click.echo(f"{scene} {side}x{side}: {median(ours):.0f} ms, aov around path "
               f"{median(theirs):.0f} ms, {median(ratios):.2f} times as long "
               f"({min(ratios):.2f} to {max(ratios):.2f})")
