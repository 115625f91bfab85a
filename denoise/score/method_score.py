"""The scores of one method, as scores.json has them: its frames, and the mean over them.

The values of `MEASURES` stand beside the declared fields, under their names.
"""

from __future__ import annotations

from typing import Any

from pydantic import ConfigDict, Field, FiniteFloat, model_serializer

from onespp.render.files.json_file import JsonFile

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
