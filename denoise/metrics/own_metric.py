"""A metric of one's own: a function in a Python file, or one that an installed package offers.

`my_metric.py` is the file's only metric, `my_metric.py:edge_error` the one of that name: a function
(a, b) -> float of an image and its reference, both (h, w, 3) display values in [0, 1], of which
less is better; or a `Metric`, which says more. A class is built first: it can hold a network.

What it is given cannot be written to; what it returns is checked: a finite number, or None where
the metric does not apply.
"""

from __future__ import annotations

import inspect
import math
import numbers
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np

from onespp import entry_points
from onespp.render.errors import InputError
from onespp.user_code import UserCode, UserFile, a_kind, file_and_name, is_file

from .metric import Metric
from .table import MEASURES, METRICS

SPACES = ("srgb", "linear")
FORMAT = r"\+?\.[0-9]{1,2}[feg%]"
"""How tables and the report's page can print a number."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")


@dataclass(frozen=True, eq=False)
class Checked:
    """A user's function as commands call it."""

    function: Callable[..., Any]
    name: str
    code: UserCode

    def __call__(self, a: np.ndarray, b: np.ndarray) -> float | None:
        """Raises InputError where it raises, or returns anything but a finite number or None."""
        with self.code.running():
            found = self.function(_locked(a), _locked(b))
        if found is None:
            return None
        if isinstance(found, np.ndarray) and found.ndim == 0:
            found = found[()]
        if isinstance(found, bool | np.bool_) or not isinstance(found, numbers.Real):
            shape = f" of shape {found.shape}" if isinstance(found, np.ndarray) else ""
            raise self._fault(f"returned {a_kind(found)}{shape}: return one number"
                              + (", as value.item()" if hasattr(found, "item") else ""))
        if not math.isfinite(found):
            raise self._fault(f"returned {found}: return a finite number, or None where it does "
                              "not apply")
        return float(found)

    def _fault(self, what: str) -> Exception:
        return self.code.fault(f"{self.name} {what}", _code_of(self.function))


def own_metrics(names: Iterable[str]) -> list[Metric]:
    """The metrics that `--metric` names: of files, and of installed packages.

    Raises:
        InputError: there is none of that name, or it cannot be used, or is called like another.
    """
    found: dict[str, Metric] = {}
    for name in dict.fromkeys(names):
        metric = _from_file(name) if is_file(name) else _installed(name)
        if metric.name in found:
            raise InputError(f"two metrics are called '{metric.name}': give {name} another name")
        found[metric.name] = metric
    return list(found.values())


def source_of(metric: Metric) -> str:
    """Hash of the file that a metric is from; "" of others."""
    return metric.function.code.source if isinstance(metric.function, Checked) else ""


def as_metric(found: Any, name: str, code: UserCode) -> Metric:
    """A function, a class that can be called, or a `Metric`, as a metric that is checked.

    Args:
        name: what it is called, if it does not say so itself.

    Raises:
        InputError: it is none of these, or says what cannot be.
    """
    if inspect.isclass(found):
        with code.running():
            found = found()
    function = found.function if isinstance(found, Metric) else found
    thing = _code_of(function)
    if not callable(function):
        raise code.fault(f"'{name}' is {a_kind(function)}: use a function of (image, reference)")
    try:
        inspect.signature(function).bind(None, None)
    except TypeError:
        raise code.fault(f"'{name}' does not take (image, reference): write it so",
                         thing) from None
    except ValueError:  # not Python's: told when it is called
        pass
    metric = found if isinstance(found, Metric) else _plain(function, name)
    if wrong := _wrong(metric):
        raise code.fault(wrong, thing)
    return replace(metric, function=Checked(function, metric.name, code))


def _plain(function: Callable[..., Any], name: str) -> Metric:
    """A metric that says nothing of itself but its name, and the first line of its description."""
    about = (inspect.getdoc(function) or "").splitlines()
    return Metric(name, name.replace("_", " "), function, "srgb", "", False, ".4f",
                  about[0] if about else "a metric of one's own")


def _wrong(metric: Metric) -> str | None:
    """What a metric says of itself that cannot be."""
    if not isinstance(metric.name, str) or not _NAME.fullmatch(metric.name):
        return f"the name of the metric is {metric.name!r}: use letters, digits and '_'"
    if metric.name in MEASURES:
        return f"'{metric.name}' is a metric of ours: use another name"
    if metric.space not in SPACES:
        return f"the space of '{metric.name}' is {metric.space!r}: use {' or '.join(SPACES)}"
    if metric.estimate is not None:
        return f"'{metric.name}' has an estimate by halves: leave it out"
    texts = {"label": metric.label, "unit": metric.unit, "about": metric.about}
    for key, text in texts.items():
        if not isinstance(text, str) or not (text.isprintable() and len(text) <= 200):
            return f"the {key} of '{metric.name}' is {text!r:.60}: use one line of text"
    if not metric.label or metric.label in [row.label for row in MEASURES.values()]:
        return f"the label of '{metric.name}' is '{metric.label}': use one that no metric has"
    if not isinstance(metric.format, str) or not re.fullmatch(FORMAT, metric.format):
        return f"the format of '{metric.name}' is {metric.format!r:.60}: use one such as .4f or .1%"
    most = metric.most_frames
    if most is not None and (not isinstance(most, int) or most < 1):
        return (f"most_frames of '{metric.name}' is {most!r:.60}: use a whole number above 0, or "
                "None")
    return None


def _from_file(name: str) -> Metric:
    path, inner = file_and_name(name)
    file = UserFile(path, "metric file", InputError)
    called, found = file.run(lambda module: _chosen(module, inner, path.name))
    return as_metric(found, called, file)


def _chosen(module: ModuleType, name: str | None, file: str) -> tuple[str, Any]:
    """Name and object that a file has under a name, or its only metric: a `Metric`, else a function
    of its own, else a class."""
    public = {key: value for key, value in vars(module).items() if not key.startswith("_")}
    mine = {key: value for key, value in public.items()
            if getattr(value, "__module__", None) == module.__name__}
    kinds = ({k: v for k, v in public.items() if isinstance(v, Metric)},
             {k: v for k, v in mine.items() if inspect.isfunction(v)},
             {k: v for k, v in mine.items() if inspect.isclass(v) and "__call__" in vars(v)})
    metrics = next(filter(None, kinds), {})
    if name is not None:
        if name not in vars(module):
            known = f": it has {', '.join(metrics)}" if metrics else ""
            raise InputError(f"there is no '{name}' here{known}")
        return name, getattr(module, name)
    if not metrics:
        raise InputError("there is no metric here: add a function of (image, reference) that "
                         "returns a number (`onespp new metric` writes one)")
    first, *others = metrics
    if others:
        raise InputError(f"there are several metrics here: name one, as {file}:{first} (or "
                         f"{', '.join(others)})")
    return first, metrics[first]


def _installed(name: str) -> Metric:
    offer = entry_points.offered(name, entry_points.METRICS, InputError)
    if offer is None:
        there = [o.name for o in entry_points.offers(entry_points.METRICS)]
        hint = (f"'{name}' is always measured; " if name in METRICS else "")
        raise InputError(f"unknown metric '{name}': {hint}use "
                         + ", ".join([*there, "a file of your own, as my_metric.py"]))
    found, code = offer.load("metric", InputError)
    return as_metric(found, name.replace("-", "_"), code)


def _code_of(function: Any) -> Any:
    """The function that has lines of code, if it is an object that is called."""
    return function if inspect.isfunction(function) else vars(type(function)).get("__call__")


def _locked(array: np.ndarray) -> np.ndarray:
    view = array.view()
    view.flags.writeable = False
    return view
