"""A method of one's own: a class in a Python file, or one that an installed package offers.

`my_filter.py` is the file's only method, `my_filter.py:MyFilter` the one of that name: a class that
can be built without arguments, or an object that was. It is called as those of the catalog are,

    image, state = method(frame, state)

and need not have more than that: without `init(height, width)` the state before the first frame is
None; without `needs`, it is given every channel that frames have. Parameters are the fields of a
dataclass that hold a number, a text, or true or false.

What it is given cannot be written to, what it returns is checked and copied: an array of floats,
(h, w, 3), finite. `docs/own_filter.md` has the whole contract.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np

from onespp import entry_points
from onespp.render.channels import CHANNELS, OFFERED
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from onespp.user_code import UserCode, UserFile, a_kind, file_and_name, is_file

Value = bool | int | float | str
_KINDS: tuple[type, ...] = (bool, int, float, str)


def result_name(name: str) -> str:
    """What the results of a method are called: of `dir/f.py` f, of `dir/f.py:Name` f-Name.

    Other names stay as they are. (Letters that folders cannot have become "_".)
    """
    if not is_file(name):
        return name
    file, inner = file_and_name(name)
    plain = "-".join([file.stem, *([inner] if inner else [])])
    return re.sub(r"[^A-Za-z0-9._+-]", "_", plain).lstrip("._+-") or "own"


@dataclass(frozen=True, eq=False)
class OwnMethod:
    """A user's method as commands run it: what it returns is checked, what it raises is told.

    Attributes:
        method: the user's object. name: as f.py:Name, or that under which it is installed.
        code: where it comes from. defaults: of its parameters.
        versions: of the package that has it; empty for a file.
    """

    method: Any
    name: str
    code: UserCode
    defaults: Mapping[str, Value]
    versions: Mapping[str, str] = field(default_factory=dict)

    @property
    def needs(self) -> tuple[str, ...]:
        return tuple(getattr(self.method, "needs", ("color",)))

    @property
    def uses(self) -> tuple[str, ...]:
        """Every channel, for a method that does not say which it needs."""
        return tuple(getattr(self.method, "uses", ()) if hasattr(self.method, "needs")
                     else OFFERED)

    def init(self, height: int, width: int) -> Any:
        if not hasattr(self.method, "init"):
            return None
        with self.code.running():
            return self.method.init(height, width)

    def __call__(self, frame: Frame, state: Any) -> tuple[np.ndarray, Any]:
        """(h, w, 3) float32 radiance, and the user's state; None begins.

        Raises:
            InputError: it raises, or returns something else.
        """
        if not isinstance(frame, Frame):
            raise InputError(f"a method was called with a {type(frame).__name__}: give it a Frame")
        if state is None:
            state = self.init(frame.height, frame.width)
        with self.code.running():
            returned = self.method(read_only(frame), state)
        if not isinstance(returned, tuple) or len(returned) != 2:
            raise self._fault(f"returned {a_kind(returned)} for frame {frame.index}: "
                              "return image, state")
        image, after = returned
        if wrong := wrong_image(image, frame):
            raise self._fault(wrong)
        return np.array(image, np.float32, order="C"), after  # the user's may change later

    def parameters(self) -> dict[str, Value]:
        return own_parameters(self.method)

    def with_values(self, values: Mapping[str, Value]) -> OwnMethod:
        """The same with some parameters changed; InputError where its class refuses them."""
        if not values:
            return self
        with self.code.running():
            return replace(self, method=replaced(self.method, values))

    def _fault(self, what: str) -> Exception:
        thing = self.method if inspect.isfunction(self.method) else type(self.method).__call__
        return self.code.fault(f"{_called(self.method)} {what}", thing)


def from_file(name: str) -> OwnMethod:
    """The method that `f.py` or `f.py:Name` names.

    Raises:
        InputError: there is no such file, it raises, or it has no such method, or several.
    """
    path, inner = file_and_name(name)
    file = UserFile(path, "method file", InputError)
    found = file.run(lambda module: _chosen(module, inner, path.name))
    return own(found, path.name if inner is None else f"{path.name}:{inner}", file)


def installed(name: str) -> OwnMethod | None:
    """The method that an installed package offers under a name; None if none does.

    Raises:
        InputError: it cannot be imported, or is no method; or several packages have it.
    """
    offer = entry_points.offered(name, entry_points.METHODS, InputError)
    if offer is None:
        return None
    found, code = offer.load("method", InputError)
    return own(found, name, code, {offer.package: offer.version})


def offers() -> list[entry_points.Offer]:
    """The methods that installed packages offer."""
    return entry_points.offers(entry_points.METHODS)


def own(found: Any, name: str, code: UserCode, versions: Mapping[str, str] | None = None
        ) -> OwnMethod:
    """A class, or an object, as a method that commands can run.

    Raises:
        InputError: it cannot be built without arguments, or called as methods are.
    """
    if inspect.isclass(found):
        if missing := _missing(found):
            raise code.fault(f"{found.__name__}() lacks {', '.join(missing)}: give every "
                             "parameter a default", found.__init__)
        with code.running():
            method = found()
    else:
        method = found
    made = OwnMethod(method, name, code, {}, versions or {})
    with code.running():
        wrong = _wrong_method(method)
    if wrong:
        raise code.fault(*wrong)
    return replace(made, defaults=made.parameters())


def about_own(method: Any) -> str:
    """The first line of what it says of itself, with a space behind; "" where it says nothing."""
    inner = method.method if isinstance(method, OwnMethod) else method
    lines = (inspect.getdoc(inner) or "").splitlines()
    return f"{lines[0].rstrip('.')}. " if lines and lines[0].strip() else ""


def own_parameters(method: Any) -> dict[str, Value]:
    """Fields of a dataclass, and of those inside it, that a word on a command line can set."""
    found: dict[str, Value] = {}
    for f in fields(method) if is_dataclass(method) else ():
        value = getattr(method, f.name, None)
        if is_dataclass(value):
            found.update(own_parameters(value))
        elif f.init and (kind := next((k for k in _KINDS if isinstance(value, k)), None)):
            found[f.name] = kind(value)  # a plain one: NumPy's float64 is a float too
    return found


def read_only(frame: Frame) -> Frame:
    """The frame with arrays that cannot be written to: others read them too."""
    return replace(frame, images={name: _locked(image) for name, image in frame.images.items()},
                   camera_from_world=_locked(frame.camera_from_world),
                   screen_from_world=_locked(frame.screen_from_world),
                   world_from_object=_locked(frame.world_from_object))


def wrong_image(image: Any, frame: Frame) -> str | None:
    """What is wrong with what a method returned as the image of a frame; None: nothing."""
    what, expected = f"for frame {frame.index}", (frame.height, frame.width, 3)
    if not isinstance(image, np.ndarray):
        return (f"returned {a_kind(image)} {what}: use a NumPy array"
                + (", as image.detach().cpu().numpy()" if hasattr(image, "detach") else
                   ", as np.asarray(image)" if hasattr(image, "__array__") else ""))
    if image.shape != expected:
        return f"returned an image of shape {image.shape} {what}: use {expected}"
    if image.dtype.kind != "f":
        return f"returned an image of {image.dtype} {what}: use float32, linear radiance"
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(image.sum(dtype=np.float32)):  # NaN and infinity both reach the sum
            return None
        bad = np.logical_not(np.isfinite(image.astype(np.float32)).all(axis=-1))
    if not bad.any():
        return None
    row, column = np.argwhere(bad)[0].tolist()
    given = np.logical_not(np.isfinite(frame["color"]).all(axis=-1)) if "color" in frame else bad
    return (f"returned {int(bad.sum())} pixels that are not finite {what}, the first in row {row}, "
            f"column {column}" + (": the frame's colour is not finite there, replace it first"
                                  if given[row, column] else ""))


def _locked(array: np.ndarray) -> np.ndarray:
    view = array.view()
    view.flags.writeable = False
    return view


def replaced(method: Any, values: Mapping[str, Value]) -> Any:
    """A dataclass with some fields changed, those of the dataclasses inside it included."""
    if isinstance(method, OwnMethod):
        return method.with_values({k: v for k, v in values.items() if k in method.defaults})
    changes = {}
    for f in fields(method):
        value = getattr(method, f.name, None)
        if is_dataclass(value) and f.init:
            changes[f.name] = replaced(value, values)
        elif f.name in values and f.init:
            changes[f.name] = values[f.name]
    return replace(method, **changes) if changes else method


def _chosen(module: ModuleType, name: str | None, file: str) -> Any:
    """What a file has under a name, or its only method."""
    methods = {key: value for key, value in vars(module).items()
               if not key.startswith("_") and _is_method(value, module)}
    known = f": it has {', '.join(methods)}" if methods else ""
    if name is not None:
        if name not in vars(module):
            raise InputError(f"there is no '{name}' here{known}")
        return getattr(module, name)
    if not methods:
        raise InputError("there is no method here: add a class with __call__(self, frame, state) "
                         "that returns image, state (`onespp new method` writes one)")
    if len(methods) > 1:
        first, *others = methods
        raise InputError(f"there are several methods here: name one, as {file}:{first} (or "
                         f"{', '.join(others)})")
    return next(iter(methods.values()))


def _is_method(value: Any, module: ModuleType) -> bool:
    """Whether it is a class of this file's that frames can be given to.

    A network is no method, though it can be called: its __call__ is another file's, and it has no
    `init`.
    """
    if not inspect.isclass(value) or value.__module__ != module.__name__:
        return False
    called = next((c for c in value.__mro__ if "__call__" in vars(c)), None)
    return called is not None and (called.__module__ == module.__name__ or hasattr(value, "init"))


def _missing(kind: type) -> list[str]:
    """Parameters without which a class cannot be built."""
    try:
        known = inspect.signature(kind).parameters.values()
    except (TypeError, ValueError):  # of a class that is not Python's
        return []
    return [p.name for p in known if p.default is p.empty
            and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]


def _wrong_method(method: Any) -> tuple[str, Any] | None:
    """What keeps an object from being a method, and which function of it; None: nothing."""
    called = _called(method)
    if not callable(method):
        return (f"{called.removesuffix('.__call__')} cannot be called: add __call__(self, frame, "
                "state)",
                type(method).__init__)
    if not _takes(method, None, None):
        function = method if inspect.isfunction(method) else type(method).__call__
        return f"{called} does not take (frame, state): write it so", function
    init = getattr(method, "init", None)
    if init is not None and not (callable(init) and _takes(init, 1, 1)):
        return (f"{called.removesuffix('.__call__')}.init does not take (height, width): "
                "write it so", init)
    for name in ("needs", "uses"):
        channels = getattr(method, name, ())
        if not isinstance(channels, tuple | list) or not set(map(str, channels)) <= {*CHANNELS}:
            unknown = "" if not isinstance(channels, tuple | list) else next(
                f" ('{c}' is none)" for c in channels if c not in CHANNELS)
            return (f"{name} of {type(method).__name__} is {channels!r}: use a tuple of "
                    f"channels{unknown}, as (\"color\", \"normal\"); there are "
                    f"{', '.join(OFFERED)}", None)
    return None


def _takes(function: Callable[..., Any], *arguments: Any) -> bool:
    try:
        inspect.signature(function).bind(*arguments)
    except TypeError:
        return False
    except ValueError:  # not Python's: told when it is called
        return True
    return True


def _called(method: Any) -> str:
    return (method.__name__ if inspect.isfunction(method) else
            f"{type(method).__name__}.__call__")
