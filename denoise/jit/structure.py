"""Named structures of arrays as lists of arrays, and back.

A structure is a Dr.Jit array, None where something is absent, or a NamedTuple, a tuple or a list of
structures. Dr.Jit does not look into a NamedTuple (`dr.eval` and `dr.freeze` take it for a value
without arrays, silently), and walks a list twice as fast as a dataclass. So structures go to it as
flat lists, each with a *form*, from which `build` makes the structure again.
"""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, TypeVar

import drjit as dr

S = TypeVar("S")
Form = tuple[Any, ...]
"""A structure without its arrays, in the order of `flatten`: the class of a NamedTuple; list or
tuple, then its length; None; for an array its width; the class of taps, then their lanes."""

_ARRAY, _NAMED, _SEQUENCE, _NONE, _TAPS = range(5)
_kinds: dict[type, int] = {list: _SEQUENCE, tuple: _SEQUENCE, type(None): _NONE}


class Flat(NamedTuple):
    """A structure as lists.

    Attributes:
        form: what `build` needs beside them. arrays: depth first.
        taps: objects with `lanes` and `seen_as`, which keep lists of their own (`stencil.Taps`).
    """

    form: Form
    arrays: list[Any]
    taps: list[Any]


def flatten(structure: Any) -> Flat:
    """The arrays of a structure, and its form.

    Raises:
        TypeError: there is something else in it.
    """
    arrays: list[Any] = []
    form: list[Any] = []
    taps: list[Any] = []
    _flatten(arrays, form, taps, (structure,))
    return Flat(tuple(form), arrays, taps)


def build(form: Form, arrays: Iterable[Any], taps: Iterable[Any] = ()) -> Any:
    """The structure of this form with these arrays and taps."""
    if form[0] is list and all(type(token) is int for token in form[1:]):
        return list(arrays)  # of arrays alone, as most results are
    return _build(1, iter(form), iter(arrays), iter(taps))[0]


def arrays_of(*structures: Any) -> list[Any]:
    """The arrays of some structures, depth first."""
    return flatten(structures).arrays


def mapped(function: Callable[..., Any], structure: S, *others: Any) -> S:
    """A structure of what a function makes of the arrays of structures of one form."""
    form, arrays, _ = flatten(structure)
    return build(form, [function(*a) for a in zip(arrays, *map(arrays_of, others), strict=True)])


def evaluate(*structures: Any) -> None:
    """Evaluate all arrays of some structures, in one kernel where they have one width."""
    dr.eval(arrays_of(*structures))


def _flatten(arrays: list[Any], form: list[Any], taps: list[Any], parts: Iterable[Any]) -> None:
    """Appends. A step does it at every call, so arrays, of which there are most, cost no call."""
    for part in parts:
        type_ = type(part)
        kind = _kinds.get(type_)
        if kind is None:
            kind = _kinds[type_] = _kind(type_)
        if kind == _ARRAY:
            arrays.append(part)
            form.append(len(part))
        elif kind == _NONE:
            form.append(None)
        elif kind == _TAPS:
            taps.append(part)
            form += type_, part.lanes
        else:
            form.append(type_)
            if kind == _SEQUENCE:
                form.append(len(part))
            _flatten(arrays, form, taps, part)


def _kind(type_: type) -> int:
    if dr.is_array_v(type_):
        return _ARRAY
    if issubclass(type_, tuple) and hasattr(type_, "_fields"):
        return _NAMED
    if hasattr(type_, "seen_as"):
        return _TAPS
    raise TypeError(f"a structure of arrays holds a value of type {type_.__name__}: use Dr.Jit "
                    "arrays, None, and NamedTuples, tuples and lists of them")


def _build(count: int, form: Iterator[Any], arrays: Iterator[Any],
           taps: Iterator[Any]) -> list[Any]:
    """The next so many parts. As in `_flatten`, arrays cost no call."""
    parts: list[Any] = []
    for _ in range(count):
        token = next(form)
        if type(token) is int:
            parts.append(next(arrays))
        elif token is None:
            parts.append(None)
        elif token is list or token is tuple:
            parts.append(token(_build(next(form), form, arrays, taps)))
        elif _kinds[token] == _TAPS:
            next(form)  # their lanes
            parts.append(next(taps))
        else:
            parts.append(token(*_build(len(token._fields), form, arrays, taps)))
    return parts
