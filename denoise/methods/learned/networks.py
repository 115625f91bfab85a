"""The kinds of networks by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from onespp.render.errors import InputError

from .architecture import Architecture
from .rae_plan import RAE
from .unet_plan import UNET

NETWORKS: Mapping[str, Architecture] = MappingProxyType({a.name: a for a in (RAE, UNET)})


def architecture_of(name: str) -> Architecture:
    """InputError: there is none of that name."""
    if name not in NETWORKS:
        raise InputError(f"there is no network '{name}': use {', '.join(NETWORKS)}")
    return NETWORKS[name]
