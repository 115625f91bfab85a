"""Denoising a sequence, and one frame after another without files."""

from __future__ import annotations

import warnings
from typing import Any

from onespp.denoise.catalog import (
    OUTLIERS,
    Method,
    build,
    described,
    name_of,
)
from onespp.denoise.methods.outliers import RemoveOutliers, WithoutOutliers
from onespp.denoise.own_method import result_name
from onespp.denoise.run.several import denoise_by, what_to_know
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence

from .caller import caller, public


@public
def denoise(sequence: FrameSequence, method: str | Method[Any] = "onespp", *,
            name: str | None = None, outliers: float | None = None,
            **parameters: bool | int | float | str) -> FrameSequence:
    """Denoise the frames of a sequence; results are files in its folder.

    Args:
        sequence: from `render` or `open`.
        method: a name of `onespp.methods()`, a file of yours ("my_filter.py:MyFilter"), or an
            object that denoises one frame after another as `onespp.method` gives: with `needs`,
            `init(height, width)` and a call.
        name: of the results; default the method's, of an object of yours its class's.
        outliers: before the method, clamp each pixel to so many standard deviations from the mean
            of its neighbours on the same surface.
        **parameters: of a method by name, as `alpha=0.1`; `onespp.method(name)` shows them.

    Returns:
        The same sequence. `read_result(name, i)` is (h, w, 3) float32 linear Rec. 709 radiance,
        `read_run(name)` tells parameters and times.

    Raises:
        InputError: no such method or parameter, a value out of its range, or the frames lack a
            channel that the method needs.
        KeyboardInterrupt: at the end of a frame; what was finished is kept in the folder.

    Example:
        >>> import onespp
        >>> sequence = onespp.render("box", frames=2, size=(12, 16))
        >>> sequence = onespp.denoise(sequence, "svgf", alpha=0.1)
        >>> sequence.read_result("svgf", 1).shape
        (12, 16, 3)
    """
    if not isinstance(sequence, FrameSequence):
        raise InputError(f"denoise takes a sequence, not a {type(sequence).__name__}: "
                         "onespp.open(folder) gives one")
    if isinstance(method, str):
        made = build(method, _as_text(parameters), outliers)
        called = result_name(method) + (OUTLIERS if outliers is not None else "")
    else:
        if parameters:
            raise InputError(f"{', '.join(parameters)} can be given with a method's name only: set "
                             "parameters of a method of yours when you make it")
        _check_method(method)
        made = method if outliers is None else WithoutOutliers(method, RemoveOutliers(outliers))
        called = name_of(made) or type(method).__name__
    with caller().progress() as report:
        denoise_by(sequence, {name or called: made}, report, caller().command())
    for sentence in what_to_know(sequence, default=False):
        warnings.warn(sentence, UserWarning, stacklevel=3)
    return sequence


@public
def method(name: str = "onespp", *, outliers: float | None = None,
           **parameters: bool | int | float | str) -> Method[Any]:
    """A denoiser, for one frame after another, without files.

    `image, state = method(frame, state)` takes a `Frame` and what the call before it returned,
    None at first, and gives (h, w, 3) float32 linear Rec. 709 radiance.

    Args:
        name: one of `onespp.methods()`.
        outliers, **parameters: as for `denoise`.

    Raises:
        InputError: no such method or parameter, or a value out of its range. Of a call: the frame
            lacks a channel, or has another size than the one before it.

    Example:
        >>> import numpy as np, onespp
        >>> frame = onespp.Frame.from_arrays(
        ...     color=np.full((12, 16, 3), 0.5), normal=np.tile([0.0, 0.0, -1.0], (12, 16, 1)),
        ...     depth=np.full((12, 16), 2.0), motion=np.zeros((12, 16, 2)))
        >>> method, state = onespp.method("svgf", alpha=0.1), None
        >>> for _ in range(3):
        ...     image, state = method(frame, state)
        >>> image.shape, round(float(image.mean()), 3)
        ((12, 16, 3), 0.5)
    """
    return build(name, _as_text(parameters), outliers)


@public
def methods() -> dict[str, str]:
    """The methods by name, and what each one is; peers that can't run here say so.

    Example:
        >>> import onespp
        >>> "svgf" in onespp.methods()
        True
    """
    return described()


def _check_method(method: Any) -> None:
    for name in ("needs", "init", "__call__"):
        if not hasattr(method, name) or isinstance(method, type):
            what = f"the class {method.__name__}" if isinstance(method, type) else (
                f"a {type(method).__name__} without `{name}`")
            raise InputError(f"denoise was given {what}: use a name of onespp.methods(), or an "
                             "object with `needs`, `init(height, width)` and "
                             "`__call__(frame, state)`")


def _as_text(parameters: dict[str, bool | int | float | str]) -> dict[str, str]:
    """As `build` takes them, which then refuses what is of another type."""
    return {key: str(value) for key, value in parameters.items()}
