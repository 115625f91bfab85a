"""A contact sheet of a plan's first draws, before anything is made of it."""

from __future__ import annotations

import base64
import json
import math
import os

import numpy as np

from onespp.render.host import backend
from onespp.render.progress import Progress, silent
from onespp.show.srgb import bytes_from_linear

from .look import usable
from .plan import Plan, checked_plan
from .processes import CallFailed, calls

_SAMPLES = 48
_MOST_PIXELS = 112 * 112
_GAP = 4


def preview(plan: Plan, count: int, progress: Progress = silent) -> tuple[np.ndarray, list[str]]:
    """The middle frames of sequences 0 to `count` - 1, and a line about each.

    Of small pictures, so that what a look takes may differ from what the data set will have. Most
    of a picture's time is that of compiling its kernel, on one core; so they are made by a process
    a core.

    Returns:
        (h, w, 3) uint8, and the lines, in the order of the pictures, row by row.

    Raises:
        InputError: one of them cannot be drawn.
    """
    shrink = min(1.0, math.sqrt(_MOST_PIXELS / (plan.width * plan.height)))
    height, width = (max(1, round(side * shrink)) for side in (plan.height, plan.width))
    small = plan.model_copy(update={"height": height, "width": width})
    columns = math.ceil(math.sqrt(count * height / width * 1.3))
    rows = math.ceil(count / columns)
    sheet = np.full((rows * (height + _GAP) + _GAP, columns * (width + _GAP) + _GAP, 3), 24,
                    np.uint8)
    lines, what = [""] * count, f"preview {plan.name}"
    processes = min(count, os.cpu_count() or 1) if backend.choose() == "llvm" else 1
    text = small.model_dump_json(exclude_none=True)
    drawn = calls(f"{__name__}:picture", [(text, n, processes) for n in range(count)], processes,
                  lambda: progress(sum(map(bool, lines)), count, what))
    for number, found in drawn:
        if isinstance(found, CallFailed):
            raise found
        row, column = divmod(number, columns)
        y, x = _GAP + row * (height + _GAP), _GAP + column * (width + _GAP)
        pixels = np.frombuffer(base64.b64decode(found["pixels"]), np.uint8)
        sheet[y:y + height, x:x + width] = pixels.reshape(height, width, 3)
        lines[number] = f"{number:4}  {plan.split_of(number):10} {found['about']}"
    progress(count, count, what)
    return sheet, lines


def picture(plan: str, number: int, processes: int) -> dict[str, str]:
    """The middle frame of a sequence, by the kernel that the look has compiled; in a process that
    has its share of the cores."""
    backend.set_threads(max(1, (os.cpu_count() or 1) // processes))
    found = usable(checked_plan(json.loads(plan), "the plan"), number)
    job = found.job
    radiance = job.renderer.sample_sum(len(job.frames) // 2, job.seed, 1, _SAMPLES,
                                       job.antialias) / _SAMPLES
    redrawn = f", draw {len(found.rejected) + 1}" if found.rejected else ""
    return {"about": f"{found.drawn.scene.about}{redrawn}",
            "pixels": base64.b64encode(bytes_from_linear(radiance).tobytes()).decode()}
