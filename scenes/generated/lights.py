"""Lamps and skies. Powers are relative: `exposure.py` scales all of a scene's light at once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from onespp.scenes.animation import Animation
from onespp.scenes.description import Color, Disk, Motion, Rectangle, Shape, Sphere
from onespp.scenes.materials import diffuse
from onespp.scenes.transforms import Matrix, rotate, scale, translate

from .objects import Free
from .plan import Plan
from .skies import evening, overcast, sun
from .stages import Stage

CHANGES = ("moves", "color", "switched", "dimmed", "steady")
_WARM, _COLD = np.array((1.0, 0.8, 0.55)), np.array((0.75, 0.88, 1.0))
Curve = Callable[[float], np.ndarray]


@dataclass(frozen=True)
class Lamp:
    """A lamp of `power` (all of the light that it sends out), whose faces have `area`, m^2.

    curve: colour at a frame, (3,), mean luminance about 1 over time.
    """

    name: str
    geometry: Sphere | Disk | Rectangle
    place: Matrix | Motion
    area: float
    power: float
    curve: Curve | Color

    def power_at(self, frame: float) -> np.ndarray:
        """(3,) power by colour."""
        return self.power * np.asarray(self.curve(frame) if callable(self.curve) else self.curve)

    def at(self, frame: float) -> Matrix:
        """Its place."""
        return self.place(frame) if callable(self.place) else self.place

    def shape(self) -> Shape:
        """A black body that shines: radiance = power / (pi area)."""
        def radiance(frame: float) -> Color:
            r, g, b = (self.power_at(frame) / (math.pi * self.area)).tolist()
            return r, g, b

        return Shape(self.name, self.geometry, diffuse((0.0, 0.0, 0.0)), self.place,
                     radiance if callable(self.curve) else radiance(0))


@dataclass(frozen=True)
class Rig:
    """All the light of a scene; sky: a colour, an (h, w, 3) image, or None."""

    lamps: tuple[Lamp, ...]
    sky: Color | np.ndarray | None = None
    changes: tuple[str, ...] = field(default=())


def rig(draft: Plan, stage: Stage, free: Free) -> Rig:
    """The scene's light."""
    random = draft.random("lights")
    outdoors = draft.place != "indoors"
    match draft.light:
        case "panels":
            lamps = [_panel(random, stage, i, power) for i, power in enumerate(
                random.uniform(0.4, 1, int(random.integers(1, 4))))]
            return Rig(tuple(lamps))
        case "unequal":
            count = int(random.integers(9, 15))
            powers, sizes = 10 ** random.uniform(-1.7, 0, count), 10 ** random.uniform(
                -1.5, -0.5, count)
            return Rig(tuple(_hung(random, stage, i, float(p), float(s))
                             for i, (p, s) in enumerate(zip(powers, sizes))),
                       overcast(random, 0.02) if outdoors else None)
        case "close":
            lamps = _globes(random, free, int(random.integers(4, 7)), 0.05)
            lamps += _sconces(random, stage, int(random.integers(1, 4)))
            if outdoors:
                return Rig(tuple(lamps), overcast(random, 0.015))
            return Rig((*lamps, _panel(random, stage, 0, 0.25)))
        case "sun":
            few = int(random.integers(0, 2)) if draft.place == "open ground" else 2
            return Rig(tuple(_hung(random, stage, i, 1.0, 0.15) for i in range(few)),
                       sun(random, 0.25))
        case "overcast":
            return Rig((_hung(random, stage, 0, 0.6, 0.28),), overcast(random, 0.3))
        case "night":
            count = int(random.integers(3, 6))
            return Rig((*(_hung(random, stage, i, random.uniform(0.3, 1),
                                random.uniform(0.04, 0.2)) for i in range(count)),
                        *_globes(random, free, 1, 0.3)),
                       overcast(random, 0.006))
    count = int(random.integers(3, 6))
    lamps = [_changed(random, _hung(random, stage, i, random.uniform(0.5, 1),
                                    random.uniform(0.08, 0.35)),
                      CHANGES[(i + draft.number) % len(CHANGES)], draft.frames)
             for i in range(count)]
    lamps.append(_hung(random, stage, count, 0.5, 0.3))  # something stays on
    return Rig(tuple(lamps), evening(random, 0.03) if outdoors else None,
               tuple(CHANGES[(i + draft.number) % len(CHANGES)] for i in range(count)))


def _tint(random: np.random.Generator) -> Color:
    r, g, b = (_WARM + (_COLD - _WARM) * random.random()).tolist()
    return r, g, b


def _panel(random: np.random.Generator, stage: Stage, i: int, power: float) -> Lamp:
    """A rectangle under the ceiling that shines down."""
    half = random.uniform(0.25, 0.9), random.uniform(0.2, 0.6)
    x = (-1.9, 0.3, 2.2)[i % 3] + random.uniform(-0.2, 0.2)
    place = (translate((x, stage.height - 0.02, random.uniform(-1.2, 1.8))) @ rotate((1, 0, 0), 90)
             @ scale((*half, 1)))
    return Lamp(f"panel_{i}", Rectangle(), place, 4 * half[0] * half[1], power, _tint(random))


def _hung(random: np.random.Generator, stage: Stage, i: int, power: float, size: float) -> Lamp:
    """A lamp of radius `size` overhead: a globe, or a disk or square that faces the origin."""
    angle = random.uniform(0, 2 * math.pi)
    away, high = random.uniform(0.6, 2.6), random.uniform(2.1, stage.height - 0.3)
    position = np.array((away * math.cos(angle), high, max(away * math.sin(angle),
                                                               stage.back + 0.8)))
    size = min(size, 0.28)
    color = _tint(random)
    match random.integers(3):
        case 0:
            return Lamp(f"lamp_{i}", Sphere(), translate(position) @ scale(size),
                        4 * math.pi * size**2, power, color)
        case 1:
            return Lamp(f"lamp_{i}", Disk(), _toward_things(position) @ scale((size, size, 1)),
                        math.pi * size**2, power, color)
    return Lamp(f"lamp_{i}", Rectangle(), _toward_things(position) @ scale((size, size, 1)),
                4 * size**2, power, color)


def _toward_things(position: np.ndarray) -> Matrix:
    """A place whose +z faces (0, 0.4, 0)."""
    z = np.array((0, 0.4, 0)) - position
    z /= np.linalg.norm(z)
    x = np.cross((0.1, 1, 0.2), z)
    x /= np.linalg.norm(x)
    matrix = translate(position)
    matrix[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    return matrix


def _globes(random: np.random.Generator, free: Free, count: int, power: float) -> list[Lamp]:
    """Little globes just above the ground, between the things."""
    lamps = []
    for i in range(count):
        radius = random.uniform(0.03, 0.07)
        spot = free.spot(random, radius + 0.04)
        if spot is not None:
            place = translate((spot[0], radius + random.uniform(0.02, 0.2), spot[1]))
            lamps.append(Lamp(f"globe_{i}", Sphere(), place @ scale(radius),
                              4 * math.pi * radius**2, power * random.uniform(0.5, 1.5),
                              _tint(random)))
    return lamps


def _sconces(random: np.random.Generator, stage: Stage, count: int) -> list[Lamp]:
    """Little globes close to walls."""
    lamps = []
    for i in range(count if len(stage.walls) else 0):
        point, facing = stage.walls[int(random.integers(len(stage.walls)))]
        radius = random.uniform(0.03, 0.06)
        along = np.cross(facing, (0, 1, 0)) * random.uniform(-0.3, 0.3)
        place = translate(point + along + facing * (radius + random.uniform(0.08, 0.2)))
        lamps.append(Lamp(f"sconce_{i}", Sphere(), place @ scale(radius), 4 * math.pi * radius**2,
                          0.05, _tint(random)))
    return lamps


def _changed(random: np.random.Generator, lamp: Lamp, change: str, frames: int) -> Lamp:
    """The lamp with one of `CHANGES`; it is switched in the middle half of the frames."""
    color, period = np.asarray(lamp.curve), random.uniform(12, 30)
    phase, event = random.uniform(0, 2 * math.pi), int(
        random.integers(max(1, frames // 4), max(2, 3 * frames // 4)))
    curve, place = lamp.curve, lamp.place
    def wheel(frame: float) -> np.ndarray:
        turned = 2 * math.pi * (frame / period + np.arange(3) / 3) + phase
        return 0.8 + 0.65 * np.cos(turned)

    match change:
        case "moves":
            far = random.uniform(0.4, 0.9)
            place = Animation(lambda f: translate(
                (far * math.cos(2 * math.pi * f / period + phase), 0,
                 far * math.sin(2 * math.pi * f / period + phase))) @ lamp.at(0))
        case "color":
            curve = wheel
        case "switched":
            first = bool(random.random() < 0.5)
            curve = lambda f: color * (1.6 if (f < event) == first else 0.0)  # noqa: E731
        case "dimmed":
            curve = lambda f: color * (  # noqa: E731
                0.85 + 0.75 * math.sin(2 * math.pi * f / period + phase))
    return Lamp(f"{lamp.name}_{change}", lamp.geometry, place, lamp.area, lamp.power, curve)
