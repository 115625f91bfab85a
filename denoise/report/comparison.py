"""A comparison of two scores on the terminal."""

from __future__ import annotations

import math
import sys

from rich.console import Console
from rich.table import Table

from onespp.denoise.metrics.metric import Metric
from onespp.denoise.score.compare import SIGMAS, TIME, Change, Comparison

from .terminal import PLAIN_WIDTH


def print_comparison(found: Comparison, show_all: bool = False,
                     console: Console | None = None) -> None:
    """Table of what changed, then notes and a closing line."""
    console = console or Console(width=None if sys.stdout.isatty() else PLAIN_WIDTH)
    shown = [c for c in found.changes if show_all or c.verdict != "same" or c.failed]
    if shown:
        console.print(_table(found, shown))
    same = len(found.changes) - sum(c.verdict != "same" for c in found.changes)
    if same:
        console.print(f"{same} of {len(found.changes)} measures are the same, to within "
                      f"{SIGMAS:g} standard errors.", style="dim", highlight=False)
    for note in found.notes:
        console.print(note, style="yellow", highlight=False, markup=False)
    failures = [c for c in found.changes if c.failed]
    if failures:
        found_in = {c.method: ", ".join(found.measures[d.measure].label for d in failures
                                        if d.method == c.method) for c in failures}
        names = "; ".join(f"{method}: {labels}" for method, labels in found_in.items())
        console.print(f"Worse past the threshold: {names}.", style="bold red", highlight=False)


def _table(found: Comparison, changes: list[Change]) -> Table:
    grid = Table(title=f"{found.scene}: B against A", title_justify="left", title_style="bold")
    for heading in ("method", "measure", "A", "B", "change", ""):
        grid.add_column(heading, justify="left" if heading in ("method", "measure", "") else
                        "right", no_wrap=True)
    colours = {"better": "green", "worse": "red", "same": "dim"}
    for i, c in enumerate(changes):
        row = found.measures[c.measure]
        first = i == 0 or changes[i - 1].method != c.method
        if first and i:
            grid.add_section()
        word = "WORSE" if c.failed else c.verdict
        grid.add_row(c.method if first else "", f"{row.label} ({row.unit})" if row.unit else
                     row.label, f"{c.a:{row.format}}", f"{c.b:{row.format}}", _amount(c, row),
                     f"[{colours[c.verdict]}]{word}[/]")
    return grid


def _amount(c: Change, row: Metric) -> str:
    """The change and its standard error, in two digits of the latter."""
    if row is TIME:
        error = "" if c.error is None else f" ± {100 * c.error:.1f}"
        return f"{100 * c.change:+.1f}{error} %"
    digits = 4 if not c.error else min(8, max(2, 1 - math.floor(math.log10(c.error))))
    error = "" if c.error is None else f" ± {c.error:.{digits}f}"
    return f"{c.change:+.{digits}f}{error}"
