"""Functions of arrays, recorded at their first call and replayed after that."""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, ParamSpec, TypeVar, cast

import drjit as dr

from onespp.render.host.turns import no_collection

from .structure import Form, build, flatten
from .taps import Taps

P = ParamSpec("P")
R = TypeVar("R")


class Step(Generic[P, R]):
    """A function of structures of Dr.Jit arrays and taps, recorded at its first call and replayed
    after that.

    An argument is a `structure` (`structure.py`): an array, None, taps, or a NamedTuple, tuple or
    list of such; so is the result, but without taps. Another form, such as None where there was an
    array, or other numbers of lanes, record again.

    Make one for each grid and each place it is called from: a recording holds the size of the
    grid, and which of its arguments share memory.

    Raises:
        TypeError: at a call, where an argument holds something else. A number that a kernel takes
            is an array too (`Stencil.opaque`): otherwise it would be recorded. Of a result,
            Dr.Jit makes it the cause of its RuntimeError.
    """

    def __init__(self, function: Callable[P, R]) -> None:
        call, traced = _Call(), cast("Callable[..., R]", function)

        def record(arrays: list[Any], taps: list[list[Any]]) -> list[Any]:
            seen = [a.seen_as(b) for a, b in zip(call.taps, taps, strict=True)]
            arguments = build(call.form, arrays, seen)
            results = flatten(traced(*arguments))
            call.results[call.number] = results.form
            return results.arrays

        self._call = call
        self._frozen: Any = dr.freeze(record, state_fn=lambda *_: call.number, warn_after=1000)

    def __call__(self, *arguments: P.args, **_: P.kwargs) -> R:
        call = self._call
        call.form, arrays, call.taps = flatten(arguments)
        call.number = call.numbers.setdefault(call.form, len(call.numbers))
        try:
            with no_collection():
                results = self._frozen(arrays, [taps.arrays for taps in call.taps])
        finally:
            call.taps = []
        return build(call.results[call.number], results)

    @property
    def recordings(self) -> int:
        return self._frozen.n_recordings


class _Call:
    """The call that is being made: its taps, its form, and the number of that among the forms seen,
    for Dr.Jit walks what tells recordings apart; and the form of the results, by that number.
    Dr.Jit walks all that a recorded function's closure holds, at every call, but not into an object
    such as this."""

    def __init__(self) -> None:
        self.taps: list[Taps] = []
        self.form: Form = ()
        self.number = 0
        self.numbers: dict[Form, int] = {}
        self.results: dict[int, Form] = {}
