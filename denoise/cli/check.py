"""The command `check`: whether the frames of a sequence fit each other."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.render.files.sequence import FrameSequence

from .options import json_option, show_or_print


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@json_option
def check(folder: Path, json_to: str | None) -> None:
    """Say for how many pixels of the sequence in FOLDER the frame before shows the same surface.

    Frames are reprojected onto those before them, by matrices and motion vectors. Where motion
    vectors fit better when they are read in another way, it is named.
    """
    from onespp.api.importing import unfit_methods
    from onespp.denoise.studies.agreement import AS_IT_IS, EXCHANGED, GOOD, agreement
    from onespp.render.cli.terminal import progress

    sequence = FrameSequence.open(folder)
    with progress() as follow:
        found = agreement(sequence, follow)
    unfit = unfit_methods(sequence)

    def show() -> None:
        click.echo(f"{found.share:.1%} of the surfaces are found in the frame before "
                   f"({', '.join(f'{i}: {share:.1%}' for i, share in found.found)})")
        if found.better is not None:
            now, then = (found.readings[name] for name in (AS_IT_IS, found.better))
            todo = ("Write it so into the files: no option does it" if found.better == EXCHANGED
                    else "Import it so")
            click.echo(f"Motion looks wrong: of what moves, {now:.1%} is found {AS_IT_IS}, "
                       f"{then:.1%} with {found.better}. {todo}.")
        elif found.share < GOOD:
            click.echo("That is few, and no other reading of motion finds more: check matrices, "
                       "depth, normals and IDs, or whether the camera cuts.")
        for sentence in unfit:
            click.echo(sentence)

    show_or_print({"share": found.share, "frames": [
        {"frame": i, "share": share} for i, share in found.found], "readings": found.readings,
        "better": found.better, "unfit": unfit}, json_to, show)
