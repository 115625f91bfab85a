"""Render animations at one sample per pixel, denoise them, score the result.

    sequence = onespp.render("box", frames=8, size=(192, 192), reference_spp=64)
    onespp.denoise(sequence, "svgf", alpha=0.1)
    onespp.score(sequence)

Sizes are (height, width), colours linear Rec. 709 radiance, arrays float32. What cannot be used is
refused by an `InputError` (of a scene: a `SceneError`) of one sentence.

Importing this loads nothing heavy: not NumPy, Mitsuba, Dr.Jit or LLVM. Each name below is
imported when it is first asked for, and libraries when they are needed.

`render`, `denoise` and `scenes` are functions, and packages as well (`onespp.scenes.description`).
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType

TYPE_CHECKING = False  # (`typing` takes longer to import than all the rest)
if TYPE_CHECKING:
    import inspect
    from typing import Any

    from onespp.api.datasets import dataset
    from onespp.api.denoising import denoise, method, methods
    from onespp.api.importing import import_frames
    from onespp.api.loading import animate, load
    from onespp.api.rendering import open, render, scenes
    from onespp.api.scoring import Report, compare, metrics, report, score
    from onespp.clips.clips import Clips
    from onespp.datasets.folder import DataSet
    from onespp.denoise.score.scorecard import Scores
    from onespp.render.errors import InputError
    from onespp.render.files.sequence import FrameSequence
    from onespp.render.frame import Frame
    from onespp.scenes.description import Scene, SceneError

__all__ = ["Clips", "DataSet", "Frame", "FrameSequence", "InputError", "Report", "Scene",
           "SceneError", "Scores", "animate", "compare", "dataset", "denoise", "import_frames",
           "load", "method", "methods", "metrics", "open", "render", "report", "scenes", "score"]

_PLACES = {
    "onespp.api.datasets": ("dataset",),
    "onespp.api.denoising": ("denoise", "method", "methods"),
    "onespp.api.importing": ("import_frames",),
    "onespp.api.loading": ("animate", "load"),
    "onespp.api.rendering": ("open", "render", "scenes"),
    "onespp.api.scoring": ("Report", "compare", "metrics", "report", "score"),
    "onespp.clips.clips": ("Clips",),
    "onespp.datasets.folder": ("DataSet",),
    "onespp.denoise.score.scorecard": ("Scores",),
    "onespp.render.errors": ("InputError",),
    "onespp.render.files.sequence": ("FrameSequence",),
    "onespp.render.frame": ("Frame",),
    "onespp.scenes.description": ("Scene", "SceneError"),
}
_PLACE = {name: place for place, names in _PLACES.items() for name in names}


def _public(name: str) -> Any:
    return getattr(importlib.import_module(_PLACE[name]), name)


class _CalledPackage(ModuleType):
    """A package that is a function as well: `onespp.render(...)` beside `onespp.render.frame`."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return _public(self.__name__.partition(".")[2])(*arguments, **options)

    @property
    def __signature__(self) -> inspect.Signature:  # what help and notebooks show
        import inspect

        return inspect.signature(_public(self.__name__.partition(".")[2]))


class _Library(ModuleType):
    """This module: imports what is asked for, and makes the packages callable that are functions
    when Python, having imported them, sets them here."""

    def __setattr__(self, name: str, value: Any) -> None:
        if isinstance(value, ModuleType) and name in _PLACE:
            value.__class__ = _CalledPackage
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *__all__})

    if not TYPE_CHECKING:
        def __getattr__(self, name: str) -> Any:
            if name not in _PLACE:
                raise AttributeError(f"module 'onespp' has no attribute '{name}'")
            if name in ("render", "denoise", "scenes"):  # set here by their import
                return importlib.import_module(f"onespp.{name}")
            found = _public(name)
            self.__dict__[name] = found
            return found


sys.modules[__name__].__class__ = _Library
