"""The picture of a training's loss over its steps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from onespp.render.files.atomic import replacing

from .checkpoint import Checkpoint

_OVER = 50  # steps of the running mean
_LIGHT, _DARK, _OTHER = "#c6ccd6", "#22252b", "#c2410c"


def draw_curve(stand: Checkpoint, title: str, path: Path) -> None:
    """Write a PNG: loss of each step, their running mean, and the loss on other scenes."""
    figure = Figure(figsize=(7.5, 4.2), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    losses = np.array(stand.losses)
    steps = np.arange(1, len(losses) + 1)
    axes.plot(steps, losses, color=_LIGHT, lw=0.6, label="of a step")
    over = min(_OVER, len(losses))
    mean = np.convolve(losses, np.ones(over) / over, "valid")
    axes.plot(steps[over - 1:], mean, color=_DARK, lw=1.4, label=f"mean of {over} steps")
    if stand.validation:
        axes.plot(*zip(*sorted(stand.validation.items())), "o-", color=_OTHER, ms=3, lw=1,
                  label="on scenes not trained on")
    axes.set(title=title, xlabel="step", ylabel="loss", yscale="log")
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")
