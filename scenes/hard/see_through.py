"""Surfaces that others are seen through: glass, panes, and leaves that are cut out by masks."""

from __future__ import annotations

import numpy as np

from onespp.scenes.animation import Animation
from onespp.scenes.cameras import looking
from onespp.scenes.description import Camera, Mesh, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import cutout, diffuse, glass, pane
from onespp.scenes.meshes import box
from onespp.scenes.transforms import scale, translate

from .parts import FRAMES, at, ball, lamp, scene, surroundings
from .reflection import CHECKS

_PAN = Camera(looking({0: (-0.3, 1.5, 5), FRAMES: (0.5, 1.5, 5)}, (0, 0.7, 0), "linear"), fov=36)
_BALL = ball(Animation(lambda frame: at(-1.2 + 0.2 * frame, 0.4, -0.8, 0.4)))
_LEAVES = 5000
_TEXELS = 16


def glass_ball() -> Scene:
    """It shows the wall upside down, and the lamp twice."""
    return scene("glass-ball", "A ball of glass before a pattern, and a moving camera",
                 *surroundings(wall=CHECKS), Shape("glass", Sphere(), glass(), at(0, 0.85, 0, 0.8)),
                 lamp(), camera=_PAN)


def window() -> Scene:
    """Light reaches what is behind it by chance alone."""
    return scene("window", "A pane with a reflection, behind which a ball rolls by",
                 *surroundings(wall=CHECKS), _BALL,
                 Shape("pane", box((3.2, 2.3, 0.04)), glass(), translate((0, 1.2, 0.8))),
                 lamp(), camera=_PAN)


def thin_glass() -> Scene:
    return scene("thin-glass", "A pane without thickness, behind which a ball rolls by",
                 *surroundings(wall=CHECKS), _BALL,
                 Shape("pane", Rectangle(), pane(),
                       translate((0, 1.2, 0.8)) @ scale((1.6, 1.15, 1))),
                 lamp(), camera=_PAN)


def foliage() -> Scene:
    """Squares with a leaf on each, smaller than two pixels."""
    rng = np.random.default_rng(11)
    middle, along, across = rng.normal(size=(3, _LEAVES, 3))
    middle *= 1.2 * (rng.random(_LEAVES)**(1 / 3) / np.linalg.norm(middle, axis=1))[:, None]
    across = np.cross(along, across)
    u, v = (0.022 * side / np.linalg.norm(side, axis=1)[:, None] for side in (along, across))
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    vertices = (middle[:, None] + np.array([0, 1.25, 0.2])
                + corners[:, :1] * u[:, None] + corners[:, 1:] * v[:, None])
    faces = 4 * np.arange(_LEAVES)[:, None, None] + np.array([(0, 1, 2), (0, 2, 3)])
    leaves = Mesh(vertices.reshape(-1, 3), faces.reshape(-1, 3),
                  uv=np.tile((corners + 1) / 2, (_LEAVES, 1)))
    y, x = (np.mgrid[:_TEXELS, :_TEXELS] + 0.5) / _TEXELS * 2 - 1
    leaf = np.abs(x) < 0.6 * np.cos(0.5 * np.pi * y)
    return scene("foliage", "5000 leaves, squares with a mask, before a moving camera",
                 *surroundings(wall=CHECKS),
                 Shape("leaves", leaves, cutout(diffuse((0.15, 0.4, 0.08)), leaf)),
                 lamp(), camera=_PAN)
