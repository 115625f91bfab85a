"""A contact sheet of a plan's first draws, before anything is made of it."""

from __future__ import annotations

import math

import numpy as np

from onespp.render.progress import Progress, silent
from onespp.show.srgb import bytes_from_linear

from .look import Usable, usable
from .plan import Plan

_SAMPLES = 128
_MOST_PIXELS = 160 * 120
_GAP = 4


def preview(plan: Plan, count: int, progress: Progress = silent) -> tuple[np.ndarray, list[str]]:
    """The middle frames of sequences 0 to `count` - 1, and a line about each.

    Of small pictures, so that what a look takes may differ from what the data set will have.

    Returns:
        (h, w, 3) uint8, and the lines, in the order of the pictures, row by row.
    """
    shrink = min(1.0, math.sqrt(_MOST_PIXELS / (plan.width * plan.height)))
    height, width = (max(1, round(side * shrink)) for side in (plan.height, plan.width))
    small = plan.model_copy(update={"height": height, "width": width})
    columns = math.ceil(math.sqrt(count * height / width * 1.3))
    rows = math.ceil(count / columns)
    sheet = np.full((rows * (height + _GAP) + _GAP, columns * (width + _GAP) + _GAP, 3), 24,
                    np.uint8)
    lines = []
    for number in range(count):
        found = usable(small, number)
        row, column = divmod(number, columns)
        y, x = _GAP + row * (height + _GAP), _GAP + column * (width + _GAP)
        sheet[y:y + height, x:x + width] = bytes_from_linear(_picture(found))
        redrawn = f", draw {len(found.rejected) + 1}" if found.rejected else ""
        lines.append(f"{number:4}  {plan.split_of(number):10} {found.drawn.scene.about}{redrawn}")
        progress(number + 1, count, f"preview {plan.name}")
    return sheet, lines


def _picture(found: Usable) -> np.ndarray:
    """(h, w, 3) radiance of the middle frame, by the kernel that the look has compiled."""
    job = found.job
    return job.renderer.sample_sum(len(job.frames) // 2, job.seed, 1, _SAMPLES,
                                   job.antialias) / _SAMPLES
