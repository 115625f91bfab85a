"""Reflections that move on surfaces that stand still, and mirrors that move."""

from __future__ import annotations

from onespp.scenes.animation import Animation
from onespp.scenes.description import Rectangle, Scene, Shape
from onespp.scenes.materials import checks, diffuse, metal
from onespp.scenes.materials import mirror as silver
from onespp.scenes.transforms import rotate, scale, translate

from .parts import X, Y, at, ball, lamp, scene, surroundings

CHECKS = diffuse(checks((0.7, 0.7, 0.7), (0.25, 0.3, 0.4)))
_BALL = ball(Animation(lambda frame: at(-1.3 + 0.28 * frame, 0.4, 0.3, 0.4)))


def mirror() -> Scene:
    glass = Shape("mirror", Rectangle(), silver(),
                  translate((0, 1.1, -1.5)) @ scale((1.6, 0.9, 1)))
    return scene("mirror", "A still mirror in which a ball rolls by",
                 *surroundings(floor=CHECKS), glass, _BALL, lamp())


def moving_mirror() -> Scene:
    """What it shows moves twice as fast as it does, and the other way."""
    place = Animation(lambda frame: translate((0, 1.1, -1.3)) @ rotate(Y, -20 + 4 * frame)
                      @ rotate(X, 14) @ scale((1.2, 0.9, 1)))
    return scene("moving-mirror", "A mirror that turns, and a ball that rolls by",
                 *surroundings(floor=CHECKS), Shape("mirror", Rectangle(), silver(), place),
                 _BALL, lamp())


def glossy_floor() -> Scene:
    return scene("glossy-floor", "A still glossy floor in which a ball rolls by",
                 *surroundings(floor=metal((0.9, 0.9, 0.9), 0.1), wall=CHECKS), _BALL, lamp())
