"""How bright all the lights of a scene have to be, by an estimate that renders nothing.

At points on the ground, on walls and on things that face the camera, the irradiance E of every lamp
as if it were a point and nothing were in its way, and of the sky; in rooms also of what walls throw
back, Phi rho / (A (1 - rho)), Phi the power of all lamps, A the area of the walls, rho = 0.5. A
surface of albedo rho then has radiance rho E / pi. One factor for all lights makes the mean of the
displayed values at these points `DISPLAYED`, over the frames.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from onespp.scenes.description import Sphere

from .lights import Lamp, Rig
from .skies import irradiance
from .stages import Stage

DISPLAYED = 0.52  # of white, gamma 2.2
ALBEDO = 0.45
_ROOM_AREA = 250.0  # m^2
_LUMINANCE = np.array((0.2126, 0.7152, 0.0722))


def exposed(rig: Rig, stage: Stage, frames: int, stops: float = 0.0) -> Rig:
    """The rig with its light scaled; stops: by so many factors of 2 more."""
    factor = _factor(_radiance(rig, stage, frames)) * 2**stops
    sky = rig.sky
    if isinstance(sky, tuple):
        r, g, b = (factor * np.asarray(sky)).tolist()
        sky = (r, g, b)
    elif sky is not None:
        sky = factor * sky
    return replace(rig, lamps=tuple(replace(lamp, power=factor * lamp.power)
                                    for lamp in rig.lamps), sky=sky)


def _factor(radiance: np.ndarray) -> float:
    """The factor that makes the mean of the displayed values what it should be, by halving."""
    low, high = 1e-6, 1e6
    for _ in range(60):
        middle = math.sqrt(low * high)
        shown = np.minimum(middle * radiance, 1) ** (1 / 2.2)
        low, high = (middle, high) if shown.mean() < DISPLAYED else (low, middle)
    return math.sqrt(low * high)


def _radiance(rig: Rig, stage: Stage, frames: int) -> np.ndarray:
    """(n,) luminance that leaves the points, all frames together."""
    points, normals = _points(stage)
    around = stage.sky * irradiance(rig.sky, normals) @ _LUMINANCE
    total = []
    for frame in range(0, frames, 3):
        light = around.copy()
        for lamp in rig.lamps:
            power = float(lamp.power_at(frame) @ _LUMINANCE)
            light += power * _per_power(lamp, frame, points, normals)
            light += stage.closed * power * ALBEDO / (_ROOM_AREA * (1 - ALBEDO))
        total.append(light)
    return ALBEDO / math.pi * np.concatenate(total)


def _points(stage: Stage) -> tuple[np.ndarray, np.ndarray]:
    x, z = np.meshgrid(np.linspace(-2.4, 2.4, 7), np.linspace(-2.2, 2.2, 5))
    floor = np.stack([x.ravel(), 0 * x.ravel(), z.ravel()], axis=1)
    faces = np.stack([x.ravel(), 0.4 + 0 * x.ravel(), z.ravel()], axis=1)
    front = np.array((0, 0.45, 0.89))
    normals = [np.tile((0.0, 1.0, 0.0), (len(floor), 1)), np.tile(front, (len(faces), 1)),
               stage.walls[:, 1]]
    return np.concatenate([floor, faces, stage.walls[:, 0]]), np.concatenate(normals)


def _per_power(lamp: Lamp, frame: float, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(n,) irradiance for a power of 1, of a point where the lamp is."""
    place = lamp.at(frame)
    way = place[:3, 3] - points
    squared = np.maximum((way**2).sum(axis=1), 0.01)
    way = way / np.sqrt(squared)[:, None]
    received = np.maximum((way * normals).sum(axis=1), 0) / squared
    if isinstance(lamp.geometry, Sphere):
        return received / (4 * math.pi)
    axis = place[:3, 2] / np.linalg.norm(place[:3, 2])
    return received * np.maximum(-way @ axis, 0) / math.pi
