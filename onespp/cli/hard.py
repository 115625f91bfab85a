"""The command `hard`: every method on scenes that break denoisers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from onespp.denoise.cli.denoise import built, method_names
from onespp.render.cli.figures import json_option, show_or_print
from onespp.render.cli.options import device_option, threads_option, use
from onespp.render.cli.terminal import progress
from onespp.render.progress import Progress

if TYPE_CHECKING:
    from onespp.denoise.catalog import Method

REFERENCE_SPP = 256


@click.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--method", "methods", multiple=True, metavar="NAME",
              help="Try these instead of all, as for `denoise`; may be given several times.")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", default=Path("data/hard"),
              show_default=True, help="Folder of the sequences.")
@click.option("--reference-spp", type=int, default=REFERENCE_SPP, show_default=True, metavar="N",
              help="Samples a pixel of the ground truth.")
@json_option
@device_option
@threads_option
def hard(names: tuple[str, ...], methods: tuple[str, ...], out: Path, reference_spp: int,
         json_to: str | None,
         device: str, threads: int | None) -> None:
    """Try every method on hard scenes (all, or those named), and print a table in Markdown.

    Renders what is missing. For each scene and method: error, what its history gains, how soon it
    recovers from a sudden change, and whether it keeps the energy.
    """
    use(device, threads)
    from onespp.denoise.catalog import METHODS
    from onespp.denoise.studies.hard_scenes import markdown
    from onespp.scenes import catalog
    from onespp.scenes.hard import HARD

    unknown = [name for name in names if name not in HARD]
    if unknown:
        catalog.load(f"hard/{unknown[0]}")  # says what there is
    rows, chosen = [], built(method_names(methods) if methods else METHODS)
    with progress() as report:
        for number, name in enumerate(names or HARD):
            rows += _judge_hard(name, chosen, out, reference_spp,
                                _within(report, number, len(names or HARD), name))
    show_or_print(rows, json_to, lambda: click.echo(markdown(rows)))


def _judge_hard(name: str, methods: Mapping[str, Method], out: Path, reference_spp: int,
                report: Progress) -> list:
    """Rows of one hard scene."""
    from onespp.denoise.studies.hard_scenes import judge
    from onespp.render.job import RenderJob, render_sequence
    from onespp.render.references import reference_notes
    from onespp.scenes.hard import HARD

    hard = HARD[name]
    scene = hard.make()
    job = RenderJob(scene, range(scene.frames), scene.height, scene.width,
                    reference_spp=reference_spp)
    needed = {channel for method in methods.values() for channel in method.needs}
    job = replace(job, channels=tuple(dict.fromkeys((*job.channel_names(), *sorted(needed)))))
    sequence = render_sequence(job, out / name, progress=report)
    for note in reference_notes(sequence, sequence.frames, reference_spp):
        click.echo(f"{name}: {note}", err=True)
    return judge(sequence, name, hard.event, hard.diffuse, report, methods)


def _within(report: Progress, number: int, count: int, name: str) -> Progress:
    """Of one scene, in thirds: frames, references, judging."""
    thirds: dict[str, float] = {}

    def tell(done: float, total: float, what: str, note: str = "", /) -> None:
        thirds[what] = done / total / 3
        report(number + sum(thirds.values()), count, "hard scenes", name)

    return tell
