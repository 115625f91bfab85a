"""The command `new`: a file to begin from."""

from __future__ import annotations

import click

from onespp.templates.write import KINDS, write_new

NEXT = {
    "method": "onespp denoise FOLDER --method {path}",
    "metric": "onespp score FOLDER --metric {path}",
    "scene": "onespp run {path}",
}


@click.command()
@click.argument("kind", type=click.Choice(KINDS))
@click.argument("name")
def new(kind: str, name: str) -> None:
    """Write NAME.py: a method, a metric or a scene of your own, commented, that runs as it is."""
    path = write_new(kind, name)
    click.echo(f"wrote {path}; try it: {NEXT[kind].format(path=path)}")
