"""The commands `bench render` and `bench reference`: against Mitsuba's own integrators."""

from __future__ import annotations

from statistics import median

import click

from onespp.api.loading import load
from onespp.render.host.memory import require_memory

from .arguments import LARGEST_SIDE
from .figures import json_option, show_or_print
from .terminal import progress

HEADER = (f"{'scene':24} {'lights':>6} {'M':>2} {'variance':>9} {'time':>6} {'better':>7}        "
          f"{'s a render':>10}")


@click.command("render")
@click.argument("scene", default="box")
@click.option("--side", type=click.IntRange(1, LARGEST_SIDE), default=512, show_default=True,
              metavar="N", help="Pixels a side.")
@click.option("--repeats", type=click.IntRange(1, 1000), default=9, show_default=True, metavar="N",
              help="Frames that count.")
@json_option
def bench_render(scene: str, side: int, repeats: int, json_to: str | None) -> None:
    """Time a frame of SCENE (a name, or a file), against mi.render with `aov` around `path`.

    All channels at 1 spp, in turns, after a warm-up; medians.
    """
    require_memory(side, side)
    from onespp.render.study.frames import time_frames

    ours, theirs = time_frames(load(scene), side, repeats)
    ratios = [b / a for a, b in zip(ours, theirs)]
    show_or_print({"scene": scene, "side": side, "ms": ours, "aov_ms": theirs,
                   "median_ratio": median(ratios)}, json_to, lambda: click.echo(
        f"{scene} {side}x{side}: {median(ours):.0f} ms, aov around path "
        f"{median(theirs):.0f} ms, {median(ratios):.2f} times as long "
        f"({min(ratios):.2f} to {max(ratios):.2f})"))


@click.command("reference")
@click.argument("scenes", nargs=-1, metavar="[SCENES]...")
@click.option("--pixels", type=click.IntRange(64, LARGEST_SIDE**2), default=4096, show_default=True,
              metavar="N", help="Pixels of an image, about, in the scene's own shape.")
@click.option("--spp", type=click.IntRange(1, 1 << 16), default=256, show_default=True, metavar="N",
              help="Samples a pixel of every render.")
@click.option("--repeats", type=click.IntRange(3, 1000), default=5, show_default=True, metavar="N",
              help="Renders of each, of which the median time counts.")
@json_option
def bench_reference(scenes: tuple[str, ...], pixels: int, spp: int, repeats: int,
                    json_to: str | None) -> None:
    """Measure references of SCENES against mi.render with `path`: error at equal time.

    Names or files; default all scenes but the hard ones. The same depth, pixel centres and samples,
    in turns, after a warm-up. Columns: lights; M, points of them that a vertex compares; how many
    times the variance of a sample (in clipped sRGB) and the time that `path` has; and their
    product, how many times less squared error ours has at equal time.
    """
    from onespp.render.study.efficiency import measure, size_of
    from onespp.scenes import catalog

    every = (*catalog.SCENES, *catalog.GENERATED)
    loaded = [load(name) for name in scenes or every]
    sizes = [size_of(scene, pixels) for scene in loaded]
    for height, width in sizes:
        require_memory(height, width)
    if json_to != "-":
        click.echo(HEADER)
    rows = []
    with progress() as report:
        for scene, (height, width) in zip(loaded, sizes):
            row = measure(scene, height, width, spp, repeats, report)
            rows.append(row)
            if json_to != "-":
                click.echo(f"{row.scene:24} {row.lights:6} {row.candidates:2} {row.variance:9.2f} "
                           f"{row.time:6.2f} {row.better:7.2f} {f'±{row.error:.2f}':6} "
                           f"{row.seconds:10.2f}")
    better = [row.better for row in rows]
    show_or_print(rows, json_to, lambda: click.echo(
        f"median {median(better):.2f}, least {min(better):.2f}") if rows[1:] else None)
