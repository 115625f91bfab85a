"""What hard scenes share: a floor and a wall under a lamp, a ball, a camera that looks at them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from onespp.scenes.description import Camera, Color, Geometry, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse
from onespp.scenes.meshes import box
from onespp.scenes.transforms import Matrix, look_at, rotate, scale, translate

FRAMES, WIDTH, HEIGHT = 10, 96, 64
EVENT = 4
X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
GRAY: Color = (0.6, 0.6, 0.6)
RED: Color = (0.65, 0.12, 0.08)
BLUE: Color = (0.12, 0.2, 0.6)
LIGHT: Color = (16.0, 15.0, 13.0)

CAMERA = Camera(look_at((0, 1.5, 5), (0, 0.7, 0)), fov=36)
BOX = box((0.8, 0.8, 0.8))


def scene(name: str, about: str, *shapes: Shape, camera: Camera = CAMERA,
          environment: Color | np.ndarray | None = None) -> Scene:
    """A hard scene of these shapes."""
    return Scene(f"hard/{name}", about, shapes, camera, FRAMES, WIDTH, HEIGHT, max_depth=5,
                 environment=environment)


def surroundings(floor: Mapping[str, Any] | None = None,
                 wall: Mapping[str, Any] | None = None) -> tuple[Shape, Shape]:
    """A floor at y = 0 and a wall at z = -2, gray unless they are given a material."""
    return (Shape("floor", Rectangle(), floor or diffuse(GRAY),
                  rotate(X, -90) @ scale((4, 4, 1))),
            Shape("wall", Rectangle(), wall or diffuse(GRAY),
                  translate((0, 2, -2)) @ scale((4, 2, 1))))


def lamp(emission: Color | Callable[[float], Color] = LIGHT,
         place: Matrix | Callable[[float], Matrix] | None = None) -> Shape:
    """A square that shines down, above the middle unless it is given another place."""
    if place is None:
        place = translate((0, 3, 1)) @ rotate(X, 90) @ scale((0.5, 0.5, 1))
    return Shape("lamp", Rectangle(), diffuse((0.0, 0.0, 0.0)), place, emission)


def ball(place: Matrix | Callable[[float], Matrix], color: Color = RED,
         geometry: Geometry | None = None, name: str = "ball") -> Shape:
    """Something that stands on the floor: a unit sphere unless it is given a geometry."""
    return Shape(name, geometry or Sphere(), diffuse(color), place)


def at(x: float, y: float, z: float, radius: float = 0.5) -> Matrix:
    return translate((x, y, z)) @ scale(radius)
