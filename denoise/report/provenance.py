"""How the numbers of a report came to be: command lines, settings, versions, machines.

Command lines are those that were typed: each command keeps its own with what it makes, in
manifest.json, run.json, times.json and scores.json. None is worked out afterwards.
"""

from __future__ import annotations

from typing import Any

from onespp.denoise.methods.parameters import present_parameters
from onespp.denoise.score.commands import commands
from onespp.denoise.score.scorecard import INPUT, Scores, caption
from onespp.render.files.manifest import Run
from onespp.render.files.sequence import FrameSequence
from onespp.render.files.times import Times, read_times

from .page_data import text_of


def provenance(sequence: FrameSequence, scores: Scores, command: str = "") -> dict[str, Any]:
    """How the numbers came to be: commands, settings, versions, machines, each method's run.

    `command` is the line that makes the report.
    """
    manifest = sequence.manifest
    runs = {name: sequence.read_run(name) for name in scores.ordered() if name != INPUT}
    settings = manifest.model_dump(exclude={
        "versions", "channels", "objects", "format", "about", "machine", "commands"})
    facts = {"caption": caption(scores), **{k: text_of(v) for k, v in settings.items() if v != ""},
             "channels": ", ".join(manifest.channels), "objects": ", ".join(manifest.objects)}
    lines = [*(scores.commands or commands(sequence, runs)), command]
    return {
        "commands": [line for line in dict.fromkeys(lines) if line],
        "unrecorded": _unrecorded(sequence, scores, runs),
        "facts": [(key.replace("_", " "), value) for key, value in facts.items()],
        "versions": list(scores.versions.items()),
        "machines": _machines(sequence, runs, read_times(sequence.folder)),
        "methods": [{"name": name, "device": run.device, "threads": run.threads,
                     "parameters": [*([("method", run.method)] if run.method != name else []),
                                    *((k, str(v)) for k, v in
                                      present_parameters(run.parameters).items())],
                     "versions": list(run.versions.items()),
                     "machine": run.machine} for name, run in runs.items()],
    }


def _unrecorded(sequence: FrameSequence, scores: Scores, runs: dict[str, Run]) -> str:
    """What has no command line: made by an older version, or by a program of one's own."""
    lacking = [] if sequence.manifest.commands else ["the sequence"]
    lacking += [name for name, run in runs.items() if not run.command]
    lacking += [] if scores.commands else ["the scores"]
    return ", ".join(lacking)


def _machines(sequence: FrameSequence, runs: dict[str, Run],
              times: Times | None) -> list[tuple[str, str]]:
    """What was done where, where that is known."""
    def with_threads(machine: str, device: str, threads: int | None) -> str:
        return f"{machine}; {device}" + (f", {threads} thread{'s' * (threads > 1)}"
                                         if threads else "")

    manifest = sequence.manifest
    rows = [("frames", f"{manifest.machine}; {manifest.device}")] if manifest.machine else []
    where: dict[str, list[str]] = {}
    for name, run in runs.items():
        if run.machine:
            where.setdefault(with_threads(run.machine, run.device, run.threads), []).append(name)
    rows += [("results" if len(where) == 1 else f"results of {', '.join(names)}", text)
             for text, names in where.items()]
    if times:
        rows.append(("times in turns", f"medians of {times.steps} steps; "
                     + with_threads(times.machine, times.device, times.threads)))
    return rows
