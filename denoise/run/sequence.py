"""Runs a denoiser over a sequence, one frame after another, as it would run beside a renderer.

While a frame is denoised, another thread reads the next one and writes the last result. They share
the cores, and decoding holds Python's lock, so that a call then takes longer than it does alone.
Hence the first frames are read, denoised and written in turns, and only their times count.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from concurrent.futures import ThreadPoolExecutor as Threads
from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr
import numpy as np

from onespp.denoise.catalog import (
    Method,
    changed,
    channels_read,
    check_not_a_method,
    name_of,
    parameters,
    source_of,
    versions_of,
)
from onespp.denoise.methods.outliers import energy_kept
from onespp.denoise.methods.parameters import present_parameters
from onespp.render.files.manifest import Run, check_result_name
from onespp.render.files.sequence import FrameSequence
from onespp.render.frame import Frame
from onespp.render.host import backend
from onespp.render.host.machine import machine
from onespp.render.host.timed import timed
from onespp.render.progress import Progress, silent

from .peak_memory import PeakMemory

ALONE = 8  # frames that nothing else runs beside


@dataclass(frozen=True)
class Pace:
    """Seconds that the frames after the first `ALONE` took, and what they spent in what.

    Attributes:
        frames: how many. seconds: all of it. denoising: in calls of the method.
        files: reading and writing, beside it.
    """

    frames: int
    seconds: float
    denoising: float
    files: float

    def __str__(self) -> str:
        slower, other = (("files", "denoising") if self.files > self.denoising
                         else ("denoising", "files"))
        ms = {what: 1e3 * getattr(self, what) / self.frames for what in (slower, other)}
        return (f"{1e3 * self.seconds / self.frames:.0f} ms a frame, bound by {slower} "
                f"({ms[slower]:.0f} ms, {other} beside it {ms[other]:.0f} ms)")


class _Files:
    """Frames of a sequence in order, results back into it, and the seconds that both take.

    With `overlap` set, a frame is read and a result written while the caller goes on.
    """

    def __init__(self, sequence: FrameSequence, name: str, used: tuple[str, ...],
                 threads: Threads) -> None:
        self.overlap, self.seconds = False, 0.0
        self._sequence, self._name, self._used = sequence, name, used
        self._threads = threads
        self._writing: Future | None = None

    def read(self, frames: list[int]) -> Iterator[tuple[int, Frame]]:
        reading: Future | None = None
        for index, following in zip(frames, [*frames[1:], None]):
            frame = (reading or self._begin(self._sequence.read_frame, index, self._used)).result()
            reading = None
            if self.overlap and following is not None:
                reading = self._begin(self._sequence.read_frame, following, self._used)
            yield index, frame

    def write(self, index: int, image: np.ndarray) -> None:
        self.finish()
        self._writing = self._begin(self._sequence.write_result, self._name, index, image,
                                    {"method": self._name})
        if not self.overlap:
            self.finish()

    def finish(self) -> None:
        """Wait for what is being written."""
        if self._writing:
            self._writing.result()

    def _begin(self, function: Callable[..., Any], *arguments: Any) -> Future:
        def timed_call() -> Any:
            started = time.perf_counter()
            try:
                return function(*arguments)
            finally:
                self.seconds += time.perf_counter() - started

        return self._threads.submit(timed_call)


def denoise_sequence(sequence: FrameSequence, method: Method, name: str,
                     progress: Progress = silent,
                     on_pace: Callable[[Pace], None] = lambda pace: None,
                     command: str = "") -> Run:
    """Denoise every frame that is there, in order, and write results and `run.json`.

    History needs the frames before, so a run always begins at the first frame; an interrupted one
    leaves what it finished. Results of other parameters under the same name are removed first.

    Args:
        name: the name of the results' folder.
        progress: called after each frame, with the milliseconds that it took as the note.
        on_pace: told at the end how fast frames came where reading and writing overlapped.
        command: the command line, for run.json.
    Returns:
        The run. Times are of calls with nothing beside them, so of the first `ALONE` frames: the
        frame is in memory before, the result after.

    Raises:
        InputError: a frame lacks a channel that the method needs, or a file cannot be used.
    """
    ms: dict[int, float] = {}
    dr.flush_malloc_cache()  # so that this method's memory is seen, and not the last one's
    peak = PeakMemory()
    ran = name_of(method) or name  # a method of one's own is called what its results are
    check_result_name(name, sequence.methods())
    check_not_a_method(name, name_of(method))
    run = Run(method=ran, parameters=parameters(method), changed=changed(method),
              device=backend.choose(), threads=dr.thread_count(), versions=versions_of(method),
              machine=machine(backend.choose()), source=source_of(method), command=command)
    _remove_stale(sequence, name, run)
    frames = [i for i in sequence.frames if sequence.has_frame(i)]
    used = channels_read(method, sequence.channels)
    state = method.init(*sequence.size)
    try:
        with Threads(1) as threads:
            files, started, denoising = _Files(sequence, name, used, threads), 0.0, 0.0
            for done, (index, frame) in enumerate(files.read(frames), 1):
                if not files.overlap:
                    peak.begin()
                (image, state), took = timed(partial(method, frame, state))
                if files.overlap:
                    denoising += 1e-3 * took
                else:
                    peak.end()
                    ms[index] = took
                files.write(index, image)
                if done == ALONE:
                    files.overlap, files.seconds, started = True, 0.0, time.perf_counter()
                progress(done, len(frames), f"denoise {name}", f"({took:.0f} ms)")
            files.finish()
            if len(frames) > ALONE:
                on_pace(Pace(len(frames) - ALONE, time.perf_counter() - started, denoising,
                             files.seconds))
    finally:
        run = run.model_copy(update={"ms": ms, "first_ms": next(iter(ms.values()), None),
                                    "peak_mb": peak.megabytes, "energy_kept": energy_kept(state)})
        sequence.write_run(name, run)
    return run


def _remove_stale(sequence: FrameSequence, name: str, run: Run) -> None:
    """Drop results that this run would otherwise be mixed with: others', and a killed run's."""
    if name in sequence.methods():
        old = sequence.read_run(name)
        if ((old.method, present_parameters(old.parameters), old.versions, old.source)
                == (run.method, run.parameters, run.versions, run.source)):
            return
    sequence.remove_results(name)
