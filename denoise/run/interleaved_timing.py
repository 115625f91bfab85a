"""Times of several methods measured in turns, so that their ratios hold on a noisy machine.

All methods get the same frames, from memory. In each step every method denoises one frame, and
the order turns from step to step; the steps of the first round, in which kernels compile, are
told apart. Ratios are of times of the same step, to the first method's.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import drjit as dr
import numpy as np

from onespp.denoise.catalog import Method, channels_read, parameters, source_of
from onespp.render.errors import InputError
from onespp.render.files.atomic import write_text
from onespp.render.files.json_file import format_json
from onespp.render.files.sequence import FrameSequence
from onespp.render.files.times import MethodTime, Times
from onespp.render.host import backend
from onespp.render.host.machine import machine
from onespp.render.host.timed import timed
from onespp.render.progress import Progress, silent


def time_methods(sequence: FrameSequence, methods: Mapping[str, Method], frames: int = 4,
                 rounds: int = 5, progress: Progress = silent, command: str = "") -> Times:
    """Measure methods in turns, and write times.json into the sequence's folder.

    Args:
        frames: how many are denoised, from the first one on, again in every round.
        rounds: how many count; one more goes before them.
        progress: called after each step, in which every method denoises a frame.
        command: the command line, for times.json.

    Raises:
        InputError: no frames or methods, or a frame lacks a channel that a method needs.
    """
    numbers = [i for i in sequence.frames if sequence.has_frame(i)][:frames]
    if not numbers or not methods or rounds < 1:
        raise InputError(f"there is nothing to time in {sequence.folder}: "
                         "it takes frames, methods, and a round")
    needs = {c for method in methods.values()
             for c in channels_read(method, sequence.channels)}
    loaded = [sequence.read_frame(i, sorted(needs)) for i in numbers]
    names = list(methods)
    states = {name: method.init(*sequence.size) for name, method in methods.items()}
    ms: dict[str, list[float]] = {name: [] for name in names}
    steps = (rounds + 1) * len(loaded)
    for step in range(steps):
        frame, first = loaded[step % len(loaded)], step % len(names)
        for name in names[first:] + names[:first]:
            (_, states[name]), spent = timed(partial(methods[name], frame, states[name]))
            ms[name].append(spent)
        progress(step + 1, steps, "time")
    height, width = sequence.size
    times = Times(size=(width, height), frames=len(loaded), steps=rounds * len(loaded),
                  device=backend.choose(), threads=dr.thread_count(),
                  machine=machine(backend.choose()), command=command, ratio_to=names[0],
                  methods=_summary(methods, ms, len(loaded)))
    write_text(sequence.folder / "times.json", format_json(times))
    return times


def _summary(methods: Mapping[str, Method], ms: dict[str, list[float]],
             warm_up: int) -> dict[str, MethodTime]:
    base = np.array(next(iter(ms.values()))[warm_up:])
    found = {}
    for name, values in ms.items():
        warm = np.array(values[warm_up:])
        low, middle, high = np.quantile(warm, (0.25, 0.5, 0.75)).tolist()
        ratio_low, ratio, ratio_high = np.quantile(warm / base, (0.25, 0.5, 0.75)).tolist()
        found[name] = MethodTime(
            parameters=parameters(methods[name]), source=source_of(methods[name]),
            first_ms=values[0], ms=middle, ms_quartiles=(low, high), ratio=ratio,
            ratio_quartiles=(ratio_low, ratio_high))
    return found
