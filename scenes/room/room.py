"""A pink living room with toys: a camera that wanders through it, and much that moves.

Metres, y up, x to the right, the sofa's wall at -z. The room is closed; its light comes from a
panel in the ceiling and from the globe of a floor lamp.
"""

from __future__ import annotations

import math

import numpy as np

from onespp.scenes import materials
from onespp.scenes.animation import Animation, compose, spin, swing
from onespp.scenes.cameras import looking
from onespp.scenes.description import Camera, Color, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse, image, metal, palette, rgb, varnish
from onespp.scenes.meshes import merge, place
from onespp.scenes.transforms import Matrix, rotate, scale, translate

from . import decoration, furniture, pictures, toys

WIDTH, HEIGHT, BACK, FRONT = 6.0, 2.8, -2.7, 3.3
PERIOD = 80  # frames after which everything but the train's wheels is where it was

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
WHITE, DARK = rgb("#f3ece4"), rgb("#2b2328")
OAK, WALNUT = (rgb("#c99a66"), rgb("#8a5a33")), (rgb("#8a5c3b"), rgb("#4e2f1c"))
TOYS: tuple[Color, ...] = (rgb("#d8433b"), rgb("#2f6fae"), rgb("#2b2b30"), rgb("#e5ae3a"))
CARGO = (TOYS[0], TOYS[3], TOYS[2], TOYS[1])
SPINES: tuple[Color, ...] = tuple(map(rgb, (
    "#b5443c", "#2f5d8a", "#e0c9a0", "#4f7a4c", "#7a4a7a", "#d99a3c", "#34495e", "#e8e0d2")))


def room() -> Scene:
    """The scene; x in [-3, 3], y in [0, 2.8], z in [-2.7, 3.3]."""
    return Scene(
        name="room",
        about="A furnished pink room: moving camera, train, ball, chair and mobile; two lights",
        shapes=(*_shell(), *_lights(), *_along_the_walls(), *_seating(), *_toys()),
        camera=Camera(_camera(), fov=48),
        frames=80, width=1280, height=720, max_depth=7)


def _camera() -> Animation:
    """In from the right by the train, a turn past the table, and back along the window."""
    return looking(
        origin={0: (2.3, 1.6, 2.9), 20: (1.5, 1.45, 2.75), 40: (0.4, 1.3, 2.5),
                60: (-0.8, 1.35, 2.5), 80: (-1.7, 1.5, 2.75)},
        target={0: (-0.6, 0.7, -1.2), 20: (-0.5, 0.75, -1.4), 40: (-0.05, 0.75, -1.6),
                60: (0.4, 0.75, -1.5), 80: (0.7, 0.7, -1.3)})


def _shell() -> list[Shape]:
    w, h, d = WIDTH / 2, HEIGHT / 2, (FRONT - BACK) / 2
    middle = translate((0, 0, (FRONT + BACK) / 2))
    paper = pictures.wallpaper()

    def wall(name: str, turn: Matrix, distance: float, half: tuple[float, float]) -> Shape:
        return Shape(name, Rectangle(), diffuse(image(paper, (half[0], 1))),
                     middle @ translate((0, h, 0)) @ turn @ translate((0, 0, -distance))
                     @ scale((*half, 1)))

    floor = image(materials.planks(rgb("#e3bd90"), rgb("#b08357"), seed=3), (2, 2))
    return [
        wall("wall_back", np.eye(4), d, (w, h)),
        wall("wall_front", rotate(Y, 180), d, (w, h)),
        wall("wall_left", rotate(Y, 90), w, (d, h)),
        wall("wall_right", rotate(Y, -90), w, (d, h)),
        Shape("floor", Rectangle(), varnish(floor, 0.3),
              middle @ rotate(X, -90) @ scale((w, d, 1))),
        Shape("ceiling", Rectangle(), diffuse(WHITE),
              middle @ translate((0, HEIGHT, 0)) @ rotate(X, 90) @ scale((w, d, 1))),
        Shape("mouldings", decoration.mouldings(WIDTH, FRONT - BACK, HEIGHT), diffuse(WHITE),
              middle),
    ]


def _lights() -> list[Shape]:
    panel = translate((0, HEIGHT - 0.071, 0))  # flush: a lit rim would be a light unsampled
    lamp = translate((1.3, 0, -2.2))
    return [
        Shape("ceiling_light", Rectangle(), diffuse((0.0, 0.0, 0.0)),
              panel @ rotate(X, 90) @ scale((0.7, 0.5, 1)), emission=(25.0, 24.2, 23.4)),
        Shape("ceiling_light_rim", decoration.rim(1.4, 1.0, 0.07, 0.04), diffuse(WHITE),
              translate((0, HEIGHT, 0))),
        Shape("lamp_stand", decoration.lamp_stand(), metal(rgb("#d6b27a"), 0.25), lamp),
        Shape("lamp_globe", Sphere(), diffuse((0.0, 0.0, 0.0)),
              lamp @ translate((0, 1.6, 0)) @ scale(0.12), emission=(10.0, 7.2, 4.2)),
    ]


def _along_the_walls() -> list[Shape]:
    back, left = translate((0, 0, BACK)), translate((-WIDTH / 2, 0, 0)) @ rotate(Y, 90)
    right = translate((WIDTH / 2, 0, 0)) @ rotate(Y, -90)
    hung = [(-1.35, 1.75, 0.42, 0.56), (-0.62, 1.78, 0.66, 0.5), (0.12, 1.75, 0.42, 0.56)]
    size, boards = (1.3, 2.1, 0.34), 5
    shelf = left @ translate((1.95, 0, 0.18))
    window = left @ translate((-0.35, 1.5, 0.002))
    clock = back @ translate((2.25, 1.95, 0.003))
    hangings = [furniture.at(decoration.curtain(0.62, 1.95, 6, seed), x, 0.79, 0.11)
                for seed, x in ((1, -0.78), (2, 0.78))]
    cloth = materials.weave(rgb("#f3ead6"), rgb("#bcd0c6"), threads=16)
    return [
        Shape("picture_frames", place(decoration.frames(hung), back), varnish(rgb("#5a3a26"))),
        Shape("pictures", place(decoration.pictures(hung), back), diffuse(pictures.paintings())),
        Shape("drawers", furniture.drawers((1.2, 0.78, 0.42), 3), varnish(rgb("#e9e4d8"), 0.25),
              right @ translate((-0.35, 0, 0.23))),
        Shape("poster", Rectangle(), diffuse(pictures.rainbow()),
              right @ translate((-0.35, 1.65, 0.004)) @ scale((0.5, 0.375, 1))),
        Shape("shelf", furniture.shelf(size, boards),
              varnish(materials.wood(*WALNUT, seed=7), 0.3), shelf),
        Shape("books", furniture.books(size, boards, len(SPINES), seed=11),
              diffuse(palette(SPINES)), shelf),
        Shape("window_frame", decoration.window_frame(1.3, 1.2), varnish(WHITE, 0.25), window),
        Shape("window_pane", Rectangle(), varnish(pictures.dusk(), 0.1),
              window @ scale((0.65, 0.6, 1))),
        Shape("curtains", merge(*hangings), diffuse(image(cloth, (4, 12))), window),
        Shape("clock", decoration.clock_case(), varnish(palette((WHITE, WALNUT[1]))), clock),
        Shape("clock_pendulum", decoration.pendulum(), metal(rgb("#e3b34f"), 0.2),
              compose(clock @ translate((0, 0, 0.03)), swing(Z, 14, 20))),
        Shape("plant_pot", decoration.plant_pot(), varnish(rgb("#e9e1d6"), 0.15),
              translate((-2.05, 0, -2.15))),
        Shape("plant", decoration.leaves(17, seed=2), diffuse(rgb("#3f7d3c")),
              translate((-2.05, 0.28, -2.15))),
    ]


def _seating() -> list[Shape]:
    sofa = translate((-0.6, 0, -2.15))
    table = translate((-0.35, 0.015, -0.75))
    top = table @ translate((0, 0.42, 0))
    fruit = (rgb("#f2f0ea"), rgb("#e07b28"), rgb("#b8322c"), rgb("#9cb53c"))
    fur = (rgb("#8d5f38"), rgb("#d8b48a"), rgb("#1c1716"))
    rock = Animation(lambda frame: _rocking(11 * math.sin(2 * math.pi * frame / 40)))
    return [
        Shape("rug", furniture.rug(2.6, 1.8), diffuse(pictures.rug_pattern()),
              translate((-0.45, 0, -0.75))),
        Shape("sofa", furniture.sofa(), diffuse(image(materials.weave(
            rgb("#5f8f8b"), rgb("#4c7a78"), threads=32), (6, 6))), sofa),
        Shape("cushion_left", furniture.cushion(), diffuse(materials.checks(
            rgb("#f0ddb8"), rgb("#c9574f"), (4, 4))),
              sofa @ translate((-0.52, 0.71, 0.03)) @ rotate(Y, 14) @ rotate(X, -18)),
        Shape("cushion_right", furniture.cushion(), diffuse(rgb("#e2b04a")),
              sofa @ translate((0.58, 0.71, 0.03)) @ rotate(Y, -12) @ rotate(X, -18)
              @ rotate(Z, 8)),
        Shape("teddy", toys.teddy(), diffuse(palette(fur)),
              sofa @ translate((0.1, 0.5, 0.08)) @ rotate(Y, -8)),
        Shape("table", furniture.table(), varnish(materials.wood(*OAK, seed=9), 0.2), table),
        Shape("vase", decoration.vase(0.5), metal(rgb("#e6d7d2"), 0.15),
              top @ translate((-0.27, 0, -0.02))),
        Shape("fruit_bowl", decoration.bowl_of_fruit(len(fruit)), varnish(palette(fruit), 0.2),
              top @ translate((0.25, 0, 0.06))),
        Shape("rocking_chair", furniture.rocking_chair(),
              varnish(materials.wood(*WALNUT, seed=13), 0.25),
              compose(translate((2.0, 0, -1.1)) @ rotate(Y, -38), rock)),
    ]


def _rocking(degrees: float) -> Matrix:
    """The chair tipped about the centre of its runners, 1.1 up, rolling without slipping."""
    return (translate((0, 1.1, 1.1 * math.radians(degrees))) @ rotate(X, degrees)
            @ translate((0, -1.1, 0)))


def _toys() -> list[Shape]:
    centre, radius = translate((1.5, 0, 0.55)), 0.62
    wheels = 0.024  # top of the rails

    def on_track(behind: float) -> Animation:
        place = translate((radius, wheels, 0))
        return compose(centre, spin(Y, -360 / PERIOD), rotate(Y, behind), place)

    wool = (rgb("#f7f3ea"), rgb("#d8433b"), rgb("#e5ae3a"), rgb("#4f9a8f"))
    return [
        Shape("train_track", toys.train_track(radius), varnish(rgb("#b98a5a"), 0.3), centre),
        Shape("locomotive", toys.locomotive(), varnish(palette(TOYS), 0.15), on_track(0)),
        Shape("wagon_1", toys.wagon(), varnish(palette(TOYS), 0.15), on_track(31)),
        Shape("wagon_2", toys.wagon(), varnish(palette(CARGO), 0.15),
              on_track(58)),
        Shape("ball", Sphere(), diffuse(materials.checks(rgb("#f4efe6"), rgb("#d4475d"), (4, 2))),
              _rolling(0.17)),
        Shape("mobile", toys.mobile(len(wool)), diffuse(palette(wool)),
              compose(translate((-1.5, HEIGHT - 0.01, -1.0)), swing(Z, 4, 40),
                      spin(Y, 360 / PERIOD))),
    ]


def _rolling(radius: float) -> Animation:
    """A ball that rolls to and fro on the floor before the rug, turning as far as it rolls."""
    def matrix_at(frame: float) -> Matrix:
        x = -1.2 * math.cos(2 * math.pi * frame / PERIOD)
        return (translate((-1.0 + x, radius, 0.42)) @ rotate(Z, -math.degrees(x / radius))
                @ rotate(X, 50) @ scale(radius))

    return Animation(matrix_at)
