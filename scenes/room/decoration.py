"""What hangs on the walls and stands about, as meshes: one object each, in metres, y up.

Things face +z. What hangs on a wall lies in the xy plane, what swings has its axis at the origin.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from onespp.scenes.description import Mesh
from onespp.scenes.meshes import (
    box,
    ellipsoid,
    lathe,
    merge,
    paint,
    place,
    rounded_box,
    surface,
    torus,
)
from onespp.scenes.transforms import rotate, translate

from .furniture import at, between, drum

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)


def vase(height: float = 0.3) -> Mesh:
    """A thick-walled vase with a belly and a narrow neck."""
    y = np.linspace(0, 1, 40)
    radius = height * (0.16 + 0.27 * np.sin(np.pi * y**0.8) ** 1.5 - 0.05 * y + 0.11 * y**8)
    outside = np.stack([radius, y * height], axis=1)
    inside = np.stack([radius - 0.04 * height, y * height], axis=1)[:3:-1]
    return lathe([(0, 0), outside[0], *outside, *inside, (0, inside[-1][1])], 64)


def bowl_of_fruit(colors: int) -> Mesh:
    """A bowl (palette colour 0) with fruit in it (1, 2, ...), `colors` in all."""
    t = np.linspace(0.25, 1, 16)
    outside = np.stack([0.17 * t, 0.09 * t**3], axis=1)
    inside = outside[::-1] + np.array((-0.006, 0.004))
    parts = [paint(lathe([(0, 0), *outside, *inside, (0, inside[-1][1])], 48), 0.5 / colors)]
    for i in range(6):
        angle, ring = 1.26 * i, 0.075 if i < 5 else 0.0
        centre = (ring * np.cos(angle), 0.075 if i < 5 else 0.14, ring * np.sin(angle))
        fruit = at(ellipsoid((0.045, 0.042, 0.045), 24), *centre)
        parts.append(paint(fruit, (1.5 + i % (colors - 1)) / colors))
    return merge(*parts)


def frames(openings: list[tuple[float, float, float, float]], border: float = 0.04) -> Mesh:
    """Picture frames in the xy plane round (x, y, width, height) openings, centres given."""
    parts = []
    for x, y, w, h in openings:
        for side in (-1, 1):
            upright = rounded_box((border, h + 2 * border, 0.03), 0.01, 2)
            across = rounded_box((w, border, 0.03), 0.01, 2)
            parts.append(at(upright, x + side * (w + border) / 2, y, 0.015))
            parts.append(at(across, x, y + side * (h + border) / 2, 0.015))
    return merge(*parts)


def pictures(openings: list[tuple[float, float, float, float]]) -> Mesh:
    """What is in `frames(openings)`; the i-th picture is the i-th part of a texture along u."""
    parts = []
    for i, (x, y, w, h) in enumerate(openings):
        grid = np.stack(np.meshgrid([x - w / 2, x + w / 2], [y - h / 2, y + h / 2], [0.008],
                                    indexing="xy"), axis=-1)[:, :, 0]
        canvas = surface(grid)
        assert canvas.uv is not None
        uv = (canvas.uv + np.array((i, 0))) * (1 / len(openings), 1)
        parts.append(replace(canvas, uv=uv))
    return merge(*parts)


def curtain(width: float, height: float, pleats: int, seed: int) -> Mesh:
    """Cloth hanging down from the origin in the xy plane, its pleats opening downward."""
    u, v = np.meshgrid(np.linspace(0, 1, 12 * pleats + 1), np.linspace(0, 1, 24))
    phase = 2 * np.pi * (pleats * u + 0.15 * np.sin(2 * np.pi * (u + 0.1 * seed)))
    fold = (0.035 * (1 - 0.45 * v) * np.sin(phase)
            + 0.008 * np.sin(3 * phase + 5 * v + seed))
    x = width * (u - 0.5) * (0.86 + 0.14 * (1 - v) + 0.05 * np.sin(np.pi * v))
    return surface(np.stack([x, height * (v - 1), fold], axis=2))


def window_frame(width: float, height: float) -> Mesh:
    """Frame with a cross bar and a sill in the xy plane, and a curtain rod above it."""
    cross = [at(box((0.035, height, 0.03)), 0, 0, 0.015),
             at(box((width, 0.035, 0.03)), 0, 0.1, 0.015)]
    sill = at(rounded_box((width + 0.24, 0.04, 0.14), 0.015, 2), 0, -height / 2 - 0.08, 0.07)
    y, reach = height / 2 + 0.2, width / 2 + 0.42
    rod = between(0.014, (-reach, y, 0.11), (reach, y, 0.11))
    knobs = [at(ellipsoid((0.035, 0.035, 0.035), 16), side * reach, y, 0.11) for side in (-1, 1)]
    return merge(frames([(0, 0, width, height)], 0.06), *cross, sill, rod, *knobs)


def lamp_stand(height: float = 1.45) -> Mesh:
    """The foot and the pole of a floor lamp."""
    r = 0.014
    return lathe([(0, 0), (0.15, 0), (0.15, 0), (0.15, 0.015), (0.13, 0.03), (0.04, 0.04),
                  (r, 0.08), (r, height), (0.03, height + 0.01), (0.03, height + 0.05),
                  (0, height + 0.055)], 32)


def plant_pot() -> Mesh:
    """A pot with earth in it."""
    return lathe([(0, 0), (0.13, 0), (0.13, 0), (0.18, 0.28), (0.2, 0.28), (0.2, 0.33), (0.2, 0.33),
                  (0.17, 0.33), (0.17, 0.33), (0.165, 0.29), (0.165, 0.29), (0, 0.3)], 40)


def leaves(count: int, seed: int) -> Mesh:
    """Long leaves that rise from the origin and bend outward; cloth-thin."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(-1, 1, 5), np.linspace(0, 1, 15))
    parts = []
    for i in range(count):
        length, reach = rng.uniform(0.7, 1.15), rng.uniform(0.2, 0.62)
        width = 0.075 * np.sin(np.pi * np.clip(v, 0.02, 0.98) ** 0.75) + 0.004
        out = 0.04 + reach * v**1.8
        up = length * (v - 0.42 * reach * 1.6 * v**3) + 0.02 * u**2 * width / 0.08
        leaf = surface(np.stack([u * width, up, out], axis=2))
        parts.append(place(leaf, rotate(Y, 360 * (i * 0.381966) + rng.uniform(-9, 9))))
    return merge(*parts)


def clock_case() -> Mesh:
    """A round wall clock in the xy plane, its middle at the origin.

    Palette: 0 the dial, 1 the rest.
    """
    rim = place(torus(0.17, 0.022, 64), translate((0, 0, 0.05)) @ rotate(X, 90))
    dial = place(drum(0.17, 0, 0.05, 64), rotate(X, 90))
    marks = [place(box((0.012, 0.03, 0.006)), rotate(Z, 30 * i) @ translate((0, 0.13, 0.053)))
             for i in range(12)]
    hands = [place(box((0.014, length, 0.005)),
                   rotate(Z, angle) @ translate((0, length / 2 - 0.015, 0.056)))
             for angle, length in ((60, 0.09), (-60, 0.135))]
    return merge(paint(dial, 0.25), *(paint(part, 0.75) for part in (rim, *marks, *hands)))


def pendulum(length: float = 0.42) -> Mesh:
    """A rod with a bob that hangs from the origin."""
    bob = place(lathe([(0, -0.012), (0.05, -0.006), (0.055, 0), (0.05, 0.006), (0, 0.012)], 32),
                translate((0, -length, 0)) @ rotate(X, 90))
    return merge(between(0.006, (0, -length, 0), (0, 0, 0), 8), bob)


def mouldings(width: float, depth: float, height: float) -> Mesh:
    """Skirting boards and cornices along the four walls of a room centred at the origin."""
    parts = []
    for y, h, t in ((0.05, 0.1, 0.018), (height - 0.035, 0.07, 0.05)):
        for side in (-1, 1):
            parts.append(at(box((width, h, t)), 0, y, side * (depth - t) / 2))
            parts.append(at(box((t, h, depth)), side * (width - t) / 2, y, 0))
    return merge(*parts)


def rim(width: float, depth: float, height: float, border: float) -> Mesh:
    """An open rectangular rim in the xz plane round width x depth, from y = 0 down to -height."""
    parts = []
    for side in (-1, 1):
        x, y, z = side * (width + border) / 2, -height / 2, side * (depth + border) / 2
        parts.append(at(box((width + 2 * border, height, border)), 0, y, z))
        parts.append(at(box((border, height, depth)), x, y, 0))
    return merge(*parts)
