"""The box under a lamp that swings and changes colour, seen by a camera on an orbit."""

import math
from dataclasses import replace

from onespp.scenes.animation import Animation
from onespp.scenes.box import box
from onespp.scenes.cameras import orbit
from onespp.scenes.description import Camera, Rectangle, Scene, Shape
from onespp.scenes.materials import diffuse
from onespp.scenes.transforms import rotate, scale, translate


def scene() -> Scene:
    still = box()
    swing = Animation(lambda f: translate((0.5 * math.sin(f / 4), 0.9, 0.3 * math.cos(f / 4))))
    lamp = Shape("lamp", Rectangle(), diffuse((0.0, 0.0, 0.0)),
                 swing @ rotate((1, 0, 0), 90) @ scale(0.25),
                 emission=lambda f: (30.0, 24 + 6 * math.sin(f / 3), 18.0))
    return replace(
        still, name="swinging_lamp",
        shapes=(lamp, *(shape for shape in still.shapes if shape.name != "light")),
        camera=Camera(orbit((0, 0, 0), 3.9, {0: -8, 24: 8}, elevation=0), fov=39.3))
