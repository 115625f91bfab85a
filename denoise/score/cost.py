"""What a method costs: time a frame, the time it takes to start, throughput, memory."""

from __future__ import annotations

from statistics import median
from typing import Any

from onespp.denoise.methods.parameters import present_parameters
from onespp.render.files.manifest import Run
from onespp.render.files.sequence import FrameSequence
from onespp.render.files.times import Times

STARTING = 3  # frames in which kernels compile: a history's are first needed in the second


def cost(sequence: FrameSequence, run: Run | None, times: Times | None) -> dict[str, Any]:
    """Fields of `MethodScore` from a run; the warm median is `times`' where it has the method.

    `times` count if they are of the same parameters, file, size and device.
    """
    name, changed = (run.method, run.changed) if run else ("", {})
    run = run or Run(method="input")
    ms = [run.ms[i] for i in sorted(run.ms)]
    height, width = sequence.size
    measured = times.methods.get(run.method) if times else None
    interleaved = (times is not None and measured is not None
                   and present_parameters(measured.parameters)
                   == present_parameters(run.parameters) and measured.source == run.source
                   and (times.size, times.device) == ((width, height), run.device))
    warm = measured.ms if measured and interleaved else median(ms[1:]) if ms[1:] else None
    return {"method": name, "changed": changed, "ms_per_frame": warm,
            "first_ms": run.first_ms, "interleaved": interleaved,
            "startup_ms": startup(ms), "peak_mb": run.peak_mb,
            "megapixels_per_s": width * height / warm / 1e3 if warm else None,
            "device": run.device, "machine": run.machine, "threads": run.threads,
            "parameters": present_parameters(run.parameters), "versions": run.versions}


def startup(ms: list[float]) -> float | None:
    """Time of the first frames beyond the median of the others; None with too few frames."""
    starting = ms[:STARTING if len(ms) > STARTING else 1]
    rest = ms[len(starting):]
    return sum(max(0.0, t - median(rest)) for t in starting) if rest else None
