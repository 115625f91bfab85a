"""Where it happens: a closed room, open ground, or walls, roofs and pillars under the sky."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from onespp.scenes.description import Rectangle, Shape
from onespp.scenes.materials import diffuse
from onespp.scenes.meshes import box, lathe, merge, place, rounded_box
from onespp.scenes.transforms import Matrix, rotate, scale, translate

from . import surfaces
from .plan import Plan

HALF_WIDTH, BACK, FRONT, HEIGHT = 4.0, -2.6, 6.4, 3.1
X, Y = (1, 0, 0), (0, 1, 0)


@dataclass(frozen=True)
class Stage:
    """shapes: what does not move. closed: 1 in a room, 0 in the open: how much light comes back.

    walls: (n, 2, 3) points on walls and the way they face, which lamps and exposure need.
    sky: the share of the sky that is seen from the ground.
    back, height: of the back wall and the ceiling, where they are or would be, metres.
    """

    shapes: tuple[Shape, ...]
    closed: float
    sky: float
    walls: np.ndarray
    back: float = BACK
    height: float = HEIGHT


def stage(draft: Plan) -> Stage:
    """The scene's surroundings."""
    random = draft.random("stage")
    half = {"indoors": 6.5, "open ground": 18.0, "half open": 9.0}[draft.place]
    floor = Shape("floor", Rectangle(), surfaces.ground(random, draft.ground, half,
                                                        draft.lamps_are_found),
                  rotate(X, -90) @ scale((half, half, 1)))
    return {"indoors": _room, "open ground": _ground, "half open": court}[draft.place](
        draft, random, floor)


def _wall(name: str, draft: Plan, random: np.random.Generator, matrix: Matrix) -> Shape:
    return Shape(name, Rectangle(), surfaces.wall(random, draft.wall), matrix)


def _back(width: float = HALF_WIDTH) -> Matrix:
    return translate((0, HEIGHT / 2, BACK)) @ scale((width, HEIGHT / 2, 1))


def _side(x: float) -> Matrix:
    middle, half = (BACK + FRONT) / 2, (FRONT - BACK) / 2
    return (translate((x, HEIGHT / 2, middle)) @ rotate(Y, -90 if x > 0 else 90)
            @ scale((half, HEIGHT / 2, 1)))


_BACK_POINTS = [[(x, y, BACK), (0, 0, 1)] for x in (-2.0, -0.7, 0.7, 2.0) for y in (0.6, 1.6)]
_LEFT_POINTS = [[(-HALF_WIDTH, y, z), (1, 0, 0)] for z in (-1.5, 0.0) for y in (0.6, 1.6)]
_RIGHT_POINTS = [[(HALF_WIDTH, y, z), (-1, 0, 0)] for z in (-1.5, 0.0) for y in (0.6, 1.6)]


def _room(draft: Plan, random: np.random.Generator, floor: Shape) -> Stage:
    middle, half = (BACK + FRONT) / 2, (FRONT - BACK) / 2
    color = draft.colors[int(random.integers(len(draft.colors)))]
    skirting = merge(place(box((2 * HALF_WIDTH, 0.12, 0.04)), translate((0, 0.06, BACK + 0.02))),
                     place(box((0.04, 0.12, FRONT - BACK)),
                           translate((0.02 - HALF_WIDTH, 0.06, middle))),
                     place(box((0.04, 0.12, FRONT - BACK)),
                           translate((HALF_WIDTH - 0.02, 0.06, middle))))
    side = surfaces.wall(random, color)
    shapes = [floor, _wall("wall_back", draft, random, _back()),
              Shape("wall_left", Rectangle(), side, _side(-HALF_WIDTH)),
              _wall("wall_right", draft, random, _side(HALF_WIDTH)),
              Shape("wall_front", Rectangle(), diffuse(draft.wall),
                    translate((0, HEIGHT / 2, FRONT)) @ rotate(Y, 180)
                    @ scale((HALF_WIDTH, HEIGHT / 2, 1))),
              Shape("ceiling", Rectangle(), diffuse((0.75, 0.74, 0.72)),
                    translate((0, HEIGHT, middle)) @ rotate(X, 90)
                    @ scale((HALF_WIDTH, half, 1))),
              Shape("skirting", skirting, diffuse((0.7, 0.68, 0.64)))]
    for i, x in enumerate(random.permutation((-1.9, -0.4, 1.2))[:random.integers(1, 4)]):
        width, height = random.uniform(0.35, 0.6), random.uniform(0.35, 0.5)
        kind = ("checks", "grain", "wood", "varnish")[random.integers(4)]
        shapes.append(Shape(f"picture_{i}", box((2 * width, 2 * height, 0.05)), surfaces.surface(
            random, kind, draft.colors[(i + 1) % len(draft.colors)], False),
            translate((x, 1.75, BACK + 0.03))))
    return Stage(tuple(shapes), 1.0, 0.0, np.array(_BACK_POINTS + _LEFT_POINTS + _RIGHT_POINTS))


def _ground(draft: Plan, random: np.random.Generator, floor: Shape) -> Stage:
    shapes = [floor]
    for i in range(int(random.integers(3, 7))):  # stones that stand far behind
        width, height = random.uniform(0.5, 1.4), random.uniform(0.8, 3.2)
        x, z = random.uniform(-6, 6), random.uniform(-7, -3.4)
        shapes.append(Shape(f"stone_{i}", rounded_box((width, height, width), 0.12),
                            surfaces.surface(random, ("plain", "grain", "varnish")[i % 3],
                                             draft.colors[i % len(draft.colors)], False),
                            translate((x, height / 2 - 0.01, z))
                            @ rotate(Y, random.uniform(0, 90))))
    return Stage(tuple(shapes), 0.0, 1.0, np.empty((0, 2, 3)))


def court(draft: Plan, random: np.random.Generator, floor: Shape,
          kind: str | None = None) -> Stage:
    """Walls or a roof on columns under the sky; kind: corner, hall or columns, None: drawn."""
    shapes, points, sky = [floor], [], 0.8
    stone = surfaces.wall(random, draft.wall)
    column = lathe([(0, 0), (0.24, 0), (0.24, 0), (0.24, 0.15), (0.24, 0.15), (0.17, 0.18),
                    (0.14, HEIGHT)], 32)
    drawn = ("corner", "hall", "columns")[random.integers(3)]
    kind = kind or drawn
    if kind != "columns":
        shapes.append(_wall("wall_back", draft, random, _back()))
        points += _BACK_POINTS
    if kind == "corner":
        left = bool(random.random() < 0.5)
        shapes.append(_wall("wall_side", draft, random, _side(-HALF_WIDTH if left
                                                              else HALF_WIDTH)))
        points += _LEFT_POINTS if left else _RIGHT_POINTS
        sky = 0.5
    else:
        row = [place(column, translate((x, 0, -2.2))) for x in (-3, -1.8, -0.6, 0.6, 1.8, 3)]
        deep = 2.4 if kind == "hall" else 0.5
        shapes += [Shape("columns", merge(*row), stone),
                   Shape("roof", box((2 * HALF_WIDTH, 0.25, deep)), stone,
                         translate((0, HEIGHT + 0.12, -2.2)))]
    return Stage(tuple(shapes), 0.4, sky, np.array(points).reshape(-1, 2, 3))
