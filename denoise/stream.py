"""Runs a denoiser over a sequence, one frame after another, as it would run beside a renderer."""

from __future__ import annotations

import importlib.metadata
import platform
import time
from collections.abc import Callable

import drjit as dr

from render import backend
from render.manifest import Run
from render.sequence import Sequence

from .demodulation import CHANNELS as TEXTURE
from .methods import Method, parameters


def denoise_sequence(sequence: Sequence, method: Method, name: str,
                     on_frame: Callable[[int, float], None] = lambda done, ms: None) -> Run:
    """Denoise every frame that is there, in order, and write results and `run.json`.

    History needs the frames before, so a run always begins at the first frame; an interrupted one
    leaves what it finished. Results of other parameters under the same name are removed first.

    Args:
        name: the name of the results' folder.
        on_frame: told the number of frames done and the milliseconds of the last one.
    Returns:
        The run. Times are of the call alone: the frame is in memory before, the result after.

    Raises:
        InputError: a frame lacks a channel that the method needs, or a file cannot be used.
    """
    ms: dict[int, float] = {}
    run = Run(method=name, parameters=parameters(method), device=backend.choose(),
              threads=dr.thread_count(), versions=_versions())
    _remove_stale(sequence, run)
    frames = [i for i in sequence.frames if sequence.has_frame(i)]
    used = (*method.needs, *(c for c in TEXTURE if c in sequence.manifest.channels))
    state = method.init(*sequence.size)
    try:
        for done, index in enumerate(frames, 1):
            frame = sequence.read_frame(index, used)
            started = time.perf_counter()
            image, state = method(frame, state)
            dr.sync_thread()
            ms[index] = 1e3 * (time.perf_counter() - started)
            sequence.write_result(name, index, image, {"method": name})
            on_frame(done, ms[index])
    finally:
        run = run.model_copy(update={"ms": ms, "first_ms": next(iter(ms.values()), None)})
        sequence.write_run(name, run)
    return run


def _remove_stale(sequence: Sequence, run: Run) -> None:
    """Drop results that this run would otherwise be mixed with."""
    if run.method in sequence.methods():
        old = sequence.read_run(run.method)
        if (old.parameters, old.versions) != (run.parameters, run.versions):
            sequence.remove_results(run.method)


def _versions() -> dict[str, str]:
    return {name: importlib.metadata.version(name) for name in ("onespp", "drjit")} | {
        "python": platform.python_version()}
