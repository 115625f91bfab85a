"""The command `time`: methods timed in turns."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.render.cli.options import device_option, threads_option, use
from onespp.render.cli.terminal import command_line, progress
from onespp.render.files.lock import writing
from onespp.render.files.sequence import FrameSequence

from .denoise import built, method_names
from .options import json_option, show_or_print


@click.command("time")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="NAME", required=True,
              help="As for `denoise`; give two or more. Ratios are to the first.")
@click.option("--frames", type=click.IntRange(1), default=4, show_default=True, metavar="N",
              help="Frames denoised in each round, the first ones of the sequence.")
@click.option("--rounds", type=click.IntRange(1), default=5, show_default=True, metavar="N",
              help="Rounds that count; one more goes before them.")
@json_option
@device_option
@threads_option
def time_(folder: Path, methods: tuple[str, ...], frames: int, rounds: int, json_to: str | None,
          device: str, threads: int | None) -> None:
    """Time methods in turns on the sequence in FOLDER; `score` then uses these times."""
    use(device, threads)
    from onespp.denoise.catalog import name_of
    from onespp.denoise.run.interleaved_timing import time_methods

    sequence = FrameSequence.open(folder)
    chosen = {name_of(method) or name: method
              for name, method in built(method_names(methods)).items()}
    with writing(folder, "time"), progress() as report:
        times = time_methods(sequence, chosen, frames, rounds, report, command_line())

    def show() -> None:
        for name, t in times.methods.items():
            click.echo(
                f"{name}: {t.ms:.1f} ms ({t.ms_quartiles[0]:.1f} to {t.ms_quartiles[1]:.1f}), "
                f"{t.ratio:.2f} times {times.ratio_to} ({t.ratio_quartiles[0]:.2f} to "
                f"{t.ratio_quartiles[1]:.2f}), first frame {t.first_ms:.0f} ms")
        click.echo(f"medians and quartiles of {times.steps} steps; wrote {folder / 'times.json'}")

    show_or_print(times, json_to, show)
