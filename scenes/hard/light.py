"""Light that changes while nothing moves, moves while the rest is still, or is hard to find."""

from __future__ import annotations

import math

import numpy as np

from onespp.scenes.animation import Animation
from onespp.scenes.description import Color, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse, metal
from onespp.scenes.transforms import rotate, scale, translate

from .parts import EVENT, LIGHT, X, Y, at, ball, lamp, scene, surroundings

_THINGS = (ball(at(-0.8, 0.5, 0)), ball(at(0.9, 0.35, 0.4, 0.35), (0.15, 0.5, 0.2), name="other"))
_DIM = (0.08, 0.09, 0.1)


def _at_event(before: Color, after: Color):
    return lambda frame: after if frame >= EVENT else before


def switched_on() -> Scene:
    return scene("switched-on", "A lamp that is switched on over a still scene",
                 *surroundings(), *_THINGS, lamp(_at_event((0.0, 0.0, 0.0), LIGHT)),
                 environment=_DIM)


def switched_off() -> Scene:
    return scene("switched-off", "A lamp that is switched off over a still scene",
                 *surroundings(), *_THINGS, lamp(_at_event(LIGHT, (0.0, 0.0, 0.0))),
                 environment=_DIM)


def color() -> Scene:
    return scene("color", "A lamp that turns from white to red over a still scene",
                 *surroundings(), *_THINGS, lamp(_at_event(LIGHT, (20.0, 4.0, 2.0))))


def glossy_color() -> Scene:
    """What few samples tell of, reflections in metal, changes with all the light."""
    return scene("glossy-color", "A lamp that turns from white to red over a still metal floor",
                 *surroundings(floor=metal((0.85, 0.85, 0.9), 0.2)), *_THINGS,
                 lamp(_at_event(LIGHT, (20.0, 4.0, 2.0))))


def one_of_two() -> Scene:
    """Some of the light stays as it was, elsewhere than most of it."""
    side = Shape("side", Rectangle(), diffuse((0.0, 0.0, 0.0)), translate((-2.4, 1.6, 1.2))
                 @ rotate(Y, 60) @ scale((0.4, 0.4, 1)), (18.0, 24.0, 36.0))
    return scene("one-of-two", "One of two lamps is switched off over a still metal floor",
                 *surroundings(floor=metal((0.95, 0.8, 0.5), 0.25)), *_THINGS, side,
                 lamp(_at_event(LIGHT, (0.0, 0.0, 0.0))))


def colored_sky() -> Scene:
    """What one visibility for all colours leaves is rare and bright in one colour, often dim in
    another: gray ground takes a cast where either is lost."""
    return scene("colored-sky", "A sky of amber, cyan and violet over even ground and metal",
                 Shape("floor", Rectangle(), diffuse((0.5, 0.5, 0.5)),
                       rotate(X, -90) @ scale((20, 20, 1))),
                 ball(Animation(lambda f: at(-1.1 + 0.08 * f, 0.45, 0.3, 0.45))),
                 Shape("metal", Sphere(), metal((0.9, 0.9, 0.9), 0.2), at(0.7, 0.5, 0.2)),
                 environment=_patches())


def _patches() -> np.ndarray:
    """(h, w, 3) radiance: soft patches before a dim blue, by latitude and longitude."""
    latitude = (0.5 - (np.arange(32)[:, None] + 0.5) / 32) * np.pi
    longitude = (np.arange(64) + 0.5) / 64 * 2 * np.pi
    image = np.full((32, 64, 3), (0.04, 0.05, 0.09))
    for up, around, sharpness, tint in ((0.7, 0.9, 20, (9.0, 4.5, 0.8)),
                                        (0.5, 2.9, 12, (0.4, 2.5, 3.5)),
                                        (1.1, 4.6, 30, (4.0, 0.8, 7.0))):
        cosine = (np.sin(latitude) * np.sin(up)
                  + np.cos(latitude) * np.cos(up) * np.cos(longitude - around))
        image += np.exp(sharpness * (cosine - 1))[..., None] * tint
    return image.astype(np.float32)


def moving_light() -> Scene:
    """Shadows sweep over surfaces that stand still."""
    def place(frame: float):
        return (translate((2 * math.cos(0.35 * frame), 2.4, 0.6)) @ rotate(X, 90)
                @ scale((0.25, 0.25, 1)))

    return scene("moving-light", "A lamp that moves over a still scene: shadows sweep",
                 *surroundings(), *_THINGS, lamp((50.0, 48.0, 44.0), Animation(place)))


def emitters() -> Scene:
    """Lights in view, far brighter and darker than white, one of them on its way."""
    def glow(name: str, radiance: float, place) -> Shape:
        return Shape(name, Sphere(), diffuse((0.0, 0.0, 0.0)), place, (radiance, 0.9 * radiance,
                                                                       0.7 * radiance))

    return scene("emitters", "Lights in view, bright and dim, one of them moving",
                 *surroundings(), *_THINGS, glow("bright", 30.0, at(0.1, 1.3, 0.5, 0.15)),
                 glow("dim", 0.5, at(-1.6, 1.2, 0, 0.3)),
                 glow("moving", 6.0, Animation(lambda f: at(-1.2 + 0.25 * f, 1.8, -0.6, 0.2))))


def fireflies() -> Scene:
    """Few paths find the light, by a diffuse bounce and then a glossy one, and bring very much."""
    return scene("fireflies", "A tiny lamp of radiance 20 000 and glossy things: rare bright paths",
                 *surroundings(floor=metal((0.9, 0.85, 0.8), 0.15)), *_THINGS,
                 Shape("spark", Sphere(), diffuse((0.0, 0.0, 0.0)), at(0.3, 1.6, 0.8, 0.015),
                       (20000.0, 19000.0, 17000.0)))
