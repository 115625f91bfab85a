"""How things move. A motion is (how far from its place it takes a thing, the matrices)."""

from __future__ import annotations

import math

import numpy as np

from onespp.scenes.animation import Animation, compose, rotation, spin, translation
from onespp.scenes.transforms import translate

Y = (0, 1, 0)
KINDS = ("still", "spin", "slide", "stop and go", "bounce", "spline")


def reach(random: np.random.Generator, kind: str) -> float:
    """How far a motion may go from its middle, along the ground."""
    return float(random.uniform(0.25, 0.6)) if kind in ("slide", "stop and go") else 0.0


def motion(random: np.random.Generator, kind: str, far: float) -> Animation | None:
    """Matrices about the thing's place, of which none leads further than `far`; None: it is still.

    A spline flies high above what stands on the ground, within 2 m of the origin.
    """
    angle, start = random.uniform(0, 2 * math.pi), int(random.integers(0, 8))
    way = far * np.array([math.cos(angle), 0, math.sin(angle)])
    turn = float(random.choice((-1, 1)) * random.uniform(2, 9))
    match kind:
        case "spin":
            return spin(Y, turn)
        case "slide":
            period = int(random.integers(8, 18))
            return translation({-start: -way, period - start: way, 2 * period - start: -way},
                               "linear", loop=True)
        case "stop and go":
            go, stop = int(random.integers(3, 6)), int(random.integers(3, 6))
            frames = np.cumsum([-start, stop, go, stop, go]).tolist()
            there = translation(dict(zip(frames, (-way, -way, way, way, -way))), "smooth",
                                loop=True)
            return compose(there, rotation(Y, dict(zip(frames, (0, 0, 90, 90, 0))), "smooth",
                                           loop=True))
        case "bounce":
            high, period = random.uniform(0.3, 0.7), random.uniform(7, 14)
            return compose(Animation(lambda f: translate(
                (0, high * abs(math.sin(math.pi * (f + start) / period)), 0))), spin(Y, turn))
        case "spline":
            around = angle + 2 * math.pi * (np.arange(5) + random.uniform(-0.3, 0.3, 5)) / 5
            points = [(1.7 * math.cos(a), random.uniform(1.5, 2.0), 1.1 * math.sin(a))
                      for a in around]
            frames = (np.arange(6) * int(random.integers(8, 14)) - start).tolist()
            return compose(translation(dict(zip(frames, (*points, points[0]))), "spline",
                                       loop=True), spin((1, 2, 0.5), turn))
    return None
