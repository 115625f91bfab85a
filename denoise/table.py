"""Scores as a table on the terminal: speed against error."""

from __future__ import annotations

import sys

from rich.console import Console
from rich.table import Table

from .metrics import HEADLINE, METRICS, Metric
from .scorecard import INPUT, MethodScore, Scores

PLAIN_WIDTH = 100


def print_scores(scores: Scores, console: Console | None = None) -> None:
    """Table, caption and notes. In a pipe or a log, plain and 100 columns wide."""
    console = console or Console(width=None if sys.stdout.isatty() else PLAIN_WIDTH)
    console.print(table(scores))
    console.print(caption(scores), style="dim", highlight=False)
    for note in scores.notes:
        console.print(note, style="yellow", highlight=False)


def table(scores: Scores) -> Table:
    """Input first, then methods from fast to slow; the best of each measure is bold."""
    grid = Table(title=f"{scores.scene}: speed against error", title_justify="left",
                 title_style="bold")
    for heading in ("method", *_headings(scores)):
        grid.add_column(heading, justify="left" if heading == "method" else "right",
                        no_wrap=heading != "method")
    best = _best(scores)
    for name in scores.ordered():
        grid.add_row(name, *(f"[bold]{text}[/bold]" if (name, heading) in best else text
                             for heading, text in cells(scores, name).items()))
    return grid


def cells(scores: Scores, name: str) -> dict[str, str]:
    """Column heading -> text, for one method."""
    method = scores.methods[name]
    width, height = scores.size
    row = {_heading(m): _number(method[m.name], m.format) for m in METRICS.values()}
    gain = None if name == INPUT else _gain(scores, method)
    row[f"gain ({HEADLINE.unit})"] = _number(gain, "+.2f")
    ms = method.ms_per_frame
    row["ms/frame"] = _number(ms, ".1f")
    row["Mpix/s"] = _number(width * height / ms / 1e3 if ms else None, ".1f")
    if any(len(m.per_frame) < len(scores.frames) for m in scores.methods.values()):
        row["frames"] = f"{len(method.per_frame)}/{len(scores.frames)}"
    return row


def caption(scores: Scores) -> str:
    """What the numbers stand on; nothing in it depends on the machine."""
    width, height = scores.size
    parts = [f"{len(scores.frames)} frames of {width}x{height}"]
    if scores.has_reference:
        parts.append(f"{HEADLINE.label} on {scores.tone_map}, mean over frames")
        parts.append(f"reference {scores.reference_spp} spp")
        if scores.reference_floor_db is not None:
            parts[-1] += (f", whose own noise caps {HEADLINE.label} at "
                          f"{scores.reference_floor_db:.1f} {HEADLINE.unit}")
    return "; ".join([*parts, "time: median after the first frame, without files"]) + "."


def _heading(metric: Metric) -> str:
    return f"{metric.label} ({metric.unit})" if metric.unit else metric.label


def _headings(scores: Scores) -> list[str]:
    return list(cells(scores, next(iter(scores.methods))))


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else f"{value:{form}}"


def _gain(scores: Scores, method: MethodScore) -> float | None:
    """dB over the input on the frames that the method has."""
    noisy = {row.frame: row[HEADLINE.name] for row in scores.methods[INPUT].per_frame}
    gains = [db - base for row in method.per_frame
             if (db := row[HEADLINE.name]) is not None and (base := noisy[row.frame]) is not None]
    return sum(gains) / len(gains) if gains else None


def _best(scores: Scores) -> set[tuple[str, str]]:
    """(method, heading) of the best value of each metric."""
    found = set()
    for metric in METRICS.values():
        values = {name: value for name, method in scores.methods.items()
                  if (value := method[metric.name]) is not None}
        if len(values) > 1:
            pick = max if metric.higher_is_better else min
            found.add((pick(values, key=values.__getitem__), _heading(metric)))
    return found
