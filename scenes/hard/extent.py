"""The same small scene far from the origin, tiny and huge; and one with nothing behind it."""

from __future__ import annotations

import numpy as np

from onespp.scenes.animation import Animation
from onespp.scenes.cameras import looking, orbit
from onespp.scenes.description import Camera, Scene
from onespp.scenes.transforms import Matrix, identity, scale, translate

from .parts import BLUE, BOX, FRAMES, at, ball, lamp, scene, surroundings


def _moved(name: str, about: str, offset: tuple[float, float, float], factor: float) -> Scene:
    """A ball that moves before a moving camera, all of it in another place and size."""
    world = translate(offset) @ scale(factor)
    path = looking({0: (-0.2, 1.5, 5), FRAMES: (0.3, 1.6, 4.8)}, (0, 0.7, 0), "linear")

    def camera(frame: float) -> Matrix:
        moved = world @ path(frame)
        moved[:3, :3] /= factor  # a camera has no size
        return moved

    shapes = (*surroundings(), ball(Animation(lambda f: at(-0.8 + 0.1 * f, 0.5, 0.1))),
              ball(translate((0.8, 0.4, 0.3)), BLUE, BOX, "crate"), lamp())
    placed = tuple(_placed(shape, world) for shape in shapes)
    return scene(name, about, *placed, camera=Camera(Animation(camera), fov=36))


def _placed(shape, world: Matrix):
    own = shape.world_from_object
    place = (Animation(lambda frame: world @ own(frame)) if callable(own) else world @ own)
    return type(shape)(shape.name, shape.geometry, shape.material, place, shape.emission)


def far() -> Scene:
    return _moved("far", "A small scene a million units from the origin", (1e6, -1e6, 1e6), 1)


def tiny() -> Scene:
    return _moved("tiny", "A small scene, ten thousand times smaller", (0, 0, 0), 1e-4)


def huge() -> Scene:
    return _moved("huge", "A small scene, ten thousand times larger", (0, 0, 0), 1e4)


def sky() -> Scene:
    """Two things that float before an environment, which the moving camera sees all round."""
    return scene("sky", "Things that float before an environment map, with nothing behind",
                 ball(at(-0.6, 0.8, 0)), ball(identity() @ translate((0.7, 0.6, 0)), BLUE, BOX,
                                              "crate"),
                 camera=Camera(orbit((0, 0.7, 0), 5, {0: -8, FRAMES: 12}, 10), fov=36),
                 environment=_evening())


def _evening(height: int = 32, width: int = 64) -> np.ndarray:
    """(h, w, 3) radiance: ground, sky and a sun 8 pixels wide, by latitude and longitude."""
    up = np.cos(np.pi * (np.arange(height) + 0.5) / height)[:, None, None]
    sky_ = np.where(up > 0, [0.25, 0.4, 0.8], [0.3, 0.25, 0.2]) * (0.4 + np.abs(up))
    image = np.broadcast_to(sky_, (height, width, 3)).copy()
    image[8:11, 28:36] = (30.0, 24.0, 15.0)
    return image
