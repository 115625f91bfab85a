"""Reflections that move on surfaces that stand still."""

from __future__ import annotations

from onespp.scenes.animation import Animation
from onespp.scenes.description import Rectangle, Scene, Shape
from onespp.scenes.materials import checks, diffuse, metal
from onespp.scenes.transforms import scale, translate

from .parts import at, ball, lamp, scene, surroundings

_MIRROR = {"type": "twosided", "bsdf": {"type": "conductor", "material": "none",
                                        "specular_reflectance": (0.9, 0.9, 0.9)}}
_CHECKS = diffuse(checks((0.7, 0.7, 0.7), (0.25, 0.3, 0.4)))
_BALL = ball(Animation(lambda frame: at(-1.3 + 0.28 * frame, 0.4, 0.3, 0.4)))


def mirror() -> Scene:
    glass = Shape("mirror", Rectangle(), _MIRROR,
                  translate((0, 1.1, -1.5)) @ scale((1.6, 0.9, 1)))
    return scene("mirror", "A still mirror in which a ball rolls by",
                 *surroundings(floor=_CHECKS), glass, _BALL, lamp())


def glossy_floor() -> Scene:
    return scene("glossy-floor", "A still glossy floor in which a ball rolls by",
                 *surroundings(floor=metal((0.9, 0.9, 0.9), 0.1), wall=_CHECKS), _BALL, lamp())
