"""A polished ball under a sky, whose lobes are narrower than what a sky is cut into."""

from __future__ import annotations

import numpy as np

from onespp.scenes.description import Camera, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse, rgb
from onespp.scenes.transforms import look_at, rotate, scale, translate

LAMP = Shape("lamp", Sphere(), diffuse(rgb("#000000")), translate((1.5, 2, 1)) @ scale(0.3),
             emission=(20.0, 18.0, 15.0))


def metal_under_sky(alpha: float, *lamps: Shape) -> Scene:
    """A metal ball of that roughness over a floor, under a sky with a bright patch."""
    sky = np.full((8, 16, 3), 0.4, np.float32)
    sky[1:4, 5:8] = 5
    ball = Shape("ball", Sphere(), {"type": "roughconductor", "distribution": "ggx",
                                    "alpha": alpha, "specular_reflectance": rgb("#ddccaa")})
    floor = Shape("floor", Rectangle(), diffuse(rgb("#888888")),
                  translate((0, -1, 0)) @ rotate((1, 0, 0), -90) @ scale(4))
    return Scene("metal", "a metal ball under a sky", (ball, floor, *lamps),
                 Camera(look_at((0, 1, 4.5), (0, -0.2, 0)), fov=40), 4, 32, 24, environment=sky)
