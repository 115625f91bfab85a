"""The command `bench clips`: how fast a data set is read to train on."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.clips.speed import speeds
from onespp.render.cli.figures import json_option, show_or_print


@click.command("clips")
@click.argument("folder", type=click.Path(path_type=Path), metavar="DIR")
@click.option("--frames", type=int, default=8, show_default=True, metavar="N", help="Of a clip.")
@click.option("--crop", type=int, metavar="N", help="Pixels a side; default whole frames.")
@click.option("--split", default="train", show_default=True, metavar="NAME", help="Which clips.")
@click.option("--workers", type=click.IntRange(1, 256), multiple=True, default=(1, 2, 4),
              show_default=True, metavar="N",
              help="Processes that read at once; may be given several times.")
@click.option("--seconds", type=float, default=5.0, show_default=True, metavar="S",
              help="That each number of them reads, files alone and clips.")
@click.option("--cache", type=click.Path(path_type=Path), metavar="DIR",
              help="As of onespp.Clips: memory maps, made by who reads a sequence first.")
@json_option
def bench_clips(folder: Path, frames: int, crop: int | None, split: str, workers: tuple[int, ...],
                seconds: float, cache: Path | None, json_to: str | None) -> None:
    """Clips a second that are read of the data set in DIR, by 1, 2 and 4 processes.

    Beside them those of which the files are only decoded.
    """
    found = speeds(folder, workers, seconds, frames=frames, crop=crop, split=split,
                   cache=None if cache is None else str(cache))
    show_or_print(found, json_to, lambda: click.echo("\n".join([
        "workers  decoded/s  clips/s", *(f"{speed.processes:7}  {speed.decoded:9.2f}  "
                                         f"{speed.clips:7.2f}" for speed in found)])))
