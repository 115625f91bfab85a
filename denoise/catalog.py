"""The denoising methods by name, and how to build one from text.

A method is a frozen dataclass of parameters, checked when built. It is called with one frame
after another and its own state, which holds all that is remembered and all memory it works in:

    method = METHODS["assignment"]()
    state = method.init(height, width)
    for frame in frames:
        image, state = method(frame, state)     # (h, w, 3) float32, linear radiance
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol, TypeVar

import numpy as np

from onespp.denoise.inputs.demodulation import CHANNELS as TEXTURE
from onespp.denoise.methods.antialiasing.innovation_taa import InnovationTaa
from onespp.denoise.methods.antialiasing.taa import Taa
from onespp.denoise.methods.assignment import Assignment, AssignmentAtrous
from onespp.denoise.methods.asvgf import Asvgf
from onespp.denoise.methods.atrous import Atrous
from onespp.denoise.methods.bilateral import Bilateral
from onespp.denoise.methods.filtered_innovation.method import FilteredInnovation
from onespp.denoise.methods.learned.rae import Rae
from onespp.denoise.methods.learned.unet import Unet
from onespp.denoise.methods.outliers import RemoveOutliers, WithoutOutliers
from onespp.denoise.methods.parameters import renamed_parameters, with_present_names
from onespp.denoise.methods.regression.bmfr import Bmfr
from onespp.denoise.methods.reliable_motion.trmv import Trmv
from onespp.denoise.methods.separable import BilateralSeparable
from onespp.denoise.methods.svgf import Svgf
from onespp.denoise.methods.temporal import Temporal
from onespp.denoise.methods.unguided.bilateral_color import BilateralColor
from onespp.denoise.methods.unguided.gaussian import Gaussian
from onespp.denoise.methods.unguided.gaussian_separable import GaussianSeparable
from onespp.denoise.own_method import OwnMethod, from_file, installed, offers, replaced
from onespp.denoise.peers.oidn import Oidn
from onespp.denoise.peers.oidn_split import OidnSplit
from onespp.denoise.peers.optix import Optix
from onespp.denoise.peers.temporal_oidn import TemporalOidn
from onespp.denoise.peers.temporal_oidn_split import TemporalOidnSplit
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from onespp.render.host import backend
from onespp.render.host.versions import versions
from onespp.user_code import is_file

from .peers import oidn, optix

OUTLIERS = "+outliers"
"""Ends the name of a method before which outliers are removed."""


State = TypeVar("State")


class Method(Protocol[State]):
    """What every denoiser offers; `State` is what it remembers from frame to frame.

    Attributes:
        needs: channels that a frame must have. A method may also have `uses`: channels that it
            takes where a frame has them, beside albedo, emission and motion; and `renamed`: former
            name of a parameter -> its name.
    """

    @property
    def needs(self) -> tuple[str, ...]: ...

    def init(self, height: int, width: int) -> State:
        """State before the first frame of a sequence of this size."""
        ...

    def __call__(self, frame: Frame, state: State | None) -> tuple[np.ndarray, State]:
        """(h, w, 3) float32 denoised radiance, and the state for the next frame; None begins."""
        ...


METHODS: Mapping[str, type] = MappingProxyType({
    "gaussian": Gaussian,
    "gaussian-separable": GaussianSeparable,
    "bilateral-color": BilateralColor,
    "bilateral": Bilateral,
    "bilateral-separable": BilateralSeparable,
    "atrous": Atrous,
    "temporal": Temporal,
    "taa": Taa,
    "assignment": Assignment,
    "assignment-atrous": AssignmentAtrous,
    "svgf": Svgf,
    "trmv": Trmv,
    "asvgf": Asvgf,
    "bmfr": Bmfr,
    "rae-quarter": Rae,
    "unet-half": Unet,
    "onespp": FilteredInnovation,
    "onespp-taa": InnovationTaa,
})


def build(name: str, settings: Mapping[str, str] | None = None,
          outliers: float | None = None,
          note: Callable[[str], None] | None = None) -> Method[Any]:
    """A method by name, with some parameters given as text: `build("bilateral", {"radius": "8"})`.

    The name is one of `METHODS` or `PEERS`, a file's or an installed package's (`own_method.py`).
    With `outliers`, frames have those removed first that are farther off than so many standard
    deviations (`outliers.py`).

    Args:
        note: told of each parameter that is given by a former name; default a FutureWarning.

    Raises:
        InputError: no such method or parameter (the message lists them), or a value that does
            not read as the parameter's type or is out of its range.
    """
    method = _made(name)
    if outliers is not None:
        method = WithoutOutliers(method, RemoveOutliers(outliers))
    return configured(method, settings or {}, note)


def configured(method: Method[Any], settings: Mapping[str, str],
               note: Callable[[str], None] | None = None) -> Method[Any]:
    """A method with some parameters changed; arguments and errors as for `build`."""
    known, typed = parameters(method), {}
    for key, text in with_present_names(settings, renamed_parameters(method),
                                        note or _warn).items():
        if key not in known:
            raise InputError(f"method '{name_of(method)}' has no parameter '{key}': it has "
                             f"{', '.join(known) or 'none, since it is no dataclass'}")
        typed[key] = _parse(key, text, type(known[key]))
    return replaced(method, typed)


def _made(name: str) -> Method[Any]:
    """With its defaults."""
    if name in METHODS:
        return METHODS[name]()
    if name in PEERS:
        return PEERS[name].make()
    made = from_file(name) if is_file(name) else installed(name)
    if made is None:
        offered = [offer.name for offer in offers()]
        hint = f"did you mean {name}.py? " if Path(f"{name}.py").is_file() else ""
        raise InputError(f"unknown method '{name}': {hint}use "
                         f"{', '.join(dict.fromkeys((*METHODS, *PEERS, *offered)))}, or a file of "
                         "your own, as my_filter.py")
    return made


def name_of(method: Any) -> str | None:
    """The name under which `build` makes a method like this one; None for another object."""
    if isinstance(method, OwnMethod):
        return method.name
    if isinstance(method, WithoutOutliers):
        inner = name_of(method.method)
        return inner and inner + OUTLIERS
    made = {**{name: kind() for name, kind in METHODS.items() if kind is type(method)},
            **{name: peer.make() for name, peer in PEERS.items()}}
    alike = {name: sum(getattr(other, f.name) == getattr(method, f.name) for f in fields(method))
             for name, other in made.items() if type(other) is type(method)}
    return max(alike, key=alike.__getitem__) if alike else None


def changed(method: Any) -> dict[str, bool | int | float | str]:
    """The parameters that are not the method's defaults; none for an object of another class."""
    inner = method.method if isinstance(method, WithoutOutliers) else method
    name = name_of(inner)
    if name is None:
        return {}
    default = dict(inner.defaults) if isinstance(inner, OwnMethod) else parameters(build(name))
    if inner is not method:
        default.update(parameters(RemoveOutliers()))
    return {key: value for key, value in parameters(method).items() if value != default[key]}


def check_not_a_method(name: str, ran: str | None) -> None:
    """InputError where results get the name of a method other than that which `ran`."""
    plain = name.lower().removesuffix(OUTLIERS)
    if name != ran and plain in (*METHODS, *PEERS):
        raise InputError(f"'{name}' is the name of a method, and not of what makes these results "
                         f"({ran or 'another one'}): use another --name")


def _warn(text: str) -> None:
    warnings.warn(text, FutureWarning, stacklevel=4)


def channels_read(method: Method, there: Iterable[str]) -> tuple[str, ...]:
    """Channels that a method reads of a frame that has those in `there`, what it needs first."""
    optional = {*TEXTURE, "motion", *getattr(method, "uses", ())}
    return tuple(dict.fromkeys((*method.needs, *(c for c in there if c in optional))))


def parameters(method: Any) -> dict[str, bool | int | float | str]:
    """Parameter name -> value, those of a method's parts included; of an object that is no
    dataclass its plain attributes."""
    if isinstance(method, OwnMethod):
        return method.parameters()
    if not is_dataclass(method):
        return {key: value for key, value in getattr(method, "__dict__", {}).items()
                if isinstance(value, bool | int | float | str) and not key.startswith("_")}
    found: dict[str, bool | int | float | str] = {}
    for f in fields(method):
        value = getattr(method, f.name)
        found.update(parameters(value) if is_dataclass(value) else {f.name: value})
    return found


def source_of(method: Any) -> str:
    """Hash of the file that a method of one's own is from; "" of others."""
    inner = method.method if isinstance(method, WithoutOutliers) else method
    return inner.code.source if isinstance(inner, OwnMethod) else ""


def versions_of(method: Any) -> dict[str, str]:
    """Package -> version, of the packages that decide what a method does."""
    inner = method.method if isinstance(method, WithoutOutliers) else method
    return {**versions("drjit"), **(inner.versions if isinstance(inner, OwnMethod) else {})}


_WORDS = {"true": True, "yes": True, "on": True, "1": True,
          "false": False, "no": False, "off": False, "0": False}


def _parse(key: str, text: str, kind: type) -> bool | int | float | str:
    try:
        return _WORDS[str(text).strip().lower()] if kind is bool else kind(text)
    except (KeyError, ValueError, TypeError):  # None, say
        expected = {bool: "true or false", int: "a whole number", float: "a number"}[kind]
        raise InputError(f"{key} is '{text}': use {expected}") from None


@dataclass(frozen=True)
class Peer:
    """One denoiser: `make()` builds it with its defaults, `available()` says if it can run here."""

    make: Callable[[], Any]
    available: Callable[[], bool]
    about: str


def _has_optix() -> bool:
    return backend.choose() == "cuda" and optix.has_weights()


def _has_oidn() -> bool:
    return oidn.AVAILABLE


PEERS: Mapping[str, Peer] = MappingProxyType({
    **{f"oidn-{quality}": Peer(partial(Oidn, quality), _has_oidn,
                               f"Intel Open Image Denoise, quality {quality}, frame by frame.")
       for quality in oidn.QUALITIES},
    **{name: Peer(kind, _has_oidn, (kind.__doc__ or "").splitlines()[0])
       for name, kind in (("oidn-split", OidnSplit), ("temporal-oidn", TemporalOidn),
                          ("temporal-oidn-split", TemporalOidnSplit))},
    "optix": Peer(Optix, _has_optix, "NVIDIA's OptiX denoiser, frame by frame."),
    "optix-temporal": Peer(partial(Optix, temporal=True), _has_optix,
                           "NVIDIA's OptiX denoiser with its last result."),
})


def described() -> dict[str, str]:
    """Name -> what it is, in a line, of every method and peer."""
    about = {name: (method.__doc__ or "").splitlines()[0] for name, method in METHODS.items()}
    return about | {name: peer.about + ("" if peer.available() else " Not available here.")
                    for name, peer in PEERS.items()}
