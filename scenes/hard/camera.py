"""Cameras that make history hard to find, and surfaces seen at a bad angle."""

from __future__ import annotations

from onespp.scenes.animation import Animation
from onespp.scenes.cameras import looking
from onespp.scenes.description import Camera, Rectangle, Scene, Shape
from onespp.scenes.materials import checks, diffuse
from onespp.scenes.transforms import look_at, rotate, scale, translate

from .parts import BOX, EVENT, FRAMES, GRAY, LIGHT, RED, X, Y, at, ball, lamp, scene, surroundings


def cut() -> Scene:
    views = (look_at((0, 1.5, 5), (0, 0.7, 0)), look_at((3, 1.2, 2.5), (-0.5, 0.5, -0.5)))
    return scene("cut", "A cut from one camera to another",
                 *surroundings(), ball(at(-0.8, 0.5, 0)),
                 ball(translate((0.8, 0.4, 0.2)), (0.12, 0.2, 0.6), BOX, "crate"), lamp(),
                 camera=Camera(Animation(lambda frame: views[frame >= EVENT]), fov=36))


def backwards() -> Scene:
    """What comes in at the borders has never been seen; all the rest shrinks."""
    def wall(name: str, turn, color) -> Shape:
        return Shape(name, Rectangle(), diffuse(color),
                     translate((0, 1, 0)) @ turn @ translate((0, 0, -1)) @ scale((8, 1, 1)))

    tiles = checks((0.7, 0.7, 0.7), (0.35, 0.3, 0.25), (16, 2))
    lamps = tuple(
        Shape(f"lamp_{i}", Rectangle(), diffuse((0.0, 0.0, 0.0)),
              translate((0, 1.98, z)) @ rotate(X, 90) @ scale((0.3, 0.3, 1)), LIGHT)
        for i, z in enumerate((-6, -2, 2, 6)))
    return scene("backwards", "Walking backwards down a corridor",
                 wall("left", rotate(Y, 90), RED), wall("right", rotate(Y, -90), GRAY),
                 wall("floor", rotate(X, -90) @ rotate((0, 0, 1), 90), tiles),
                 wall("ceiling", rotate(X, 90) @ rotate((0, 0, 1), 90), GRAY),
                 Shape("end", Rectangle(), diffuse(GRAY), translate((0, 1, -8))), *lamps,
                 camera=Camera(looking({0: (0, 1.1, -2), FRAMES: (0, 1.1, 3)}, {
                     0: (0, 0.9, -8), FRAMES: (0, 0.9, -7)}, "linear"), fov=60))


def grazing() -> Scene:
    """A floor seen from just above it: depth changes by far within a pixel."""
    return scene("grazing", "A floor and a wall seen along their planes, from a moving camera",
                 Shape("floor", Rectangle(), diffuse(checks((0.7, 0.7, 0.7), (0.3, 0.3, 0.35))),
                       rotate(X, -90) @ scale((4, 40, 1))),
                 Shape("side", Rectangle(), diffuse(RED),
                       translate((0.6, 2, 0)) @ rotate(Y, -90) @ scale((40, 2, 1))),
                 ball(at(-0.4, 0.25, -2, 0.25)),
                 lamp(place=translate((-1, 3, -3)) @ rotate(X, 90)),
                 camera=Camera(looking({0: (0.3, 0.12, 5), FRAMES: (0.4, 0.16, 4)}, (0.3, 0.1, -9),
                                       "linear"), fov=36),
                 environment=(0.2, 0.25, 0.3))
