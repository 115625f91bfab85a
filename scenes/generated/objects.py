"""Things that stand, lie and fly about: what they are, where, of what, and how they move."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from onespp.scenes.animation import compose
from onespp.scenes.description import Mesh, Shape, Sphere
from onespp.scenes.meshes import (
    box,
    ellipsoid,
    lathe,
    merge,
    place,
    rounded_box,
    surface,
    torus,
)
from onespp.scenes.transforms import Matrix, rotate, scale, translate

from . import motions, surfaces
from .plan import Plan

KINDS = ("crate", "ball", "vase", "ring", "block", "goblet", "sheet", "stack", "egg", "hoop")
CLOSED = ("ball", "egg", "ring", "hoop", "vase")  # what may be of glass
HALF_X, HALF_Z = 2.3, 1.7
_GAP, _TRIES = 0.06, 300


@dataclass(frozen=True)
class Body:
    """A geometry with the matrix that stands it on y = 0; radius: of its footprint."""

    geometry: Mesh | Sphere
    stand: Matrix
    radius: float


@dataclass
class Free:
    """The ground that is taken: rows of (x, z, radius)."""

    taken: list[tuple[float, float, float]]

    def spot(self, random: np.random.Generator, radius: float) -> tuple[float, float] | None:
        """A place for a disk, further back for larger ones; None where none was found."""
        for _ in range(_TRIES):
            x = random.uniform(-HALF_X, HALF_X)
            z = random.uniform(-HALF_Z, HALF_Z * (1 if radius < 0.35 else 0.3))
            if all(math.hypot(x - a, z - b) > radius + r + _GAP for a, b, r in self.taken):
                self.taken.append((x, z, radius))
                return x, z
        return None


def things(draft: Plan) -> tuple[list[Shape], Free]:
    """The scene's things, and the ground that they take, motions included."""
    random = draft.random("things")
    count = int(random.integers(8, 13))
    bodies = [KINDS[i % len(KINDS)] for i in random.permutation(len(KINDS))]
    moves = [motions.KINDS[i] for i in random.permutation(len(motions.KINDS))]
    materials = surfaces.kinds(random, count, draft.lamps_are_found)
    free, shapes = Free([]), []
    for i in range(count):
        kind = bodies[i % len(bodies)]
        move = moves[i] if i < len(moves) else "still" if i % 2 else "spin"
        if materials[i] == "glass" and kind not in CLOSED:
            kind = "ball"
        small = move in ("spline", "bounce", "slide", "stop and go")
        made = body(random, kind, random.uniform(0.6, 0.8) if small else random.uniform(0.8, 1.25))
        color = draft.colors[i % len(draft.colors)]
        material = surfaces.surface(random, materials[i], color, draft.lamps_are_found)
        far = motions.reach(random, move)
        motion = motions.motion(random, move, far)
        stand = rotate((0, 1, 0), random.uniform(0, 360)) @ made.stand
        if move == "spline":
            shapes.append(Shape(f"{kind}_{i}", made.geometry, material, compose(
                motion, scale(0.7) @ stand)))  # type: ignore[arg-type]  # a spline is a motion
            continue
        spot = free.spot(random, made.radius + far)
        if spot is not None:
            there = translate((spot[0], 0, spot[1]))
            shapes.append(Shape(f"{kind}_{i}", made.geometry, material,
                                there @ stand if motion is None
                                else compose(there, motion, stand)))
    return shapes, free


def body(random: np.random.Generator, kind: str, size: float) -> Body:
    """A thing of a kind, less than 1.3 times `size` high."""
    width, height = random.uniform(0.3, 0.5) * size, random.uniform(0.35, 1.0) * size
    match kind:
        case "crate":
            return _standing(box((width, height, width)), height, 0.71 * width)
        case "block":
            mesh = rounded_box((1.2 * width, height, 0.9 * width), 0.15 * width)
            return _standing(mesh, height, 0.75 * width)
        case "ball":
            return Body(Sphere(), translate((0, 0.7 * width, 0)) @ scale(0.7 * width), 0.7 * width)
        case "egg":
            return _standing(ellipsoid((0.5 * width, 0.5 * height, 0.5 * width)), height,
                             0.5 * width)
        case "ring":
            return _standing(torus(0.6 * width, 0.22 * width), 0.44 * width, 0.82 * width)
        case "hoop":
            upright = place(torus(0.7 * width, 0.14 * width), rotate((1, 0, 0), 90))
            return _standing(upright, 1.68 * width, 0.84 * width)
        case "vase":  # inside and outside, so that it may be of glass
            neck = random.uniform(0.2, 0.35)
            out = [(0, 0), (0.3, 0), (0.3, 0), (0.48, 0.3), (0.42, 0.6), (neck, 0.8), (0.3, 1)]
            inside = [(r - 0.04, max(y, 0.05)) for r, y in out[:2:-1]] + [(0, 0.05)]
            profile = np.array([*out, out[-1], *inside]) * (width / 0.5, height)
            return _standing(place(lathe(profile), translate((0, -height / 2, 0))), height, width)
        case "goblet":
            profile = np.array([(0, 0), (0.32, 0), (0.32, 0.02), (0.06, 0.1), (0.05, 0.45),
                                (0.3, 0.6), (0.36, 1.0), (0.33, 1.0), (0.27, 0.62), (0, 0.5)])
            mesh = lathe(profile * (width / 0.5, height))
            return _standing(place(mesh, translate((0, -height / 2, 0))), height, 0.75 * width)
        case "sheet":
            u, v = np.meshgrid(np.linspace(-1, 1, 33), np.linspace(0, 1, 17))
            wave = 0.12 * width * np.sin(random.uniform(4, 8) * u + 2 * v)
            points = np.stack([1.1 * width * u, height * v - height / 2, wave], axis=2)
            return _standing(surface(points), height, 1.15 * width)
    parts, top, side = [], 0.0, width
    for _ in range(3):  # a stack
        tall = 0.33 * height
        parts.append(place(box((side, tall, side)), translate((0, top + tall / 2 - height / 2, 0))
                           @ rotate((0, 1, 0), random.uniform(0, 90))))
        top, side = top + tall, 0.72 * side
    return _standing(merge(*parts), height, 0.71 * width)


def _standing(mesh: Mesh, height: float, radius: float) -> Body:
    """A mesh that is centred in height."""
    return Body(mesh, translate((0, height / 2 + 0.001, 0)), radius)
