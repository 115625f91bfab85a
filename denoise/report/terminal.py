"""Scores as a table on the terminal: speed against error."""

from __future__ import annotations

import sys

from rich.console import Console
from rich.table import Table

from onespp.denoise.metrics.metric import Metric
from onespp.denoise.metrics.table import HEADLINE
from onespp.denoise.score.causes import CAUSES, HISTORIES
from onespp.denoise.score.scorecard import INPUT, ClassScore, MethodScore, Scores

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
    best = _best(scores)
    for name in scores.ordered():
        grid.add_row(scores.label(name), *(
            f"[bold]{text}[/bold]" if (name, heading) in best else text
            for heading, text in cells(scores, name).items()))
    return grid


def cells(scores: Scores, name: str) -> dict[str, str]:
    """Column heading -> text, for one method."""
    method = scores.methods[name]
    # (Only the headline's error is shown: the others' are in the files, and tables stay narrow.)
    row = {_heading(m): m.text(method[m.name],
                               method.errors.get(m.name) if m is HEADLINE else None,
                               m.name in method.bounds) for m in _columns(scores)}
    gain = None if name == INPUT else _gain(scores, method)
    row[f"gain ({HEADLINE.unit})"] = _number(gain, "+.2f")
    row["ms/frame"] = _number(method.ms_per_frame, ".1f")
    if any(len(m.per_frame) < len(scores.frames) for m in scores.methods.values()):
        row["frames"] = f"{len(method.per_frame)}/{len(scores.frames)}"
    return row


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


def caption(scores: Scores) -> str:
    """What the numbers stand on; nothing in it depends on the machine."""
    width, height = scores.size
    parts = [f"{len(scores.frames)} frames of {width}x{height}"]
    if scores.has_reference:
        parts.append(f"{HEADLINE.label} on {scores.tone_map}, mean over frames")
        parts.append(f"reference {scores.reference_spp or 'of unknown'} spp")
        if scores.reference_halves:
            parts[-1] += f" in two halves, {HEADLINE.label} free of its noise but for ±"
            if scores.flip_floor is not None:
                parts.append(f"a perfect image would have FLIP {scores.flip_floor:.4f}")
        elif scores.headline_floor is not None:
            parts[-1] += (f", whose own noise caps {HEADLINE.label} at "
                          f"{scores.headline_floor:.1f} {HEADLINE.unit}")
    return "; ".join([*parts, "time: median after the first frame, without files"]) + "."


def _columns(scores: Scores) -> list[Metric]:
    return [row for row in scores.measures.values() if row.in_table]


def _heading(metric: Metric) -> str:
    return f"{metric.label} ({metric.unit})" if metric.unit else metric.label


def _headings(scores: Scores) -> list[str]:
    return list(cells(scores, next(iter(scores.methods))))


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else f"{value:{form}}"


def _class(score: ClassScore) -> str:
    error = "" if score.error is None else f" ±{score.error:.1f}"
    return _number(score.psnr_srgb, ".1f") + error


def _gain(scores: Scores, method: MethodScore) -> float | None:
    """dB over the input on the frames that the method has and that count in both means."""
    unfiltered = scores.methods[INPUT]
    if any(row[HEADLINE.name] is None and row.errors for row in method.per_frame):
        return _difference(scores, method)
    noisy = {row.frame: row[HEADLINE.name] for row in unfiltered.per_frame}
    gains = {row.frame: db - base for row in method.per_frame
             if (db := row[HEADLINE.name]) is not None and (base := noisy[row.frame]) is not None}
    left_out = {*unfiltered.identical_frames, *method.identical_frames}
    counted = [gain for i, gain in gains.items() if i not in left_out] or list(gains.values())
    return sum(counted) / len(counted) if counted else None


def _difference(scores: Scores, method: MethodScore) -> float | None:
    """Of the sequence's numbers, where single frames have none."""
    value, base = method[HEADLINE.name], scores.methods[INPUT][HEADLINE.name]
    return None if value is None or base is None else value - base


def _best(scores: Scores) -> set[tuple[str, str]]:
    """(method, heading) of the best value of each metric."""
    found = set()
    for metric in _columns(scores):
        values = {name: value for name, method in scores.methods.items()
                  if (value := method[metric.name]) is not None}
        if len(values) > 1:
            pick = max if metric.higher_is_better else min
            found.add((pick(values, key=values.__getitem__), _heading(metric)))
    return found
