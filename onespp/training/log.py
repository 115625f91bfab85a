"""What a training writes beside its weights: its losses; and those of several, side by side.

Losses on other scenes compare where the clips are the same: those of one data set, batch and crop,
whatever the seed.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from onespp.render.errors import InputError
from onespp.render.files.json_file import JsonFile, read_json


class Data(JsonFile):
    """A data set: name and seed of its plan, and the sequences that are trained on."""

    name: str
    seed: int
    digest: str
    sequences: int


class Log(JsonFile):
    """Of a training after so many steps.

    Attributes:
        loss: of each step. validation: step -> loss on other scenes. seconds: that steps took.
    """

    network: str = "rae"  # (before there were others, none was named)
    width: str
    seed: int
    batch: int
    crop: int
    result: str = ""
    steps: int
    data: Data
    versions: dict[str, str]
    seconds: float
    loss: list[float]
    validation: dict[str, float]

    @property
    def name(self) -> str:
        return f"{self.network}-{self.width}" + (f" on {self.result}" if self.result else "")


@dataclass(frozen=True)
class Spread:
    """Losses of a network's seeds on other scenes, at the last step that all of them have.

    Attributes:
        seeds: how many. mean, deviation: of their losses; the deviation over seeds, with n - 1.
    """

    seeds: int
    step: int
    mean: float
    deviation: float


def read_logs(paths: Sequence[Path]) -> list[Log]:
    """InputError where one is missing or something else, or where losses do not compare."""
    logs = [read_json(path, Log) for path in paths]
    for path, log in zip(paths, logs):
        if not log.loss or not log.validation:
            raise InputError(f"{path} has no losses on other scenes: train on a data set that has "
                             "a validation split")
        for key in ("data", "batch", "crop"):
            if getattr(log, key) != getattr(logs[0], key):
                raise InputError(f"{paths[0]} and {path} are of trainings with another {key}: "
                                 "compare losses on the same clips")
    return logs


def spreads(logs: Sequence[Log]) -> dict[str, Spread]:
    """Of each network of which there are several seeds with a step in common."""
    found = {}
    for name in dict.fromkeys(log.name for log in logs):
        alike = list({log.seed: log for log in logs if log.name == name}.values())
        steps = set.intersection(*({*map(int, log.validation)} for log in alike))
        if len(alike) > 1 and steps:
            losses = [log.validation[str(max(steps))] for log in alike]
            found[name] = Spread(len(alike), max(steps), statistics.mean(losses),
                                 statistics.stdev(losses))
    return found


def table(logs: Sequence[Log]) -> str:
    """A line a training: mean loss of its last 50 steps and its last one on other scenes; then a
    line a network with several seeds."""
    lines = [f"{'network':15} {'seed':>4} {'steps':>6} {'loss':>8} {'on others':>9} {'at step':>7}"]
    for log in logs:
        last = max(map(int, log.validation))
        lines.append(f"{log.name:15} {log.seed:4} {log.steps:6} "
                     f"{statistics.mean(log.loss[-50:]):8.4f} {log.validation[str(last)]:9.4f} "
                     f"{last:7}")
    return "\n".join([*lines, *(
        f"{name}: {s.mean:.4f} +- {s.deviation:.4f} on others at step {s.step}, {s.seeds} seeds"
        for name, s in spreads(logs).items())])
