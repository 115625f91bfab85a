"""Cameras about 5 m from the origin, outside of everything."""

from __future__ import annotations

import math

import numpy as np

from onespp.scenes.animation import Animation
from onespp.scenes.cameras import dolly, orbit
from onespp.scenes.description import Camera
from onespp.scenes.transforms import look_at, rotate

from .plan import Plan

NEAREST = 3.6  # metres from the origin, along the ground


def camera(draft: Plan) -> Camera:
    """The scene's camera."""
    random = draft.random("camera")
    target = (random.uniform(-0.2, 0.2), random.uniform(0.45, 0.7), -0.2)
    radius, azimuth = random.uniform(4.5, 5.1), random.uniform(-22, 22)
    elevation, fov = random.uniform(9, 19), random.uniform(34, 40)
    way = float(random.choice((-1, 1)))
    if draft.camera == "orbit":
        turn = way * random.uniform(0.7, 1.6)
        return Camera(orbit(target, radius, {0: azimuth - 10 * turn, 20: azimuth + 10 * turn},
                            elevation, "linear"), fov)
    place = orbit(target, radius, {0: azimuth}, elevation)(0)
    if draft.camera == "dolly":
        ahead = bool(random.random() < 0.5)
        direction = (0, 0, 1) if ahead else (way, 0, 0)
        return Camera(dolly(place, {0: -0.1, 20: random.uniform(0.5, 0.8)}, direction, "linear"),
                      fov)
    if draft.camera == "handheld":
        return Camera(shaken(random, place[:3, 3], np.asarray(target)), fov)
    return Camera(place, fov)


def shaken(random: np.random.Generator, origin: np.ndarray, target: np.ndarray) -> Animation:
    """Breath and tremor: sums of sines of 7 to 40 frames, in place, aim and roll."""
    periods, phases = random.uniform(7, 40, (7, 3)), random.uniform(0, 2 * math.pi, (7, 3))

    def matrix_at(frame: float) -> np.ndarray:
        wave = np.sin(2 * math.pi * frame / periods + phases).sum(axis=1) / 3
        return (look_at(origin + 0.06 * wave[:3], target + 0.09 * wave[3:6])
                @ rotate((0, 0, 1), 0.9 * wave[6]))

    return Animation(matrix_at)
