"""Pictures of losses over the steps of trainings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from onespp.render.files.atomic import replacing

from .checkpoint import Checkpoint
from .log import Log

_OVER = 50  # steps of the running mean
_LIGHT, _DARK, _OTHER = "#c6ccd6", "#22252b", "#c2410c"


def draw_curve(stand: Checkpoint, title: str, path: Path) -> None:
    """Write a PNG: loss of each step, their running mean, and the loss on other scenes."""
    with _axes(title, path) as axes:
        axes.plot(np.arange(1, len(stand.losses) + 1), stand.losses, color=_LIGHT, lw=0.6,
                  label="of a step")
        axes.plot(*_running_mean(stand.losses), color=_DARK, lw=1.4, label=f"mean of {_OVER} steps")
        if stand.validation:
            axes.plot(*zip(*sorted(stand.validation.items())), "o-", color=_OTHER, ms=3, lw=1,
                      label="on scenes not trained on")


def draw_curves(logs: Sequence[Log], path: Path) -> None:
    """Write a PNG of several trainings: running means of their losses, thin, and the losses on
    other scenes."""
    with _axes("on scenes not trained on, and on those trained on (thin)", path) as axes:
        for k, log in enumerate(logs):
            axes.plot(*_running_mean(log.loss), color=f"C{k}", lw=0.6)
            axes.plot(*zip(*sorted((int(step), x) for step, x in log.validation.items())), "o-",
                      color=f"C{k}", ms=3, lw=1, label=f"{log.name}, seed {log.seed}")


@contextmanager
def _axes(title: str, path: Path) -> Iterator[Axes]:
    """Yields what to draw into; the file is written after that."""
    figure = Figure(figsize=(7.5, 4.2), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    yield axes
    axes.set(title=title, xlabel="step", ylabel="loss", yscale="log")
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")


def _running_mean(losses: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Steps, and the mean of the `_OVER` losses up to each."""
    over = min(_OVER, len(losses))
    return np.arange(over, len(losses) + 1), np.convolve(losses, np.ones(over) / over, "valid")
