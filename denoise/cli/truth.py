"""The command `truth`: what a small reference says, beside a large one."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.render.files.sequence import FrameSequence


@click.command()
@click.argument("truth_folder", type=click.Path(path_type=Path), metavar="LARGE")
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path),
                metavar="SMALL...")
def truth(truth_folder: Path, folders: tuple[Path, ...]) -> None:
    """Print PSNR by halves and against the mean of small references, beside that of a large one.

    All are renders of the same frames, with --reference-spp (and --seed) of their own; the results
    of methods are those in LARGE.
    """
    from onespp.denoise.studies.truth import compare_references, markdown, off

    large = FrameSequence.open(truth_folder)
    found = compare_references(large, [FrameSequence.open(folder) for folder in folders])
    click.echo(markdown(large.manifest.scene, found))
    click.echo()
    for spp, plain, halves, scaled in off(found):
        click.echo(f"{spp or 'unknown'} spp: off by {plain:.2f} dB against the mean, by "
                   f"{halves:.2f} dB by halves, which is {scaled:.1f} of its standard errors")
