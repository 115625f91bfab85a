"""The option `--json` of commands that show figures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from onespp.render.files.atomic import write_text

json_option = click.option("--json", "json_to", metavar="FILE",
                           help="Also write the figures to FILE; - prints them instead of tables.")


def show_or_print(figures: Any, json_to: str | None, show: Callable[[], None]) -> None:
    """Show figures by `show`, and write them to the file `json_to`; "-": print them alone.

    Args:
        figures: JSON text, or what is to become it: numbers, texts, dataclasses, models, and lists
            and dicts of these. What is not finite becomes null.
    """
    if json_to is not None:
        text = figures if isinstance(figures, str) else _json(figures)
        if json_to == "-":
            click.echo(text, nl=False)
            return
        write_text(Path(json_to), text)
    show()


def _json(figures: Any) -> str:
    from pydantic_core import to_json

    return to_json(figures, indent=2, inf_nan_mode="null", fallback=float).decode() + "\n"
