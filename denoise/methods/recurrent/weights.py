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

from .architecture import WIDTHS, Weights, shapes

SHIPPED = Path(__file__).with_name("rae_quarter.npz")
_ABOUT = "about"


@dataclass(frozen=True)
class Network:
    """Trained weights.

    Attributes:
        width: of `WIDTHS`. weights: float32.
        about: what they were trained on and how, and by which versions, as JSON has it.
    """

    width: str
    weights: Weights = field(repr=False)
    about: Mapping[str, Any] = field(default_factory=dict)


def write_network(path: Path, network: Network) -> None:
    """As float16; InputError where the disk refuses."""
    about = json.dumps({**network.about, "network": "rae", "width": network.width}, sort_keys=True)
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
    wrong = InputError(f"{path} holds no weights of a recurrent autoencoder: use a file that "
                       "`onespp train rae` wrote")
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            about = json.loads(file[_ABOUT].tobytes())
            weights = {name: file[name].astype(np.float32) for name in file.files
                       if name != _ABOUT}
        width = about.pop("width")
    except (ValueError, KeyError, OSError, EOFError, AttributeError, TypeError,
            zipfile.BadZipFile) as error:
        raise wrong from error
    if width not in WIDTHS or {n: a.shape for n, a in weights.items()} != shapes(width) or not all(
            np.isfinite(a).all() for a in weights.values()):
        raise wrong
    return Network(width, weights, about)


def shipped_or(path: str) -> Network:
    """The weights of a file, or, for "", those that come along."""
    if not path:
        return read_network(SHIPPED)
    file = Path(path)
    return read_network(file, file.stat().st_mtime if file.exists() else 0.0)
