"""The command `view`."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.render.cli.options import frames_option
from onespp.render.cli.terminal import progress
from onespp.render.errors import InputError
from onespp.render.files.frame_ranges import parse_frames
from onespp.render.files.sequence import FrameSequence


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="NAME",
              help="Results to show; may be given several times; default all that there are.")
@frames_option
@click.option("--tev", "address", default="localhost:14158", show_default=True,
              metavar="HOST:PORT", help="Where tev listens.")
def view(folder: Path, methods: tuple[str, ...], frames: str | None, address: str) -> None:
    """Show input, results, errors and reference of the sequence in FOLDER in a running tev."""
    from onespp.denoise.report.tev import view as send

    host, _, port = address.rpartition(":")
    if not host or not port.isascii() or not port.isdigit() or int(port) > 65535:
        raise InputError(f"--tev is '{address}': use HOST:PORT, as localhost:14158")
    sequence = FrameSequence.open(folder)
    with progress() as report:
        sent = send(sequence, methods, parse_frames(frames) if frames else (), host, int(port),
                    report)
    click.echo(f"sent {len(sent)} images to tev at {address}")
