"""Where it happens: rooms of drawn sizes, with or without a window, open ground, and courts."""

from __future__ import annotations

import numpy as np

from onespp.scenes.description import Mesh, Rectangle, Shape
from onespp.scenes.generated import stages, surfaces
from onespp.scenes.generated.plan import Plan
from onespp.scenes.generated.stages import Stage
from onespp.scenes.materials import diffuse
from onespp.scenes.meshes import box, lathe, merge, place, rounded_box
from onespp.scenes.transforms import rotate, scale, translate

FRONT = 6.4
X, Y = (1, 0, 0), (0, 1, 0)
PLACE_OF = {"room": "indoors", "window": "half open", "ground": "open ground",
            **dict.fromkeys(("corner", "hall", "columns"), "half open")}
"""Family -> the place that it counts as for lamps and skies (`generated/plan.py`)."""


def stage_of(draft: Plan, family: str) -> Stage:
    """The surroundings of a scene."""
    random = draft.random("stage")
    if family in ("room", "window"):
        return _room(draft, random, family == "window")
    half = 18.0 if family == "ground" else 9.0
    floor = Shape("floor", Rectangle(), surfaces.ground(random, draft.ground, half,
                                                        draft.lamps_are_found),
                  rotate(X, -90) @ scale((half, half, 1)))
    if family == "ground":
        return _ground(draft, random, floor)
    return stages.court(draft, random, floor, family)


def _room(draft: Plan, random: np.random.Generator, window: bool) -> Stage:
    half, back = random.uniform(3.3, 4.6), -random.uniform(2.6, 3.8)
    height = random.uniform(2.7, 3.8)
    middle, deep = (back + FRONT) / 2, (FRONT - back) / 2
    side_color = draft.colors[int(random.integers(len(draft.colors)))]
    walls = surfaces.wall(random, draft.wall)
    sides = surfaces.wall(random, side_color)
    floor = surfaces.ground(random, draft.ground, 6.5, draft.lamps_are_found)
    shapes = [
        Shape("floor", Rectangle(), floor, rotate(X, -90) @ scale((6.5, 6.5, 1))),
        Shape("wall_front", Rectangle(), diffuse(draft.wall),
              translate((0, height / 2, FRONT)) @ rotate(Y, 180) @ scale((half, height / 2, 1))),
        Shape("ceiling", Rectangle(), diffuse((0.75, 0.74, 0.72)),
              translate((0, height, middle)) @ rotate(X, 90) @ scale((half, deep, 1))),
        Shape("wall_left", Rectangle(), sides, translate((-half, height / 2, middle))
              @ rotate(Y, 90) @ scale((deep, height / 2, 1)))]
    right = translate((half, height / 2, middle)) @ rotate(Y, -90)
    across = translate((0, height / 2, back))
    if window:  # in the wall at the right or at the back
        at_back = bool(random.random() < 0.4)
        opening = _wall_with_window(random, half if at_back else deep, height, at_back, back)
        shapes.append(Shape("wall_window", opening, walls, across if at_back else right))
    if not window or not at_back:
        shapes.append(Shape("wall_back", Rectangle(), walls, across @ scale((half, height / 2, 1))))
    if not window or at_back:
        shapes.append(Shape("wall_right", Rectangle(), walls, right @ scale((deep, height / 2, 1))))
    skirting = merge(place(box((2 * half, 0.12, 0.04)), translate((0, 0.06, back + 0.02))),
                     place(box((0.04, 0.12, 2 * deep)), translate((0.02 - half, 0.06, middle))),
                     place(box((0.04, 0.12, 2 * deep)), translate((half - 0.02, 0.06, middle))))
    shapes.append(Shape("skirting", skirting, diffuse((0.7, 0.68, 0.64))))
    if not window or not at_back:
        shapes += _pictures(draft, random, back)
    if random.random() < 0.5:
        shapes.append(_carpet(draft, random))
    points = [[(x, y, back), (0, 0, 1)] for x in (-2.0, -0.7, 0.7, 2.0) for y in (0.6, 1.6)]
    points += [[(-half, y, z), (1, 0, 0)] for z in (-1.5, 0.0) for y in (0.6, 1.6)]
    return Stage(tuple(shapes), 0.6 if window else 1.0, 0.12 if window else 0.0, np.array(points),
                 back, height)


def _wall_with_window(random: np.random.Generator, half: float, height: float, at_back: bool,
                      back: float) -> Mesh:
    """A wall in the xy plane, 2 half wide, of four boxes about a hole, and a bar in it."""
    wide, tall = random.uniform(0.9, 1.6), random.uniform(0.6, 0.9)
    # Beside the things: the wall at the right begins (x = -half) at the front, ends at the back.
    at = random.uniform(-0.8, 0.8) if at_back else half - random.uniform(1.8, 3.0)
    up, thick = random.uniform(-0.1, 0.25), 0.12
    left, right, below, above = at - wide, at + wide, up - tall, up + tall
    right = min(right, half - 0.2)
    parts = ((-half, left, -height / 2, height / 2), (right, half, -height / 2, height / 2),
             (left, right, -height / 2, below), (left, right, above, height / 2),
             (at - 0.03, at + 0.03, below, above))
    return merge(*(place(box((b - a, d - c, thick)),
                         translate(((a + b) / 2, (c + d) / 2, -thick / 2)))
                   for a, b, c, d in parts))


def _pictures(draft: Plan, random: np.random.Generator, back: float) -> list[Shape]:
    shapes = []
    for i, x in enumerate(random.permutation((-1.9, -0.4, 1.2))[:random.integers(0, 4)]):
        width, height = random.uniform(0.35, 0.6), random.uniform(0.35, 0.5)
        kind = ("checks", "grain", "wood", "varnish")[random.integers(4)]
        shapes.append(Shape(f"picture_{i}", box((2 * width, 2 * height, 0.05)), surfaces.surface(
            random, kind, draft.colors[(i + 1) % len(draft.colors)], False),
            translate((x, random.uniform(1.5, 1.8), back + 0.03))))
    return shapes


def _carpet(draft: Plan, random: np.random.Generator) -> Shape:
    """Thin, under the things, which stand a millimetre above the floor: it is flatter than that."""
    color = draft.colors[int(random.integers(len(draft.colors)))]
    kind = ("weave", "checks", "plain")[random.integers(3)]
    half = random.uniform(1.2, 2.4), random.uniform(0.9, 1.5)
    return Shape("floor_carpet", Rectangle(), surfaces.surface(random, kind, color, False),
                 translate((random.uniform(-0.5, 0.5), 0.0008, 0)) @ rotate(Y, random.uniform(
                     -12, 12)) @ rotate(X, -90) @ scale((*half, 1)))


def _ground(draft: Plan, random: np.random.Generator, floor: Shape) -> Stage:
    """Stones, trees or a wall of slabs that stand behind the things."""
    kind = ("stones", "trees", "slabs")[random.integers(3)]
    shapes = [floor]
    count = int(random.integers(4, 9))
    for i in range(count):
        color = draft.colors[i % len(draft.colors)]
        x, z = random.uniform(-6, 6), random.uniform(-7, -3.4)
        material = surfaces.surface(random, ("plain", "grain", "varnish")[i % 3], color, False)
        if kind == "trees":
            shapes.append(Shape(f"stone_{i}", _tree(random), material, translate((x, 0, z))))
            continue
        width, height = random.uniform(0.5, 1.4), random.uniform(0.8, 3.2)
        deep = 0.3 if kind == "slabs" else width
        shapes.append(Shape(f"stone_{i}", rounded_box((width, height, deep), 0.12), material,
                            translate((x, height / 2 - 0.01, z))
                            @ rotate(Y, random.uniform(0, 90) if kind == "stones"
                                     else random.uniform(-25, 25))))
    return Stage(tuple(shapes), 0.0, 1.0, np.empty((0, 2, 3)))


def _tree(random: np.random.Generator) -> Mesh:
    """A trunk under a cone or a ball of leaves."""
    trunk, tall, wide = random.uniform(0.3, 0.8), random.uniform(1.2, 2.6), random.uniform(0.4, 0.8)
    stem = [(0.09, 0), (0.07, trunk + 0.1)]
    if random.random() < 0.5:
        crown = [(0, trunk), (wide, trunk), (wide, trunk), (0, trunk + tall)]
    else:
        angle = np.linspace(-np.pi / 2, np.pi / 2, 13)
        crown = np.stack([wide * np.cos(angle), trunk + tall / 2 * (1 + np.sin(angle))], axis=1)
        crown[[0, -1], 0] = 0
    return merge(lathe(stem, 16), lathe(crown, 24))
