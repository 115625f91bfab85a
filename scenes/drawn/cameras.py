"""Cameras about 5 m from the things: still, around them, ahead or aside, held by hand, and cut."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from onespp.scenes.animation import Animation, compose
from onespp.scenes.cameras import dolly, orbit
from onespp.scenes.description import Camera
from onespp.scenes.generated.plan import Plan
from onespp.scenes.generated.stages import Stage
from onespp.scenes.generated.views import shaken

_MOST_TURN, _MOST_TRAVEL = 24.0, 0.9  # degrees and metres, in the whole sequence


@dataclass(frozen=True)
class View:
    """Where a camera begins: it circles `target` at `radius` metres, by angles in degrees."""

    target: tuple[float, float, float]
    radius: float
    azimuth: float
    elevation: float

    def place(self) -> np.ndarray:
        return orbit(self.target, self.radius, {0: self.azimuth}, self.elevation)(0)


def camera_of(draft: Plan, stage: Stage, family: str, move: str, speed: float) -> Camera:
    """The scene's camera; moves are a half to one and a half times `speed` of usual ones."""
    random = draft.random("camera")
    fov = random.uniform(34, 48)
    if move != "cut":
        return Camera(_moved(random, _view(random, stage, family), move, speed, draft.frames), fov)
    at = int(random.integers(max(1, draft.frames // 4), max(2, 3 * draft.frames // 4)))
    before, after = (_moved(random, _view(random, stage, family), str(random.choice(
        ["orbit", "dolly", "still"])), speed, draft.frames) for _ in range(2))
    return Camera(Animation(lambda frame: compose(before if frame < at else after)(frame)), fov)


def _view(random: np.random.Generator, stage: Stage, family: str) -> View:
    radius = random.uniform(3.9, 5.1)
    around = 100.0 if family == "ground" else 28.0  # in rooms, between the walls
    highest = math.degrees(math.asin(min(0.5, (stage.height - 1.1) / radius)))
    elevation = random.uniform(5, min(30, highest))
    target = (random.uniform(-0.2, 0.2), random.uniform(0.4, 0.7), -0.2)
    return View(target, radius, random.uniform(-around, around) if random.random() < 0.7
                else random.uniform(-12, 12), elevation)


def _moved(random: np.random.Generator, view: View, move: str, speed: float,
           frames: int) -> np.ndarray | Animation:
    way = float(random.choice((-1, 1)))
    pace = speed * random.uniform(0.5, 1.5)
    end = max(frames, 2) - 1
    if move == "orbit":
        turn = way * min(1.1 * pace * end, _MOST_TURN) / 2
        return orbit(view.target, view.radius, {0: view.azimuth - turn, end: view.azimuth + turn},
                     view.elevation, "linear")
    if move == "dolly":
        direction = (0, 0, 1) if random.random() < 0.5 else (way, 0, 0)
        return dolly(view.place(), {0: -0.1, end: min(0.04 * pace * end, _MOST_TRAVEL) - 0.1},
                     direction, "linear")
    if move == "handheld":
        held = shaken(random, view.place()[:3, 3], np.asarray(view.target))
        return Animation(lambda frame: held(pace * frame))
    return view.place()
