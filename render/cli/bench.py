"""The commands `bench render` and `bench reference`: against Mitsuba's own integrators."""

from __future__ import annotations

from statistics import median

import click

from onespp.api.loading import load
from onespp.render.host.memory import require_memory
from onespp.scenes.description import LONGEST_PATH

from .arguments import LARGEST_SIDE
from .figures import json_option, show_or_print
from .terminal import progress

FRAME_HEADER = (f"{'scene':24} {'depth':>5} {'ms a frame':>10} {'path':>8} {'times':>6} {'aov':>8} "
                f"{'times':>6}")
REFERENCE_HEADER = (f"{'scene':24} {'lights':>6} {'M':>2} {'variance':>9} {'time':>6} "
                    f"{'better':>7}        {'s a render':>10}")


@click.command("render")
@click.argument("scenes", nargs=-1, metavar="[SCENES]...")
@click.option("--side", type=click.IntRange(1, LARGEST_SIDE), default=512, show_default=True,
              metavar="N", help="Pixels a side.")
@click.option("--max-depth", type=click.IntRange(1, LONGEST_PATH), metavar="N",
              help="Segments of the longest path; default the scene's.")
@click.option("--repeats", type=click.IntRange(1, 1000), default=9, show_default=True, metavar="N",
              help="Frames that count.")
@json_option
def bench_render(scenes: tuple[str, ...], side: int, max_depth: int | None, repeats: int,
                 json_to: str | None) -> None:
    """Time a frame of SCENES against mi.render with `path`, alone and in `aov`.

    Names or files; default box. All channels at 1 spp, in turns, after a warm-up; medians. Columns:
    the longest path; and how many times as long as theirs ours takes, the median of ratios.
    """
    require_memory(side, side)
    from onespp.render.study.frames import time_frames

    loaded, rows = [load(name) for name in scenes or ["box"]], []
    if json_to != "-":
        click.echo(FRAME_HEADER)
    with progress() as report:
        for scene in loaded:
            row = time_frames(scene, side, repeats, max_depth, report)
            rows.append(row)
            if json_to != "-":
                click.echo(f"{row.scene:24} {row.max_depth:5} {median(row.ms):10.1f} "
                           f"{median(row.path_ms):8.1f} {row.times_as_long(row.path_ms):6.2f} "
                           f"{median(row.aov_ms):8.1f} {row.times_as_long(row.aov_ms):6.2f}")
    show_or_print(rows, json_to, lambda: None)


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
        click.echo(REFERENCE_HEADER)
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
