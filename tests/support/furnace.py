"""Scenes whose radiance is known in closed form."""

from __future__ import annotations

import numpy as np

from onespp.scenes.description import Camera, Mesh, Scene, Shape
from onespp.scenes.transforms import look_at, translate

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
_QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
INWARD = np.array([t for a, b, c, d in _QUADS for t in ((a, c, b), (a, d, c))])


def furnace(albedo: float, emission: float, max_depth: int,
            at: tuple[float, float, float] = (0, 0, 0)) -> Scene:
    """A closed cube seen from inside whose walls all emit and reflect alike.

    A path of k + 1 segments brings emission * albedo^k.
    """
    wall = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": (albedo,) * 3}}
    camera = look_at(np.add(at, (0.1, 0.2, -0.3)), np.add(at, (0.9, -0.5, 1)))
    return Scene("furnace", "a closed cube of glowing walls",
                 (Shape("cube", Mesh(CORNERS, INWARD), wall, translate(at),
                        (emission,) * 3),),
                 Camera(camera, 70), 4, 16, 16, max_depth)
