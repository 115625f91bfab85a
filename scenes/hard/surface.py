"""Geometry thinner than a pixel, texture, and surfaces that reflect nothing."""

from __future__ import annotations

import numpy as np

from onespp.scenes.animation import Animation
from onespp.scenes.cameras import looking
from onespp.scenes.description import Camera, Rectangle, Scene, Shape
from onespp.scenes.materials import checks, diffuse, image, noise
from onespp.scenes.meshes import box, merge, place
from onespp.scenes.transforms import rotate, scale, translate

from .parts import BLUE, FRAMES, RED, Z, at, ball, lamp, scene, surroundings

_PAN = Camera(looking({0: (-0.15, 1.5, 5), FRAMES: (0.25, 1.5, 5)}, (0, 0.7, 0), "linear"), fov=36)


def thin() -> Scene:
    """Wires a quarter of a pixel wide: each pixel sees one or misses it, and not the one it saw."""
    wire = box((0.012, 2.2, 0.012))
    fence = merge(*(place(wire, translate((x, 1.1, 0.5))) for x in np.linspace(-1.5, 1.5, 16)))
    cross = Animation(lambda f: translate((0, 0.9, 1)) @ rotate(Z, 3 * f) @ rotate(Z, 90))
    return scene("thin", "Wires thinner than a pixel, still and turning, before a moving camera",
                 *surroundings(), ball(np.eye(4), BLUE, fence, "fence"),
                 ball(cross, RED, wire, "wire"), lamp(), camera=_PAN)


def textured() -> Scene:
    """As fine as pixels, and on the floor finer."""
    grain = noise(64, 64, (16, 16), seed=5)[..., None] * np.array([0.9, 0.7, 0.5])
    return scene("textured", "Textures as fine as a pixel before a moving camera",
                 *surroundings(diffuse(checks((0.8, 0.8, 0.8), (0.08, 0.08, 0.08), (24, 24))),
                               diffuse(image(np.clip(grain, 0, 0.95), (6, 3)))),
                 ball(at(-0.6, 0.5, 0.2), BLUE), lamp(), camera=_PAN)


def dark() -> Scene:
    """Albedo 0, 0.0005 and 0.02 side by side: what is divided by albedo must survive."""
    panels = tuple(
        Shape(f"panel_{i}", Rectangle(), diffuse((albedo, albedo, albedo)),
              translate((-1.5 + i, 1.2, -1.5)) @ scale((0.45, 0.9, 1)))
        for i, albedo in enumerate((0.0, 0.0005, 0.02, 0.5)))
    one_color = ball(at(0, 0.35, 0.6, 0.35), (0.7, 0.0, 0.0005))
    return scene("dark", "Panels of albedo 0, 0.0005, 0.02 and 0.5, and a ball with one at 0",
                 *surroundings(), *panels, one_color, lamp(), camera=_PAN)
