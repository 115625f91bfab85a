"""Scores as a table on the terminal: speed against error."""

from __future__ import annotations

import sys

from rich.console import Console
from rich.table import Table

from onespp.denoise.metrics.table import HEADLINE
from onespp.denoise.score.causes import CAUSES, HISTORIES
from onespp.denoise.score.method_score import ClassScore
from onespp.denoise.score.scorecard import Scores, best, caption, cells

PLAIN_WIDTH = 100

def print_scores(scores: Scores, console: Console | None = None) -> None:
    """Table, caption and notes. In a pipe or a log, plain and 100 columns wide."""
    console = console or Console(width=None if sys.stdout.isatty() else PLAIN_WIDTH)
    console.print(table(scores))
    console.print(caption(scores), style="dim", highlight=False)
    for note in scores.notes:
        console.print(note, style="yellow", highlight=False, markup=False)


def table(scores: Scores) -> Table:
    """Input first, then methods from fast to slow; the best of each measure is bold."""
    grid = Table(title=f"{scores.scene}: speed against error", title_justify="left",
                 title_style="bold")
    for heading in ("method", *_headings(scores)):
        grid.add_column(heading, justify="left" if heading == "method" else "right",
                        no_wrap=heading != "method")
    bold = best(scores)
    for name in scores.ordered():
        grid.add_row(scores.label(name), *(
            f"[bold]{text}[/bold]" if (name, heading) in bold else text
            for heading, text in cells(scores, name).items()))
    return grid


def print_classes(scores: Scores, console: Console | None = None) -> None:
    """Error by cause and by length of history: dB in the class, share of the squared error."""
    console = console or Console(width=None if sys.stdout.isatty() else PLAIN_WIDTH)
    for title, names in (("cause", CAUSES), ("history", HISTORIES)):
        field = f"by_{title}"
        classes = {name: getattr(scores.methods[name], field) for name in scores.ordered()}
        shown = [c for c in names if any(c in k and k[c].pixels for k in classes.values())]
        if not shown:
            console.print(f"There is no error by {title}: it takes references, and frames with "
                          "normal, depth and id.", style="yellow", highlight=False)
            continue
        grid = Table(title=f"{scores.scene}: {HEADLINE.label} in {HEADLINE.unit} by {title}, "
                     "and share of the squared error", title_justify="left", title_style="bold")
        grid.add_column("method")
        for name in shown:
            grid.add_column(f"{name} frames" if title == "history" else name, justify="right")
        rows = {name: row for name, row in classes.items() if row}
        pixels = next(iter(rows.values()))
        grid.add_row("of all pixels", *(f"{pixels[c].pixels:.1%}" for c in shown), style="dim")
        for name, row in rows.items():
            grid.add_row(scores.label(name), *(
                f"{_class(row[c])} {row[c].mse_share:4.0%}" for c in shown))
        console.print(grid)


def print_splits(scores: Scores, console: Console | None = None) -> None:
    """Bias and variance: root mean squares of display values, and bias's share of the error."""
    console = console or Console(width=None if sys.stdout.isatty() else PLAIN_WIDTH)
    grid = Table(title=f"{scores.scene}: bias and variance over seeds", title_justify="left",
                 title_style="bold")
    for heading in ("method", "renders", "bias", "deviation", "bias in squared error"):
        grid.add_column(heading, justify="left" if heading == "method" else "right")
    for name in scores.ordered():
        if s := scores.methods[name].split:
            bias = max(0.0, s.bias_squared)
            grid.add_row(scores.label(name), str(s.renders), f"{bias ** 0.5:.4f}",
                         f"{s.variance ** 0.5:.4f}",
                         f"{bias / (bias + s.variance):.0%}" if bias + s.variance else "-")
    console.print(grid)


def _headings(scores: Scores) -> list[str]:
    return list(cells(scores, next(iter(scores.methods))))


def _class(score: ClassScore) -> str:
    error = "" if score.error is None else f" ±{score.error:.1f}"
    return ("-" if score.psnr_srgb is None else f"{score.psnr_srgb:.1f}") + error
