"""The option `--json` of commands that show figures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from onespp.render.files.atomic import write_text

json_option = click.option("--json", "json_to", metavar="FILE",
                           help="Also write the figures to FILE; - prints them instead of tables.")


def show_or_print(text: str, json_to: str | None, show: Callable[[], None]) -> None:
    """Show figures by `show`, and write them to the file `json_to`; "-": print them alone."""
    if json_to == "-":
        click.echo(text, nl=False)
        return
    if json_to is not None:
        write_text(Path(json_to), text)
    show()
