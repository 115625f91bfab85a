"""A Cornell box in motion: a still camera, one area light, a ball and two boxes that never rest.

Everything is diffuse. Motions are periodic, so the animation may run as long as one likes.
"""

from __future__ import annotations

import numpy as np

from .animation import Animation, spin, translation
from .description import Camera, Color, Rectangle, Scene, Shape, Sphere
from .materials import diffuse
from .meshes import box as box_mesh
from .transforms import look_at, rotate, scale, translate

WHITE: Color = (0.725, 0.71, 0.68)
RED: Color = (0.63, 0.065, 0.05)
GREEN: Color = (0.14, 0.45, 0.091)
BLUE: Color = (0.16, 0.27, 0.62)
GOLD: Color = (0.82, 0.56, 0.18)


def box() -> Scene:
    """The scene; its walls reach from -1 to 1 in x, y and z, and the front is open."""
    return Scene(
        name="box",
        about="A Cornell box: still camera, a ball and two boxes that move and turn, all diffuse",
        shapes=(*_walls(), *_things()),
        camera=Camera(look_at((0, 0, 3.9), (0, 0, 0)), fov=39.3),
        frames=20, width=512, height=512, max_depth=6)


def _walls() -> list[Shape]:
    def wall(name: str, color: Color, turn: np.ndarray) -> Shape:
        return Shape(name, Rectangle(), diffuse(color), turn @ translate((0, 0, -1)))

    x, y = (1, 0, 0), (0, 1, 0)
    light = translate((0, 0.998, 0)) @ rotate(x, 90) @ scale((0.4, 0.4, 1))
    return [
        wall("back_wall", WHITE, np.eye(4)),
        wall("left_wall", RED, rotate(y, 90)),
        wall("right_wall", GREEN, rotate(y, -90)),
        wall("floor", WHITE, rotate(x, -90)),
        wall("ceiling", WHITE, rotate(x, 90)),
        Shape("light", Rectangle(), diffuse((0.0, 0.0, 0.0)), light, emission=(14.0, 12.2, 9.4)),
    ]


def _things() -> list[Shape]:
    bounce = Animation(lambda frame: translate((0, 0.5 * abs(np.sin(np.pi * frame / 24)), 0)))
    roam = translation({0: (-0.6, -0.74, 0.35), 16: (0.0, -0.74, 0.45), 32: (0.62, -0.74, 0.5),
                        48: (0.0, -0.74, 0.4), 64: (-0.6, -0.74, 0.35)}, "spline", loop=True)
    drift = translation({0: (0.42, -0.3, -0.15), 20: (0.5, -0.05, -0.3), 40: (0.42, -0.3, -0.15)},
                        "smooth", loop=True)
    return [
        Shape("ball", Sphere(), diffuse(GOLD), roam @ bounce @ scale(0.26)),
        Shape("tall_box", box_mesh((0.5, 1.2, 0.5)), diffuse(WHITE),
              translate((-0.42, -0.4, -0.4)) @ spin((0, 1, 0), 3)),
        Shape("small_box", box_mesh((0.44, 0.44, 0.44)), diffuse(BLUE),
              drift @ spin((0, 1, 0), -4) @ rotate((1, 0, 1), 35)),
    ]
