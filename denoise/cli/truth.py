"""The command `truth`: what a small reference says, beside a large one."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.render.files.sequence import FrameSequence

from .options import json_option, show_or_print


@click.command()
@click.argument("truth_folder", type=click.Path(path_type=Path), metavar="LARGE")
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path),
                metavar="SMALL...")
@json_option
def truth(truth_folder: Path, folders: tuple[Path, ...], json_to: str | None) -> None:
    """Print PSNR by halves and against the mean of small references, beside that of a large one.

    All are renders of the same frames, with --reference-spp (and --seed) of their own; the results
    of methods are those in LARGE.
    """
    from onespp.denoise.studies.truth import compare_references, markdown, off

    large = FrameSequence.open(truth_folder)
    found = compare_references(large, [FrameSequence.open(folder) for folder in folders])
    errors = off(found)

    def show() -> None:
        click.echo(markdown(large.manifest.scene, found))
        click.echo()
        for spp, plain, halves, scaled in errors:
            click.echo(f"{spp or 'unknown'} spp: off by {plain:.2f} dB against the mean, by "
                       f"{halves:.2f} dB by halves, which is {scaled:.1f} of its standard errors")

    keys = ("spp", "plain_db", "halves_db", "halves_standard_errors")
    show_or_print({"scene": large.manifest.scene, "methods": found,
                   "off": [dict(zip(keys, row)) for row in errors]}, json_to, show)
