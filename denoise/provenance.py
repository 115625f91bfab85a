"""How the numbers of a report came to be: command lines, settings, versions, machine."""

from __future__ import annotations

import shlex
from typing import Any

from render.manifest import Run, format_frames
from render.sequence import Sequence

from .scorecard import INPUT, Scores
from .summary import text_of
from .table import caption


def provenance(sequence: Sequence, scores: Scores) -> dict[str, Any]:
    """How the numbers came to be: commands, settings, versions, and each method's run."""
    manifest = sequence.manifest
    runs = {name: sequence.read_run(name) for name in scores.ordered() if name != INPUT}
    settings = manifest.model_dump(exclude={"versions", "channels", "objects", "format", "about"})
    facts = {"caption": caption(scores), **{k: text_of(v) for k, v in settings.items() if v != ""},
             "channels": ", ".join(manifest.channels), "objects": ", ".join(manifest.objects)}
    times = _times(sequence)
    machine = [("times", f"medians of {times.steps} steps in turns"), ("machine", times.machine),
               ("device", times.device), ("threads", str(times.threads))] if times else []
    return {
        "commands": commands(sequence, runs),
        "facts": [(key.replace("_", " "), value) for key, value in facts.items()],
        "versions": [*scores.versions.items(), *machine],
        "methods": [{"name": name, "device": run.device, "threads": run.threads,
                     "parameters": [(k, str(v)) for k, v in run.parameters.items()],
                     "versions": list(run.versions.items())} for name, run in runs.items()],
    }


def commands(sequence: Sequence, runs: dict[str, Run]) -> list[str]:
    """Command lines that make the sequence, its results and this report again."""
    manifest, folder = sequence.manifest, str(sequence.folder)
    if manifest.source == "render":
        first = ["render", manifest.scene, "--frames", format_frames(manifest.frames), "--size",
                 f"{manifest.width}x{manifest.height}", "--seed", str(manifest.seed or 0)]
        if manifest.reference_spp:
            first += ["--reference-spp", str(manifest.reference_spp)]
            first += ["--antialias"] if manifest.reference_filter == "box" else []
        first += ["--direct", manifest.direct] if manifest.direct != "mis" else []
        first += ["--sampler", manifest.sampler] if manifest.sampler != "pcg" else []
    else:
        first = ["import", manifest.scene, "--format", manifest.source]
    lines = [[*first, "--out", folder]]
    lines += [["denoise", folder, *_denoise_options(name, run)] for name, run in runs.items()]
    if times := _times(sequence):
        named = [part for name in times.methods for part in ("--method", name)]
        lines.append(["time", folder, *named, "--frames", str(times.frames), "--rounds",
                      str(max(1, times.steps // times.frames))])
    lines += [["score", folder], ["report", folder]]
    return [shlex.join(["onespp", *line]) for line in lines]


def _times(sequence: Sequence):
    from .interleave import read_times  # imports Dr.Jit

    return read_times(sequence.folder)


def _denoise_options(name: str, run: Run) -> list[str]:
    if "external" in run.parameters:
        return ["--external", str(run.parameters["external"]), "--name", name]
    method = method_of(name, run)
    values = [part for k, v in run.parameters.items() for part in ("--set", f"{k}={v}")]
    return ["--method", method, *([] if method == name else ["--name", name]), *values]


def method_of(name: str, run: Run) -> str:
    """Which method a run under a name of its own was: one that takes its parameters.

    Of several, the longest that the name begins with, else the shortest.
    """
    from .methods import METHODS, build, parameters  # imports Dr.Jit
    from .peers import PEERS

    if name in METHODS or name in PEERS:
        return name
    fitting = [m for m in METHODS if parameters(build(m)).keys() == run.parameters.keys()]
    begun = [m for m in fitting if name.startswith(m)]
    return max(begun, key=len) if begun else min(fitting, key=len, default=name)
