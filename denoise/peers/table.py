"""Denoisers of others, under names as our own methods have them; each needs something installed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

from onespp.render.host import backend

from . import oidn
from .oidn import Oidn, TemporalOidn
from .optix import Optix


@dataclass(frozen=True)
class Peer:
    """One denoiser: `make()` builds it with its defaults, `available()` says if it can run here."""

    make: Callable[[], Any]
    available: Callable[[], bool]
    about: str


def _has_cuda() -> bool:
    return backend.choose() == "cuda"


def _has_oidn() -> bool:
    return oidn.AVAILABLE


PEERS: Mapping[str, Peer] = MappingProxyType({
    **{f"oidn-{quality}": Peer(partial(Oidn, quality), _has_oidn,
                               f"Intel Open Image Denoise, quality {quality}, frame by frame.")
       for quality in oidn.QUALITIES},
    "temporal-oidn": Peer(TemporalOidn, _has_oidn, (TemporalOidn.__doc__ or "").splitlines()[0]),
    "optix": Peer(Optix, _has_cuda, "NVIDIA's OptiX denoiser, frame by frame."),
    "optix-temporal": Peer(partial(Optix, temporal=True), _has_cuda,
                           "NVIDIA's OptiX denoiser with its last result."),
})
