"""Toys as meshes painted with a palette: each function returns one object, in metres, y up.

They face +z and stand at y = 0, except the mobile, which hangs from the origin.
"""

from __future__ import annotations

import numpy as np

from onespp.scenes.description import Mesh
from onespp.scenes.meshes import box, ellipsoid, lathe, merge, paint, place, rounded_box, torus
from onespp.scenes.transforms import Vector, rotate, translate

from .furniture import at, between, drum

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)


def teddy(colors: int = 3) -> Mesh:
    """A sitting bear, 0.4 high: palette 0 fur, 1 muzzle and paws, 2 eyes and nose."""
    def blob(color: int, radii: Vector, *centre: float) -> Mesh:
        return paint(at(ellipsoid(radii, 24), *centre), (color + 0.5) / colors)

    parts = [blob(0, (0.11, 0.13, 0.1), 0, 0.13, 0),
             blob(0, (0.095, 0.085, 0.085), 0, 0.32, 0.01),
             blob(1, (0.045, 0.035, 0.04), 0, 0.3, 0.085),
             blob(2, (0.016, 0.012, 0.012), 0, 0.315, 0.122)]
    for side in (-1, 1):
        parts += [blob(0, (0.036, 0.036, 0.02), side * 0.075, 0.4, 0),
                  blob(1, (0.022, 0.022, 0.01), side * 0.075, 0.4, 0.016),
                  blob(2, (0.011, 0.011, 0.008), side * 0.035, 0.345, 0.088),
                  blob(0, (0.045, 0.085, 0.045), side * 0.12, 0.17, 0.05),
                  blob(0, (0.05, 0.048, 0.1), side * 0.075, 0.05, 0.12),
                  blob(1, (0.036, 0.036, 0.012), side * 0.075, 0.05, 0.212)]
    return merge(*parts)


def train_track(radius: float) -> Mesh:
    """A ring of sleepers with two rails; the middle of the track is at `radius`."""
    low, high = 0.012, 0.024
    rails = [lathe([(r - 0.008, low), (r + 0.008, low), (r + 0.008, low), (r + 0.008, high),
                    (r + 0.008, high), (r - 0.008, high), (r - 0.008, high), (r - 0.008, low)], 96)
             for r in (radius - 0.05, radius + 0.05)]
    sleeper = at(box((0.16, 0.012, 0.035)), radius, 0.006, 0)
    count = round(2 * np.pi * radius / 0.12)
    return merge(*rails, *(place(sleeper, rotate(Y, 360 * i / count)) for i in range(count)))


def _wheels(z_positions: Vector, radius: float = 0.035) -> list[Mesh]:
    wheel = drum(radius, -0.01, 0.01)
    return [place(wheel, translate((x, radius, z)) @ rotate(Z, 90))
            for z in z_positions for x in (-0.055, 0.055)]


def locomotive(colors: int = 4) -> Mesh:
    """A toy engine that drives towards +z: palette 0 body, 1 cabin and bands, 2 wheels, 3 brass."""
    boiler = place(lathe([(0, 0), (0.05, 0), (0.05, 0), (0.05, 0.2), (0.04, 0.215), (0, 0.22)], 32),
                   translate((0, 0.115, -0.04)) @ rotate(X, 90))
    chimney = at(lathe([(0, 0), (0.017, 0), (0.017, 0.05), (0.028, 0.08), (0.028, 0.08), (0, 0.08)],
                       24), 0, 0.155, 0.12)
    bands = [place(torus(0.051, 0.005, 32), translate((0, 0.115, z)) @ rotate(X, 90))
             for z in (0.02, 0.1)]
    dome = at(ellipsoid((0.024, 0.03, 0.024), 20), 0, 0.165, 0.04)
    groups = [
        (0, [boiler, at(rounded_box((0.11, 0.03, 0.34), 0.008, 2), 0, 0.06, 0.01)]),
        (1, [at(rounded_box((0.12, 0.13, 0.11), 0.01, 2), 0, 0.14, -0.1),
             at(rounded_box((0.15, 0.015, 0.14), 0.007, 2), 0, 0.212, -0.1)]),
        (2, [*_wheels((-0.1, 0.02, 0.12)), chimney]),
        (3, [dome, *bands]),
    ]
    return merge(*(paint(mesh, (i + 0.5) / colors) for i, meshes in groups for mesh in meshes))


def wagon(colors: int = 4) -> Mesh:
    """A toy wagon with a load of balls, in the palette of `locomotive`."""
    load = [at(ellipsoid((0.034, 0.034, 0.034), 20), x, 0.125, z)
            for x, z in ((-0.02, -0.07), (0.022, -0.01), (-0.015, 0.06))]
    groups = [(1, [at(rounded_box((0.12, 0.07, 0.24), 0.008, 2), 0, 0.085, 0)]),
              (2, _wheels((-0.07, 0.07))), (3, load)]
    return merge(*(paint(mesh, (i + 0.5) / colors) for i, meshes in groups for mesh in meshes))


def mobile(colors: int) -> Mesh:
    """A nursery mobile that hangs from the origin: two crossed arms with balls and rings."""
    drop, parts = 0.7, [paint(between(0.003, (0, -0.7, 0), (0, 0, 0), 6), 0.5 / colors)]
    for i in range(6):
        angle, low = np.pi * i / 3, drop + (0.14 if i % 2 else 0.24)
        x, z = 0.3 * np.cos(angle), 0.3 * np.sin(angle)
        parts += [paint(between(0.005, (0, -drop, 0), (x, -drop, z), 8), 0.5 / colors),
                  paint(between(0.002, (x, -low, z), (x, -drop, z), 6), 0.5 / colors)]
        thing = (ellipsoid((0.06, 0.06, 0.06), 24) if i % 2
                 else place(torus(0.06, 0.022, 32), rotate((1, 0, 0), 90) @ rotate(Z, 30 * i)))
        parts.append(paint(at(thing, x, -low - 0.06, z), (1.5 + i % (colors - 1)) / colors))
    return merge(*parts)
