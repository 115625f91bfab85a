"""A scene of one's own.

    onespp run my_scene.py --frames 0:8 --size 160x120

What moves is a function of the frame number: any frame can be asked for on its own. What there is
to build with: docs/scenes.md.
"""

from __future__ import annotations

from onespp.scenes.animation import translation
from onespp.scenes.cameras import orbit
from onespp.scenes.description import Camera, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import checks, diffuse, rgb
from onespp.scenes.transforms import rotate, scale, translate


def scene() -> Scene:
    """Units are metres, y is up. Frames are rendered when asked for; nothing is read here."""
    jump = translation({0: (0, 0.5, 0), 12: (0, 1.5, 0), 24: (0, 0.5, 0)}, "smooth", loop=True)
    return Scene(
        name="my_scene",  # folders are called so
        about="A ball that jumps",
        frames=24, width=640, height=360,
        shapes=(
            # A name, a shape, a material, and where it is: a matrix, or a function of the frame.
            Shape("floor", Rectangle(), diffuse(checks(rgb("#dddddd"), rgb("#8899aa"))),
                  rotate((1, 0, 0), -90) @ scale(4)),
            Shape("ball", Sphere(), diffuse(rgb("#d8433b")), jump @ scale(0.5)),
            Shape("lamp", Sphere(), diffuse((0, 0, 0)), translate((2, 4, 2)) @ scale(0.5),
                  emission=(40, 38, 35)),  # radiance, linear
        ),
        camera=Camera(orbit((0, 0.7, 0), 6, {0: 0, 24: 30})),
        environment=(0.2, 0.25, 0.3))
