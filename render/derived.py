"""Channels that follow from others, so that files need not hold them (`--channels training`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType

import numpy as np

from .errors import InputError
from .frame import Frame


def color(frame: Frame) -> np.ndarray:
    """The sum of light by scattering events, in the renderer's order."""
    return frame["emission"] + frame["direct"] + frame["indirect"]


def position(frame: Frame) -> np.ndarray:
    """World space, from depth z: rows x, y and depth of screen_from_world map P to z (x, y, 1)."""
    rows = frame.screen_from_world[[0, 1, 3]]
    try:
        world_from_screen = np.linalg.inv(rows[:, :3])
    except np.linalg.LinAlgError:
        raise InputError(f"the matrices of frame {frame.index} do not project to a screen: "
                         "screen_from_world is singular") from None
    depth = frame["depth"].astype(np.float64)
    y, x = np.indices(depth.shape) + 0.5
    on_screen = np.stack([x, y, np.ones_like(depth)], axis=-1) * depth[..., None] - rows[:, 3]
    world = on_screen @ world_from_screen.T
    return np.where(depth[..., None] > 0, world, 0).astype(np.float32)


DERIVED: Mapping[str, tuple[tuple[str, ...], Callable[[Frame], np.ndarray]]] = MappingProxyType({
    "color": (("emission", "direct", "indirect"), color),
    "position": (("depth",), position),
})
"""Channel -> those that it follows from, and how."""


def available(stored: Iterable[str]) -> tuple[str, ...]:
    """The stored channels and, before them, those that follow from them."""
    stored = tuple(stored)
    return (*(name for name, (sources, _) in DERIVED.items()
              if name not in stored and set(sources) <= set(stored)), *stored)


def sources(names: Iterable[str], stored: Iterable[str]) -> tuple[str, ...]:
    """The stored channels that the named ones take."""
    stored = set(stored)
    return tuple(dict.fromkeys(source for name in names for source in (
        (name,) if name in stored else DERIVED[name][0])))


def with_derived(frame: Frame, names: Iterable[str]) -> Frame:
    """A frame of exactly the named channels, made of one that has their sources."""
    images = {name: frame[name] if name in frame else DERIVED[name][1](frame) for name in names}
    return Frame(frame.index, images, frame.camera_from_world, frame.screen_from_world,
                 frame.world_from_object)
