"""What scores.json and scores.csv hold, and reading it back.

`Scores` is the JSON file as it stands: strict JSON, so a number that was not measured (no
reference, no time) is null, and nothing is ever NaN or infinite. The values of `MEASURES` stand
beside the declared fields, under their names: `scores.methods["input"]["psnr_srgb"]`.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

from pydantic import ConfigDict, Field, FiniteFloat, field_validator, model_serializer

from onespp.denoise.metrics.metric import Metric
from onespp.denoise.metrics.own_metric import FORMAT, source_of
from onespp.denoise.metrics.table import ESTIMATED, HEADLINE, MEASURES
from onespp.denoise.own_method import result_name
from onespp.render.errors import InputError
from onespp.render.files.json_file import JsonFile, format_json, read_json

INPUT = "input"
"""The method that does nothing: the noisy frames themselves."""


class Measured(JsonFile):
    """Fields of its own, and one number or null for each metric."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, FiniteFloat | None]

    def __getitem__(self, metric: str) -> float | None:
        return self.__pydantic_extra__.get(metric)

    @model_serializer(mode="wrap")
    def _rows_last(self, serialize: Any) -> dict[str, Any]:
        data = serialize(self)  # the summary is read first, so it stands first
        return {key: data[key] for key in sorted(data, key=lambda key: key == "per_frame")}


class FrameScore(Measured):
    """One frame of one method.

    Attributes:
        ms: time to denoise it, without reading and writing files.
        errors: measure -> standard error of its value, of those that halves of the reference
            give; a measure without a value has none (`estimate.py`: too near to 0 to have dB).
    """

    frame: int
    ms: FiniteFloat | None
    non_finite_pixels: int
    errors: dict[str, FiniteFloat] = Field(default_factory=dict)


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


class ClassScore(JsonFile):
    """A method's error on the pixels of one class, pooled over frames.

    Attributes:
        pixels: share of all pixels. mse_share: share of the method's squared error.
        psnr_srgb: dB of the mean squared error in the class; null if it has no pixels, or an
            error that the reference's halves cannot tell from 0. error: its standard error; null
            without halves.
    """

    pixels: FiniteFloat
    mse_share: FiniteFloat
    psnr_srgb: FiniteFloat | None
    error: FiniteFloat | None = None


class ErrorSplit(JsonFile):
    """Bias and variance of display values over renders with other seeds (`bias_variance.py`).

    bias_error: standard error of bias_squared by the reference's noise; null without halves.
    """

    renders: int
    frames: int
    mse: FiniteFloat
    bias_squared: FiniteFloat
    variance: FiniteFloat
    bias_error: FiniteFloat | None = None


class MethodScore(Measured):
    """One method over the sequence; its measures are means over `per_frame` (`means.py`).

    Attributes:
        method: what made the results, as `Run.method`; "" for the input. changed: `Run.changed`.
        ms_per_frame: median over the frames after the first. first_ms: the first, which
            includes compiling. Both null for the input. `interleaved`: the median is that of
            `onespp time`, measured in turns with other methods.
        startup_ms: what the first three frames took beyond that median each: compiling, loading.
        megapixels_per_s: pixels over that median. peak_mb: of `Run`.
        non_finite_pixels: sum over frames; such pixels were scored as black.
        identical_frames: those that display the same as the reference: infinite PSNR.
        device, machine, threads, parameters, versions: of the run that made the results.
        by_cause, by_history: error by `classes.CAUSES` and `HISTORIES`, over the frames that
            have a frame before them; empty without reference or guides.
        split: bias and variance, where other seeds were given.
        errors: measure -> standard error of its value, by the noise of the reference alone.
        bounds: measures whose value is only a bound, on the side of the worse: the truth is as
            good or better, beyond what the reference can tell.
    """

    method: str = ""
    changed: dict[str, Any] = Field(default_factory=dict)
    ms_per_frame: FiniteFloat | None
    first_ms: FiniteFloat | None
    startup_ms: FiniteFloat | None = None
    megapixels_per_s: FiniteFloat | None = None
    peak_mb: FiniteFloat | None = None
    interleaved: bool = False
    non_finite_pixels: int
    identical_frames: list[int] = Field(default_factory=list)
    device: str
    machine: str = ""
    threads: int | None
    parameters: dict[str, Any]
    versions: dict[str, str]
    by_cause: dict[str, ClassScore] = Field(default_factory=dict)
    by_history: dict[str, ClassScore] = Field(default_factory=dict)
    split: ErrorSplit | None = None
    errors: dict[str, FiniteFloat] = Field(default_factory=dict)
    bounds: list[str] = Field(default_factory=list)
    per_frame: list[FrameScore]


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
        writer = csv.writer(text, lineterminator="\n")
        measures = self.measures
        writer.writerow(["method", "frame", *measures, "ms", "reference_floor_db",
                         "non_finite_pixels", *(f"{m}_error" for m in ESTIMATED)])
        for name, method in self.methods.items():
            for row in method.per_frame:
                writer.writerow([name, row.frame, *(row[m] for m in measures), row.ms,
                                 self.reference_floor_per_frame.get(row.frame),
                                 row.non_finite_pixels, *(row.errors.get(m) for m in ESTIMATED)])
        return text.getvalue()


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
