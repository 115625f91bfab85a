"""Objects that come, go, grow, shrink and turn inside out."""

from __future__ import annotations

from onespp.scenes.animation import Animation
from onespp.scenes.description import Scene, Shape
from onespp.scenes.transforms import rotate, scale, translate

from .parts import BLUE, BOX, EVENT, RED, Y, at, ball, lamp, scene, surroundings

_STILL = ball(at(0.9, 0.35, 0.4, 0.35), (0.15, 0.5, 0.2), name="other")
_AWAY = translate((0, -50, 0))  # under the floor


def _with(name: str, about: str, *shapes: Shape) -> Scene:
    return scene(name, about, *surroundings(), _STILL, *shapes, lamp())


def uncovers() -> Scene:
    board = ball(Animation(lambda f: translate((-2.4 + 0.6 * f, 1.2, 1)) @ scale((0.9, 1.4, 0.05))),
                 BLUE, BOX, "board")
    return _with("uncovers", "A board that flies by and uncovers what is behind it", board)


def enters() -> Scene:
    return _with("enters", "A ball that enters from the side",
                 ball(Animation(lambda f: at(-4 + 0.5 * f, 0.5, 0.2))))


def leaves() -> Scene:
    return _with("leaves", "A ball that leaves to the side",
                 ball(Animation(lambda f: at(-1 - 0.4 * f, 0.5, 0.2))))


def appears() -> Scene:
    return _with("appears", "A ball that is there at once", ball(Animation(
        lambda f: at(-0.6, 0.5, 0.2) if f >= EVENT else _AWAY @ scale(0.5))))


def vanishes() -> Scene:
    return _with("vanishes", "A ball that is gone at once", ball(Animation(
        lambda f: _AWAY @ scale(0.5) if f >= EVENT else at(-0.6, 0.5, 0.2))))


def shrinks() -> Scene:
    """A ball and a crate shrink to nothing, which has no inverse, and one of them grows again."""
    def size(frame: float) -> float:
        return abs(frame - 5) / 5

    return _with("shrinks", "A ball and a crate that shrink to nothing and grow again",
                 ball(Animation(lambda f: at(-0.7, 0.5, 0.2, 0.5 * size(f)))),
                 ball(Animation(lambda f: translate((0.1, 0.4, 0)) @ scale(max(1 - f / 5, 0))),
                      BLUE, BOX, "crate"))


def mirrored() -> Scene:
    """A crate and a ball whose matrices have a negative determinant from one frame on."""
    def side(frame: float) -> tuple[float, float, float]:
        return (-1 if frame >= EVENT else 1, 1, 1)

    crate = ball(Animation(lambda f: translate((-0.6, 0.45, 0.2)) @ rotate(Y, 20 + 2 * f)
                           @ scale(side(f))), BLUE, BOX, "crate")
    round_ = ball(Animation(lambda f: at(0.2, 0.3, 0.9, 0.3) @ scale(side(f))), RED)
    return _with("mirrored", "A crate and a ball that turn into their mirror images", crate, round_)


def behind() -> Scene:
    """A ball flies over the camera, from before it to behind it."""
    return _with("behind", "A ball that flies past the camera and on behind it",
                 ball(Animation(lambda f: at(-0.5, 1.3, 1 + 0.65 * f, 0.4))))
