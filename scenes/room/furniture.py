"""Furniture as meshes: each function returns one object, in metres, y up, feet at y = 0.

Things face +z.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from onespp.scenes.description import Mesh
from onespp.scenes.meshes import box, ellipsoid, lathe, merge, paint, place, rounded_box, surface
from onespp.scenes.transforms import Vector, rotate, translate

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)


def at(mesh: Mesh, *position: float) -> Mesh:
    return place(mesh, translate(position))


def drum(radius: float, low: float, high: float, segments: int = 24) -> Mesh:
    """An upright cylinder with flat ends."""
    side = [(radius, low), (radius, high)]
    return lathe([(0, low), side[0], *side, side[1], (0, high)], segments)


def between(radius: float, start: Vector, end: Vector, segments: int = 16) -> Mesh:
    """A round rod from `start` to `end`."""
    along = np.asarray(end, float) - np.asarray(start, float)
    length = float(np.linalg.norm(along))
    rod = drum(radius, 0, length, segments)
    axis, way = np.cross(Y, along), along[1] / length
    turn = np.degrees(np.arccos(np.clip(way, -1, 1)))
    upright = np.linalg.norm(axis) < 1e-9
    return place(rod, translate(start) @ rotate(np.array(X) if upright else axis, turn))


def sofa(width: float = 2.1) -> Mesh:
    """A two-seater: base, seats, back cushions, round arms, short legs."""
    inner = width - 0.44
    seats = [at(rounded_box((inner / 2 - 0.01, 0.2, 0.7), 0.07), side * inner / 4, 0.4, 0.06)
             for side in (-1, 1)]
    backs = [place(rounded_box((inner / 2 - 0.02, 0.5, 0.2), 0.08),
                   translate((side * inner / 4, 0.7, -0.24)) @ rotate(X, -12)) for side in (-1, 1)]
    arms = [at(rounded_box((0.22, 0.52, 0.9), 0.09), side * (width - 0.22) / 2, 0.36, 0)
            for side in (-1, 1)]
    base = at(rounded_box((width - 0.1, 0.2, 0.84), 0.03), 0, 0.22, 0)
    back = at(rounded_box((width - 0.06, 0.78, 0.16), 0.07), 0, 0.47, -0.4)
    legs = [between(0.03, (x, 0, z), (x, 0.14, z)) for x in (-width / 2 + 0.15, width / 2 - 0.15)
            for z in (-0.34, 0.34)]
    return merge(*seats, *backs, *arms, base, back, *legs)


def cushion(size: float = 0.42) -> Mesh:
    """A pillow with pinched corners, standing in the xy plane, centre at the origin."""
    u, v = np.meshgrid(np.linspace(-1, 1, 33), np.linspace(-1, 1, 33))
    swell = 0.17 * size * np.maximum((1 - u**4) * (1 - v**4), 0) ** 0.6
    waist = size / 2 * (1 - 0.07 * (1 - u**2)), size / 2 * (1 - 0.07 * (1 - v**2))
    front = surface(np.stack([u * waist[1], v * waist[0], swell], axis=2))
    return merge(front, place(front, rotate(Y, 180)))


def table(size: Vector = (1.1, 0.42, 0.6)) -> Mesh:
    """A low table: a rounded top, turned legs that splay out, a shelf below."""
    width, height, depth = size
    x, z = width / 2 - 0.1, depth / 2 - 0.1
    legs = [between(0.022, (sx * (x + 0.06), 0, sz * (z + 0.06)), (sx * x, height - 0.03, sz * z))
            for sx in (-1, 1) for sz in (-1, 1)]
    top = at(rounded_box((width, 0.04, depth), 0.018), 0, height - 0.02, 0)
    shelf = at(rounded_box((2 * x, 0.02, 2 * z), 0.009), 0, 0.17, 0)
    return merge(top, shelf, *legs)


def rug(width: float, depth: float, thickness: float = 0.015) -> Mesh:
    return at(rounded_box((width, thickness, depth), thickness / 2.5), 0, thickness / 2, 0)


def shelf(size: Vector, boards: int) -> Mesh:
    """An open shelf with its back to -z and `boards` compartments."""
    width, height, depth = size
    t = 0.03
    sides = [at(box((t, height, depth)), side * (width - t) / 2, height / 2, 0) for side in (-1, 1)]
    planks = [at(box((width - 2 * t, t, depth - 0.01)), 0, y, 0.004)
              for y in np.linspace(0.08, height - t / 2, boards + 1)]
    back = at(box((width - 2 * t, height - 0.02, 0.01)), 0, height / 2, -depth / 2 + 0.006)
    foot = at(box((width - 2 * t, 0.06, depth - 0.04)), 0, 0.03, 0)
    return merge(*sides, *planks, back, foot)


def books(size: Vector, boards: int, colors: int, seed: int) -> Mesh:
    """Rows of books for `shelf(size, boards)`, painted with a palette of `colors`."""
    width, height, depth = size
    rng = np.random.default_rng(seed)
    levels = np.linspace(0.08, height - 0.015, boards + 1)
    room_above = levels[1] - levels[0] - 0.03
    parts = []
    for floor in levels[:-1] + 0.0155:
        x, end = -width / 2 + 0.04, width / 2 - 0.05 - rng.uniform(0, 0.35) * width
        while True:
            book = np.array([rng.uniform(0.022, 0.055), rng.uniform(0.62, 0.9) * room_above,
                             rng.uniform(0.55, 0.75) * depth])
            if x + book[0] > end:
                break
            z = depth / 2 - book[2] / 2 - rng.uniform(0.02, 0.05)
            spine = rounded_box(book, 0.006, 2)
            color = (rng.integers(colors) + 0.5) / colors
            parts.append(paint(at(spine, x + book[0] / 2, floor + book[1] / 2, z), color))
            x += book[0] + rng.choice([0.002, 0.004])
    return merge(*parts)


def drawers(size: Vector, rows: int) -> Mesh:
    """A chest of drawers, two to a row, with round knobs and short legs."""
    width, height, depth = size
    leg, t = 0.1, 0.025
    body = at(box((width - 0.02, height - leg - t, depth - 0.03)),
              0, (height + leg - t) / 2, -0.015)
    top = at(rounded_box((width, t, depth), 0.01, 2), 0, height - t / 2, 0)
    legs = [between(0.022, (x, 0, z), (x, leg, z)) for x in (0.06 - width / 2, width / 2 - 0.06)
            for z in (0.06 - depth / 2, depth / 2 - 0.08)]
    row = (height - leg - t) / rows
    parts = []
    for i in range(rows):
        for side in (-1, 1):
            x, y = side * (width - 0.02) / 4, leg + row * (i + 0.5)
            front = rounded_box((width / 2 - 0.04, row - 0.03, 0.03), 0.008, 2)
            parts += [at(front, x, y, depth / 2 - 0.025),
                      at(ellipsoid((0.018, 0.018, 0.014), 16), x, y, depth / 2 + 0.002)]
    return merge(body, top, *legs, *parts)


def rocking_chair() -> Mesh:
    """A chair on two runners that are arcs about the point (0, 1.1, 0), lowest at the origin."""
    centre, parts = 1.1, []
    angles = np.radians(np.linspace(-33, 33, 23))
    arc = np.stack([np.zeros(23), 0.018 + centre * (1 - np.cos(angles)),
                    centre * np.sin(angles)], axis=1)
    for x in (-0.25, 0.25):
        runner = arc + np.array((x, 0, 0))
        parts += [between(0.018, a, b, 10) for a, b in pairwise(runner)]
        parts += [between(0.018, (x, 0.06, -0.26), (x, 1.05, -0.4)),
                  between(0.018, (x, 0.06, 0.26), (x, 0.62, 0.24)),
                  place(rounded_box((0.06, 0.03, 0.58), 0.013, 2), translate((x, 0.63, -0.02)))]
    seat = place(rounded_box((0.54, 0.045, 0.52), 0.02),
                 translate((0, 0.4, -0.01)) @ rotate(X, -5))
    slats = [between(0.011, (x, 0.4, -0.3), (x, 1.0, -0.39), 10)
             for x in np.linspace(-0.18, 0.18, 6)]
    crest = place(rounded_box((0.58, 0.13, 0.03), 0.014),
                  translate((0, 1.04, -0.4)) @ rotate(X, -8))
    rung = between(0.012, (-0.25, 0.2, 0.25), (0.25, 0.2, 0.25), 10)
    return merge(seat, crest, rung, *slats, *parts)
