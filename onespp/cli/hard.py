"""The command `hard`: every method on scenes that break denoisers."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.denoise.cli.denoise import built, method_names
from onespp.render.cli.figures import json_option, show_or_print
from onespp.render.cli.options import device_option, threads_option, use
from onespp.render.cli.terminal import progress
from onespp.render.progress import Progress

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
    from onespp.api.studies import judge_hard
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
            rows += judge_hard(name, chosen, out / name, reference_spp,
                               _within(report, number, len(names or HARD), name),
                               lambda note, name=name: click.echo(f"{name}: {note}", err=True))
    show_or_print(rows, json_to, lambda: click.echo(markdown(rows)))


def _within(report: Progress, number: int, count: int, name: str) -> Progress:
    """Of one scene, in thirds: frames, references, judging."""
    thirds: dict[str, float] = {}

    def tell(done: float, total: float, what: str, note: str = "", /) -> None:
        thirds[what] = done / total / 3
        report(number + sum(thirds.values()), count, "hard scenes", name)

    return tell
