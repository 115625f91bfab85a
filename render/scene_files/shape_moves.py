"""A shape of a still scene set in motion, about its own middle and by its own size.

    spin   once round in 96 frames, about the axis that is up
    swing  25 degrees to both sides in 48 frames, as a pendulum that hangs from the top of its box
    slide  to and fro by half of its width in 48 frames, along the longer side of its box

Each begins where the shape stands, and comes after the motion that it has.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from onespp.scenes.animation import Animation, compose, spin, swing
from onespp.scenes.description import Scene, SceneError, Shape
from onespp.scenes.transforms import translate

from .extent import bounds, upward

_ROUND, _PERIOD = 96, 48  # frames
_SWING = 25.0  # degrees


def with_shape_moves(scene: Scene, moves: Mapping[str, str]) -> Scene:
    """The scene with some of its shapes in motion.

    Args:
        moves: names of shapes -> one of `SHAPE_MOVES`.

    Raises:
        SceneError: no such shape, or no such move.
    """
    for name, kind in moves.items():
        if name not in scene.object_names:
            close = difflib.get_close_matches(name, scene.object_names, n=1)
            hint = f"did you mean '{close[0]}'?" if close else (
                f"there are {', '.join(scene.object_names[:8])}"
                + (", ..." if len(scene.object_names) > 8 else ""))
            raise SceneError(f"scene '{scene.name}' has no shape '{name}': {hint}")
        if kind not in SHAPE_MOVES:
            raise SceneError(f"there is no move '{kind}': use {', '.join(SHAPE_MOVES)}")
    up = upward(scene)
    return replace(scene, shapes=tuple(
        _moved(shape, moves[shape.name], up) if shape.name in moves else shape
        for shape in scene.shapes))


def _moved(shape: Shape, kind: str, up: np.ndarray) -> Shape:
    low, high = bounds(shape)
    return replace(shape, world_from_object=compose(
        SHAPE_MOVES[kind](low, high, up), shape.world_from_object))


def _spin(low: np.ndarray, high: np.ndarray, up: np.ndarray) -> Animation:
    return _about((low + high) / 2, spin(up, 360 / _ROUND))


def _swing(low: np.ndarray, high: np.ndarray, up: np.ndarray) -> Animation:
    top = (low + high) / 2 + abs(up) * (high - low) / 2 * np.sign(up.sum())
    return _about(top, swing(_along(low, high, up), _SWING, _PERIOD))


def _slide(low: np.ndarray, high: np.ndarray, up: np.ndarray) -> Animation:
    along = _along(low, high, up)
    reach = float(abs(along @ (high - low))) / 2
    return Animation(lambda frame: translate(
        along * reach * float(np.sin(2 * np.pi * frame / _PERIOD))))


def _along(low: np.ndarray, high: np.ndarray, up: np.ndarray) -> np.ndarray:
    """The longer of a box's two sides that are level, as an axis."""
    return np.eye(3)[int(np.argmax((high - low) * (up == 0)))]


def _about(point: np.ndarray, turn: Animation) -> Animation:
    return compose(translate(point), turn, translate(-point))


SHAPE_MOVES: dict[str, Callable[[np.ndarray, np.ndarray, np.ndarray], Animation]] = {
    "spin": _spin, "swing": _swing, "slide": _slide}
