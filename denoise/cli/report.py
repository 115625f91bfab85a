"""The command `report`."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.api import scoring as api
from onespp.render.files.sequence import FrameSequence

from .score import score_in


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--channels", metavar="NAMES",
              help="Of the frames, as albedo,normal; default all. Fewer make a smaller folder.")
def report(folder: Path, channels: str | None) -> None:
    """Write a report of the scored sequence in FOLDER that opens in any browser."""
    sequence = FrameSequence.open(folder)
    if not (folder / "scores.json").exists():
        score_in(folder)
    names = channels and [name.strip() for name in channels.split(",") if name.strip()]
    page = api.report(sequence, names or None).path
    click.echo(f"wrote {page}: open it in a browser")
