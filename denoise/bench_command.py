"""The command `bench`."""

from __future__ import annotations

from pathlib import Path

import click

from render.arguments import parse_size
from render.command import device_option, threads_option, use
from render.terminal import progress


@click.command()
@click.option("--size", default="512x512", show_default=True, metavar="WxH", help="Pixels.")
@click.option("--repeats", type=click.IntRange(1, 1000), default=15, show_default=True, metavar="N",
              help="Runs of each kernel, of which the median counts.")
@click.option("--json", "json_to", metavar="FILE",
              help="Also write the figures to FILE; - prints them instead of the table.")
@device_option
@threads_option
def bench(size: str, repeats: int, json_to: str | None, device: str, threads: int | None) -> None:
    """Measure the denoising kernels on this machine, against Open Image Denoise and its limits."""
    height, width = parse_size(size)
    use(device, threads)
    from render.atomic import write_text

    from .bench import bench as measure
    from .bench_table import print_bench

    with progress() as begin:
        steps = begin(f"bench {width}x{height}", repeats + 2)
        result = measure(height, width, repeats, lambda done, total: steps.advance(done))
    if json_to == "-":
        click.echo(result.json_text(), nl=False)
        return
    if json_to:
        write_text(Path(json_to), result.json_text())
    print_bench(result)
