"""A still camera set in motion, as far as there is room for it.

Symbols: d, distance of what the camera sees; P = 96 frames, the period of a move; a, its size,
which begins at the one in the table and is halved until the path is free.

    orbit     about the point that the camera looks at: up to 20 degrees to both sides
    dolly     forward and back along the view: up to d / 4
    handheld  breath and tremor: d / 60 in place, 0.7 degrees in aim and roll

Each begins at the camera's own place (handheld: near it) and is a function of the frame's number
alone. A path is free if it passes through no surface and stays as far from all of them as d / 40,
or as half of what the camera has around it where it stands. Surfaces are where frame 0 has them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Protocol

import numpy as np

from onespp.scenes.animation import Animation
from onespp.scenes.description import Scene, SceneError
from onespp.scenes.transforms import Matrix, rotate, translate

from .extent import Surroundings, upward

PERIOD = 96
_HALVINGS = 6
_MARGIN = 1 / 40  # of d
_ORBIT, _DOLLY = 20.0, 0.25  # degrees; of d
_SHAKE, _TREMOR = 1 / 60, 0.7  # of d; degrees
_PERIODS = np.array([37.0, 29, 23, 31, 19, 27])  # frames, of six axes: they meet again after years
_PHASES = np.array([0.0, 2, 4, 1, 3, 5])


class Move(Protocol):
    """Where the camera is in a frame, at a size from 0 to 1."""

    def __call__(self, frame: float, size: float) -> Matrix: ...


def with_camera_move(scene: Scene, kind: str) -> Scene:
    """The scene with its camera in motion.

    Args:
        kind: one of `CAMERA_MOVES`.

    Raises:
        SceneError: no such move, the camera moves already, or it has no room.
    """
    if kind not in CAMERA_MOVES:
        raise SceneError(f"there is no camera move '{kind}': use {', '.join(CAMERA_MOVES)}")
    if kind == "still":
        return replace(scene, camera=replace(
            scene.camera, world_from_camera=scene.camera.world_from_camera_at(0)))
    if scene.camera.moves:
        raise SceneError(f"the camera of scene '{scene.name}' moves already: leave the {kind} out")
    around = Surroundings(scene)
    distance = around.focus_distance()
    start = scene.camera.world_from_camera_at(0)
    move = CAMERA_MOVES[kind](start, distance, upward(scene))
    margin = min(_MARGIN * distance, around.room_at(start[:3, 3]) / 2)
    frames = np.arange(0, max(PERIOD, scene.frames) + 0.5, 0.5)
    for halving in range(_HALVINGS):
        size = 0.5**halving
        path = np.array([move(frame, size=size)[:3, 3] for frame in frames.tolist()])
        if around.is_free(np.concatenate([start[None, :3, 3], path]), margin):
            placed = Animation(partial(move, size=size))
            return replace(scene, camera=replace(scene.camera, world_from_camera=placed))
    raise SceneError(f"the camera of scene '{scene.name}' has no room for the move '{kind}': use "
                     "another, or still")


def _orbit(start: Matrix, distance: float, up: np.ndarray) -> Move:
    focus = start[:3, 3] + distance * start[:3, 2]
    return lambda frame, size: (
        translate(focus) @ rotate(up, size * _ORBIT * _wave(frame)) @ translate(-focus) @ start)


def _dolly(start: Matrix, distance: float, up: np.ndarray) -> Move:
    return lambda frame, size: (
        start @ translate((0, 0, size * _DOLLY * distance * _wave(frame))))


def _handheld(start: Matrix, distance: float, up: np.ndarray) -> Move:
    def placed(frame: float, size: float) -> Matrix:
        waves = size * np.sin(2 * np.pi * frame / _PERIODS + _PHASES)
        turn = np.eye(4)
        for axis, angle in zip(np.eye(3), _TREMOR * waves[3:]):
            turn = turn @ rotate(axis, float(angle))
        return start @ translate(_SHAKE * distance * waves[:3]) @ turn

    return placed


def _wave(frame: float) -> float:
    return float(np.sin(2 * np.pi * frame / PERIOD))


CAMERA_MOVES: dict[str, Callable[[Matrix, float, np.ndarray], Move]] = {
    "still": lambda start, distance, up: lambda frame, size: start,
    "orbit": _orbit, "dolly": _dolly, "handheld": _handheld}
