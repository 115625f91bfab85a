"""What got better or worse between two scores of a sequence, against the noise of measuring it.

Frame by frame: d_t = B_t - A_t over the frames that both have, so that what frames have in common
cancels. The change is the mean of d_t, its standard error

    s / sqrt(n_e),   s the standard deviation of d_t,   n_e = n (1 - r) / (1 + r),

where r is the correlation of d_t with d_{t-1}, between 0 and 0.9: neighbouring frames show the
same and are no independent measurements (an AR(1) model of them, a heuristic). A change counts
where it is more than two standard errors from 0. Time is compared as the logarithm of B_t / A_t,
without the first frame, in which kernels compile; its error does not know how much the machine's
speed changes from run to run.

Where A and B have the same reference its noise cancels in d_t almost wholly; what is left, and all
of it where references differ, is in the scatter of d_t. Of one frame alone there is no scatter:
then the error is that of both values by their references' noise, which is too large where these are
the same.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Literal

import numpy as np
from pydantic import Field, FiniteFloat

from onespp.denoise.methods.parameters import present_parameters
from onespp.denoise.metrics.means import identical
from onespp.denoise.metrics.metric import Metric
from onespp.denoise.metrics.table import MEASURES
from onespp.denoise.own_method import result_name
from onespp.render.errors import InputError
from onespp.render.files.json_file import JsonFile, format_json

from .method_score import MethodScore
from .scorecard import OwnMetric, Scores

TIME = Metric("ms", "time", lambda a, b: None, "", "ms", False, ".1f", "milliseconds a frame")
SIGMAS = 2.0
DB, SHARE = 0.1, 0.02
"""What may get worse unless told otherwise: dB, and the share of a measure in another unit."""

_MOST_CORRELATED = 0.9


class Threshold(JsonFile):
    """How much worse is too much: a number in the measure's unit, or a share of A's value."""

    limit: FiniteFloat
    relative: bool


class Change(JsonFile):
    """One measure of one method.

    Attributes:
        a, b: means over the frames that both have; of time, geometric ones.
        change: of the measure, in its unit; of time, B / A - 1.
        error: its standard error; None where one frame alone was measured, without halves.
        frames: how many both have.
        verdict: better or worse where the change is beyond its noise, else same.
        failed: worse, and by more than the threshold.
    """

    method: str
    measure: str
    a: FiniteFloat
    b: FiniteFloat
    change: FiniteFloat
    error: FiniteFloat | None
    frames: int
    verdict: Literal["better", "worse", "same"]
    failed: bool


class Comparison(JsonFile):
    """What `onespp compare` found; notes are sentences that a reader must know.

    `own_metrics` are those of `Scores` that both have.
    """

    scene: str
    changes: list[Change]
    notes: list[str]
    own_metrics: dict[str, OwnMetric] = Field(default_factory=dict)

    @property
    def measures(self) -> dict[str, Metric]:
        """What changes may be of."""
        return {**MEASURES, **{name: m.metric(name) for name, m in self.own_metrics.items()},
                TIME.name: TIME}

    @property
    def failed(self) -> bool:
        return any(change.failed for change in self.changes)

    def json_text(self) -> str:
        return format_json(self)


def parse_thresholds(texts: tuple[str, ...], own: Iterable[str] = ()) -> dict[str, Threshold]:
    """Thresholds of texts such as psnr_srgb=0.2 and ms=20%; InputError where one is not.

    Args:
        own: names of measures beside those of the table.
    """
    found, known = {}, (*MEASURES, *own, TIME.name)
    for text in texts:
        name, _, limit = text.partition("=")
        match = re.fullmatch(r"([0-9]+\.?[0-9]*|\.[0-9]+)(%?)", limit.strip())
        if not match:
            raise InputError(f"--threshold {text[:60]} is not understood: use NAME=LIMIT, as in "
                             "psnr_srgb=0.2 or ms=20%")
        if name.strip() not in known:
            raise InputError(f"--threshold {text[:60]} names no measure: they are "
                             f"{', '.join(known)}")
        relative = match[2] == "%"
        if name.strip() == TIME.name and not relative:
            raise InputError(f"--threshold {text[:60]} is not a share: write it as ms=20%")
        found[name.strip()] = Threshold(limit=float(match[1]) / (100 if relative else 1),
                                        relative=relative)
    return found


def comparison(a: Scores, b: Scores, methods: list[str] | None = None,
               thresholds: Mapping[str, Threshold] | None = None) -> Comparison:
    """Every measure of every method that both scores have; B is the later one.

    Raises:
        InputError: scores of different sequences, nothing in common, or an unknown method.
    """
    for key in ("scene", "size", "tone_map"):
        if (old := getattr(a, key)) != (new := getattr(b, key)):
            raise InputError(f"the scores are not of one sequence: {key.replace('_', ' ')} is "
                             f"{old} in A and {new} in B")
    both = [name for name in a.ordered() if name in b.methods]
    methods = None if methods is None else [result_name(name) for name in methods]
    for name in methods or ():
        if name not in both:
            raise InputError(f"the method '{name}' is not in both scores, which share "
                             f"{', '.join(both) or 'none'}")
    chosen = [name for name in both if methods is None or name in methods]
    own = {name: b.own_metrics[name] for name, old in a.own_metrics.items()
           if name in b.own_metrics
           and old.higher_is_better == b.own_metrics[name].higher_is_better}
    found = Comparison(scene=a.scene, changes=[], notes=list(_notes(a, b)), own_metrics=own)
    changes = [change for name in chosen for row in found.measures.values()
               if (change := _change(name, row, a.methods[name], b.methods[name],
                                     thresholds or {}))]
    if not changes:
        raise InputError("the scores have no frame of a method in common: there is nothing to "
                         "compare")
    return found.model_copy(update={"changes": changes})


def _change(name: str, row: Metric, a: MethodScore, b: MethodScore,
            thresholds: Mapping[str, Threshold]) -> Change | None:
    old, new = _common(row, a, b)
    if not old.size:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        difference = np.log(new / old) if row is TIME else new - old
    if not np.isfinite(difference).all():
        return None
    mean, error = float(difference.mean()), standard_error(difference)
    if error is None:
        error = _of_one_frame(row, a, b)
    mean_a, mean_b = ((math.exp(np.log(x).mean()) if row is TIME else float(x.mean()))
                      for x in (old, new))
    beyond = mean != 0 and error is not None and abs(mean) > SIGMAS * error
    worse = (mean < 0) == row.higher_is_better
    verdict = "same" if not beyond else "worse" if worse else "better"
    change = math.expm1(mean) if row is TIME else mean
    threshold = thresholds.get(row.name) or _standard(row)
    limit = math.inf if threshold is None else threshold.limit * (
        abs(mean_a) if threshold.relative and row is not TIME else 1)
    return Change(method=name, measure=row.name, a=mean_a, b=mean_b, change=change, error=error,
                  frames=old.size, verdict=verdict,
                  failed=verdict == "worse" and abs(change) > limit)


def _common(row: Metric, a: MethodScore, b: MethodScore) -> tuple[np.ndarray, np.ndarray]:
    """The measure on the frames that both have it for, in order.

    Without those where one is identical to its reference (`means.py`), if there are others: the
    infinite PSNR of an image that got a little better or worse would decide alone.
    """
    def values(method: MethodScore) -> dict[int, float]:
        rows = method.per_frame[1:] if row is TIME else method.per_frame
        return {r.frame: v for r in rows
                if (v := r.ms if row is TIME else r[row.name]) is not None}

    old, new = values(a), values(b)
    frames = sorted(old.keys() & new.keys())
    infinite = {*identical(row, old), *identical(row, new)}
    frames = [i for i in frames if i not in infinite] or frames
    return np.array([old[i] for i in frames]), np.array([new[i] for i in frames])


def _of_one_frame(row: Metric, a: MethodScore, b: MethodScore) -> float | None:
    """Standard error of the difference in the one frame that both have the measure for."""
    errors = [{r.frame: r.errors[row.name] for r in m.per_frame if row.name in r.errors}
              for m in (a, b)]
    common = errors[0].keys() & errors[1].keys()
    return math.hypot(*(e[i] for e in errors for i in common)) if len(common) == 1 else None


def standard_error(values: np.ndarray) -> float | None:
    """Of the mean of (n,) values in order of time; None for fewer than two."""
    n = len(values)
    if n < 2:
        return None
    rest = values - values.mean()
    power = float(rest @ rest)
    if power == 0:
        return 0.0
    r = min(max(float(rest[1:] @ rest[:-1]) / power, 0.0), _MOST_CORRELATED)
    return math.sqrt(power / (n - 1) / (n * (1 - r) / (1 + r)))


def _standard(row: Metric) -> Threshold | None:
    if row is TIME:
        return None
    if row.unit == "dB":
        return Threshold(limit=DB, relative=False)
    return Threshold(limit=SHARE, relative=True)


def _notes(a: Scores, b: Scores) -> Iterator[str]:
    for key, what in (("seed", "seeds"), ("spp", "samples a pixel"),
                      ("reference_spp", "references"),
                      ("reference_halves", "halves of references")):
        if (old := getattr(a, key)) != (new := getattr(b, key)):
            yield f"A and B have different {what}: {old} and {new}."
    if a.frames != b.frames:
        yield (f"A has {len(a.frames)} frames and B {len(b.frames)}; compared are those that "
               "both have.")
    for mine, others, which in ((a, b, "A"), (b, a, "B")):
        alone = [name for name in mine.methods if name not in others.methods]
        if alone:
            yield f"Only {which} has {', '.join(alone)}."
    for name, mine in a.own_metrics.items():
        other = b.own_metrics.get(name)
        if other and (mine.source, mine.higher_is_better) != (other.source,
                                                              other.higher_is_better):
            yield f"The metric {name} is not the same in A and B."
    for name in (n for n in a.ordered() if n in b.methods):
        for mine, which in ((a.methods[name], "A"), (b.methods[name], "B")):
            if n := len(mine.identical_frames):
                yield (f"{name} is identical to the reference on {n} frame{'s' * (n > 1)} of "
                       f"{which}: changes in dB are without.")
        old, new = a.methods[name].method, b.methods[name].method
        if old and new and old != new:
            yield f"{name} is {old} in A and {new} in B."
        mine, others = (present_parameters(s.methods[name].parameters) for s in (a, b))
        if mine != others:
            yield f"{name} has other parameters in B."
