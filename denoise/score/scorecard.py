"""What scores.json and scores.csv hold, and reading it back.

`Scores` is the JSON file as it stands: strict JSON, so a number that was not measured (no
reference, no time) is null, and nothing is ever NaN or infinite. The values of `MEASURES` stand
beside the declared fields, under their names: `scores.methods["input"]["psnr_srgb"]`.
"""

from __future__ import annotations

import csv
import importlib
import io
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, FiniteFloat, field_validator

from onespp.denoise.metrics.metric import Metric
from onespp.denoise.metrics.own_metric import FORMAT, source_of
from onespp.denoise.metrics.table import ESTIMATED, HEADLINE, MEASURES
from onespp.denoise.own_method import result_name
from onespp.render.errors import InputError
from onespp.render.files.json_file import JsonFile, format_json, read_json
from onespp.show.html import table_html

from .method_score import INPUT, FrameScore, MethodScore


class OwnMetric(JsonFile):
    """What a metric of one's own said of itself, as `Metric` does, for who reads its values.

    Attributes:
        source: hash of the file that it was in; "" of an installed one.
    """

    label: str
    unit: str
    higher_is_better: bool
    format: Annotated[str, Field(pattern=f"^{FORMAT}$")]
    about: str
    source: str = ""

    @classmethod
    def of(cls, row: Metric) -> OwnMetric:
        return cls(label=row.label, unit=row.unit, higher_is_better=row.higher_is_better,
                   format=row.format, about=row.about, source=source_of(row))

    def metric(self, name: str) -> Metric:
        """All of it but the function: its values can be read, and no others made."""
        return Metric(name, self.label, lambda a, b: None, "", self.unit, self.higher_is_better,
                      self.format, self.about)


class Scores(JsonFile):
    """scores.json.

    Attributes:
        frames: numbers of the frames scored. size: width, height.
        spp, reference_spp: null where they are not known, as for imports.
        reference_floor_db: PSNR that a perfect image is expected to get against this noisy
            reference, mean over frames; per frame in `reference_floor_per_frame`.
        reference_non_finite_pixels: sum over frames; such pixels were not judged.
        reference_halves: whether what is quadratic is by halves of the references, of all frames.
        flip_floor, ssim_floor: what a perfect image is expected to get against these references.
        paired_errors: method -> other -> standard error of the difference of their headline
            values, on the same frames and halves.
        versions, machine: of what rendered the frames.
        commands: command lines that made the sequence, the results, the times and these scores,
            as they were typed, in that order; those that were not recorded are missing.
        tone_map: what "srgb" means in the names of metrics.
        notes: what a reader must know, one sentence each.
        own_metrics: name -> what is known of each metric that is not of the table.
    """

    scene: str
    frames: list[int]
    size: tuple[int, int]
    seed: int | None
    spp: int | None
    reference_spp: int | None
    reference_floor_db: FiniteFloat | None
    reference_floor_per_frame: dict[int, FiniteFloat]
    reference_non_finite_pixels: int = 0
    reference_halves: bool = False
    flip_floor: FiniteFloat | None = None
    ssim_floor: FiniteFloat | None = None
    paired_errors: dict[str, dict[str, FiniteFloat]] = Field(default_factory=dict)
    tone_map: str
    versions: dict[str, str]
    machine: str = ""
    commands: list[str] = Field(default_factory=list)
    notes: list[str]
    own_metrics: dict[str, OwnMetric] = Field(default_factory=dict)
    methods: dict[str, MethodScore]

    @field_validator("methods")
    @classmethod
    def _has_input(cls, methods: dict[str, MethodScore]) -> dict[str, MethodScore]:
        if INPUT not in methods:
            raise ValueError(f"'{INPUT}', which methods are compared with, is missing")
        return methods

    @property
    def measures(self) -> dict[str, Metric]:
        """Every measure that may have a value: those of the table, and the user's own."""
        return {**MEASURES, **{name: m.metric(name) for name, m in self.own_metrics.items()}}

    @property
    def has_reference(self) -> bool:
        return self.methods[INPUT][HEADLINE.name] is not None

    @property
    def headline_floor(self) -> float | None:
        """dB at which noise of the reference stops the headline; None by halves, which it does
        not stop, and where it is not known."""
        return None if self.reference_halves else self.reference_floor_db

    @property
    def headline_floors(self) -> dict[int, float]:
        """The same by frame; of those where it is known."""
        return {} if self.reference_halves else self.reference_floor_per_frame

    def label(self, name: str) -> str:
        """A method's name for a table, with what ran where that is something else."""
        ran = self.methods[name].method
        return f"{name} ({ran})" if ran and result_name(ran) != name else name

    def ordered(self) -> list[str]:
        """Names of the methods: input, then from fast to slow, then those without a time."""
        def key(name: str) -> tuple[bool, bool, float]:
            ms = self.methods[name].ms_per_frame
            return name != INPUT, ms is None, ms or 0.0

        return sorted(self.methods, key=key)

    def json_text(self) -> str:
        return format_json(self)

    def csv_text(self) -> str:
        """One row for each method and frame."""
        text = io.StringIO()
        writer = csv.DictWriter(text, self._rows()[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(self._rows())
        return text.getvalue()

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame` of what scores.csv holds: a row for each method and frame.

        Raises:
            InputError: pandas is not installed.
        """
        try:
            pandas = importlib.import_module("pandas")  # no dependency of ours
        except ImportError:
            raise InputError("to_pandas() needs pandas, which is not installed: run "
                             "`pip install pandas`, or read scores.csv") from None
        return pandas.DataFrame(self._rows())

    def _rows(self) -> list[dict[str, Any]]:
        measures = list(self.measures)
        return [{"method": name, "frame": row.frame, **{m: row[m] for m in measures}, "ms": row.ms,
                 "reference_floor_db": self.reference_floor_per_frame.get(row.frame),
                 "non_finite_pixels": row.non_finite_pixels,
                 **{f"{m}_error": row.errors.get(m) for m in ESTIMATED}}
                for name, method in self.methods.items() for row in method.per_frame]

    def _repr_html_(self) -> str:
        """The table of the command line, for a notebook."""
        rows = {name: cells(self, name) for name in self.ordered()}
        bold = {(self.label(name), heading) for name, heading in best(self)}
        return table_html(f"{self.scene}: speed against error",
                          {self.label(name): row for name, row in rows.items()}, bold,
                          [caption(self), *self.notes])


def taken_names() -> set[str]:
    """Names that mean something else in files of scores."""
    return {*MEASURES, *FrameScore.model_fields, *MethodScore.model_fields, "method", "frame",
            "reference_floor_db", *(f"{m}_error" for m in ESTIMATED)}


def check_own(metrics: Iterable[Metric]) -> None:
    """InputError where a metric has a name that is taken."""
    for row in metrics:
        if row.name in taken_names():
            raise InputError(f"scores.json has something else called '{row.name}': give the metric "
                             "another name")


def read_scores(path: Path) -> Scores:
    """Scores of a scores.json; InputError where it is missing or is none."""
    return read_json(path, Scores)


def cells(scores: Scores, name: str) -> dict[str, str]:
    """Column heading -> text, for one method."""
    method = scores.methods[name]
    # (Only the headline's error is shown: the others' are in the files, and tables stay narrow.)
    row = {_heading(m): m.text(method[m.name],
                               method.errors.get(m.name) if m is HEADLINE else None,
                               m.name in method.bounds) for m in _columns(scores)}
    gain = None if name == INPUT else _gain(scores, method)
    row[f"gain ({HEADLINE.unit})"] = _number(gain, "+.2f")
    row["ms/frame"] = _number(method.ms_per_frame, ".1f")
    if any(len(m.per_frame) < len(scores.frames) for m in scores.methods.values()):
        row["frames"] = f"{len(method.per_frame)}/{len(scores.frames)}"
    return row


def caption(scores: Scores) -> str:
    """What the numbers stand on; nothing in it depends on the machine."""
    width, height = scores.size
    parts = [f"{len(scores.frames)} frames of {width}x{height}"]
    if scores.has_reference:
        parts.append(f"{HEADLINE.label} on {scores.tone_map}, mean over frames")
        parts.append(f"reference {scores.reference_spp or 'of unknown'} spp")
        if scores.reference_halves:
            parts[-1] += f" in two halves, {HEADLINE.label} free of its noise but for ±"
            if scores.flip_floor is not None:
                parts.append(f"a perfect image would have FLIP {scores.flip_floor:.4f}")
        elif scores.headline_floor is not None:
            parts[-1] += (f", whose own noise caps {HEADLINE.label} at "
                          f"{scores.headline_floor:.1f} {HEADLINE.unit}")
    return "; ".join([*parts, "time: median after the first frame, without files"]) + "."


def _columns(scores: Scores) -> list[Metric]:
    return [row for row in scores.measures.values() if row.in_table]


def _heading(metric: Metric) -> str:
    return f"{metric.label} ({metric.unit})" if metric.unit else metric.label


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else f"{value:{form}}"


def _gain(scores: Scores, method: MethodScore) -> float | None:
    """dB over the input on the frames that the method has and that count in both means."""
    unfiltered = scores.methods[INPUT]
    if any(row[HEADLINE.name] is None and row.errors for row in method.per_frame):
        return _difference(scores, method)
    noisy = {row.frame: row[HEADLINE.name] for row in unfiltered.per_frame}
    gains = {row.frame: db - base for row in method.per_frame
             if (db := row[HEADLINE.name]) is not None and (base := noisy[row.frame]) is not None}
    left_out = {*unfiltered.identical_frames, *method.identical_frames}
    counted = [gain for i, gain in gains.items() if i not in left_out] or list(gains.values())
    return sum(counted) / len(counted) if counted else None


def _difference(scores: Scores, method: MethodScore) -> float | None:
    """Of the sequence's numbers, where single frames have none."""
    value, base = method[HEADLINE.name], scores.methods[INPUT][HEADLINE.name]
    return None if value is None or base is None else value - base


def best(scores: Scores) -> set[tuple[str, str]]:
    """(method, heading) of the best value of each metric."""
    found = set()
    for metric in _columns(scores):
        values = {name: value for name, method in scores.methods.items()
                  if (value := method[metric.name]) is not None}
        if len(values) > 1:
            pick = max if metric.higher_is_better else min
            found.add((pick(values, key=values.__getitem__), _heading(metric)))
    return found
