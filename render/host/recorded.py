"""Functions that launch kernels, recorded once and replayed after that.

To trace a function and to find its kernel among those that were compiled takes as long as to run
it, for images of a few tens of thousands of pixels. A recording (`dr.freeze`) launches the kernel
at once. What a recorded function reads is among its arguments, in memory of Dr.Jit's own
(`aligned.owned`): of another array Dr.Jit says so, of mapped memory it may read what was there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any

import drjit as dr

_MOST = 8  # recordings of a function: of what is of another form each time, more would be kept


class Recorded:
    """A function, called as it is the first time, so that what is built when it is first needed is
    there by then; recorded the second; replayed after that.

    It is recorded anew where an argument is of another form or another Python object, or there are
    other Mitsuba scenes than there were. What Dr.Jit cannot record is called as it is for ever.
    """

    def __init__(self, function: Callable[..., Any], enabled: bool = True) -> None:
        given = _Given()
        self._function, self._given, self._enabled = function, given, enabled
        self._frozen: Any = dr.freeze(lambda *_: function(*given.arguments), limit=_MOST,
                                      warn_after=1000, state_fn=lambda *_: given.form)

    def __call__(self, scene: Any, *arguments: Any) -> Any:
        """function(*arguments); scene: the Mitsuba scene that it reads.

        Arguments are Dr.Jit arrays, values that can be hashed, and tuples, lists and dataclasses of
        them; the result, Dr.Jit arrays in tuples, lists and dictionaries.
        """
        given = self._given
        if self._enabled and given.before:
            arrays: list[Any] = []
            given.arguments, given.form = arguments, _form(arguments, arrays)
            try:
                return self._frozen(scene, arrays)
            except RuntimeError as error:  # it wraps others, also an interrupt
                if not str(error).startswith("record()"):
                    raise
                if error.__cause__ and not isinstance(error.__cause__, RuntimeError):
                    raise error.__cause__ from None
                self._enabled = False
            finally:
                given.arguments = ()
        given.before = True
        return self._function(*arguments)

    @property
    def recordings(self) -> int:
        """How many there are; 0 where there can be none."""
        return self._frozen.n_recordings if self._enabled else 0


class _Given:
    """The arguments of the call that is being made, their form, and whether there was one before.

    Dr.Jit does not look into it. It holds a lock while it walks the arguments that it is given
    itself, so those are a list: to walk a dataclass is to run Python, which may have to wait for
    another thread that waits for the lock to let an array go.
    """

    arguments: tuple[Any, ...] = ()
    form: tuple[Any, ...] = ()
    before = False


def _form(value: Any, arrays: list[Any]) -> Any:
    """Of a structure, what is no array; those are appended to `arrays`."""
    kind = type(value)
    if dr.is_array_v(kind):
        arrays.append(value)
        return kind
    if is_dataclass(value):
        return kind, *(_form(getattr(value, field.name), arrays) for field in fields(value))
    if kind in (tuple, list):
        return kind, *(_form(part, arrays) for part in value)
    return value
