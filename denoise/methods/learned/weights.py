"""Weights of a network as a file: an .npz of float16 arrays, and what they are."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from onespp.render.errors import InputError
from onespp.render.files.atomic import read_bytes, write_bytes

from .architecture import WIDTHS, Architecture, Weights
from .networks import NETWORKS

_ABOUT = "about"


@dataclass(frozen=True)
class Network:
    """Trained weights.

    Attributes:
        kind: of `NETWORKS`. width: of `WIDTHS`. weights: float32.
        about: what they were trained on and how, and by which versions, as JSON has it.
    """

    kind: str
    width: str
    weights: Weights = field(repr=False)
    about: Mapping[str, Any] = field(default_factory=dict)

    @property
    def architecture(self) -> Architecture:
        return NETWORKS[self.kind]


def write_network(path: Path, network: Network) -> None:
    """As float16; InputError where the disk refuses."""
    about = json.dumps({**network.about, "network": network.kind, "width": network.width},
                       sort_keys=True)
    arrays = {name: array.astype(np.float16) for name, array in network.weights.items()}
    memory = io.BytesIO()
    np.savez_compressed(memory, allow_pickle=False, **arrays, **{
        _ABOUT: np.frombuffer(about.encode(), np.uint8)})
    write_bytes(path, memory.getvalue(), durable=True)


@lru_cache(8)
def read_network(path: Path, _changed: float = 0.0) -> Network:
    """The weights of a file.

    Raises:
        InputError: there is no such file, or it holds something else.
    """
    data = read_bytes(path)
    wrong = InputError(f"{path} holds no weights of a network: use a file that `onespp train` "
                       "wrote")
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            about = json.loads(file[_ABOUT].tobytes())
            weights = {name: file[name].astype(np.float32) for name in file.files
                       if name != _ABOUT}
        kind, width = about.pop("network"), about.pop("width")
    except (ValueError, KeyError, OSError, EOFError, AttributeError, TypeError,
            zipfile.BadZipFile) as error:
        raise wrong from error
    if kind not in NETWORKS or width not in WIDTHS:
        raise wrong
    shapes = NETWORKS[kind].shapes(width)
    if {n: a.shape for n, a in weights.items()} != shapes or not all(
            np.isfinite(a).all() for a in weights.values()):
        raise wrong
    return Network(kind, width, weights, about)


def shipped(kind: str) -> Path:
    """The file of a kind's weights that comes along."""
    return Path(__file__).with_name(f"{kind}_{NETWORKS[kind].width}.npz")


def shipped_or(path: str, kind: str) -> Network:
    """The weights of a file, or, for "", those that come along; InputError for another kind's."""
    if not path:
        return read_network(shipped(kind))
    file = Path(path)
    network = read_network(file, file.stat().st_mtime if file.exists() else 0.0)
    if network.kind != kind:
        raise InputError(f"{path} holds weights of the network {network.kind}, and the method is "
                         f"of {kind}: use a file that `onespp train {kind}` wrote")
    return network
