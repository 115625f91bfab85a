"""The sun of a sky: the brightest spot of an environment, told apart from the rest of it.

Symbols: L(w) radiance of the environment from direction w; s the sun's axis, R the chord from s to
its rim: it is the directions with |w - s| < R, whose solid angle is pi R^2.

An environment is one emitter. Were its sun in one group with the sky (`scene_lights.py`), the
visibility would be noise of which of the two was picked, also in the hard shadow of the sun. So it
is a light, with strata of its own, and what the environment's own strata find in it counts nothing.

Its directions, uniform in its solid angle for uniform u and v, are

    t = R^2 u,   w = (1 - t / 2) s + sqrt(t (1 - t / 4)) (cos(2 pi v), sin(2 pi v)).

They are picked in proportion to radiance, or nearly: the square of (u, v) is cut into cells, and
each has a number of equal shares of the first random number, at least one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import numpy as np

from onespp.render.host.aligned import owned
from onespp.render.mitsuba.variant import mi

SUN_BIT = 128
"""Of a stratum's word: it is the sun's, and the emitter is the environment."""

_ROWS, _COLUMNS = 1024, 2048
_WIDEST = np.radians(20)
_RIM = 0.02  # of the brightest radiance
_BRIGHTER = 16  # than all around, as means
_SIDE = 32  # cells, of u and of v
_SHARES = 16384
_FINER = 4  # points of a cell along each side, of which its radiance is the mean


@dataclass
class Sun:
    """axis: s, world. square: R^2. emitter: index of the environment in `scene.emitters()`. shares:
    of each, the cell, and `_SIDE` squared times how many it has."""

    axis: mi.Vector3f
    square: mi.Float
    emitter: mi.UInt32
    shares: mi.UInt32

    def told_apart(self, scene: mi.Scene, si: mi.SurfaceInteraction3f, stratum: mi.UInt32,
                   sample: mi.Point2f, light: mi.DirectionSample3f, weight: mi.Color3f,
                   active: mi.Bool) -> tuple[mi.DirectionSample3f, mi.Color3f]:
        """A sample of an emitter, and its radiance over its density; of the sun in its strata.

        The density in it stays that of the emitter's own sampling, which weights of multiple
        importance sampling are made of.
        """
        inside = dr.squared_norm(light.d - self.axis) < self.square
        weight = dr.select((stratum >> 8 == self.emitter) & inside, 0, weight)

        of_sun = (stratum & SUN_BIT) != 0
        active = active & of_sun
        place = sample.x * _SHARES
        share = dr.minimum(mi.UInt32(place), _SHARES - 1)
        word = dr.gather(mi.UInt32, self.shares, share, active)
        cell = word & (_SIDE**2 - 1)
        row = cell // _SIDE
        d = self.direction((mi.Float(row) + place - share) / _SIDE,
                           (mi.Float(cell - row * _SIDE) + sample.y) / _SIDE)
        environment = scene.environment()
        light.d = dr.select(of_sun, d, light.d)
        light.p = dr.select(of_sun, si.p + light.dist * d, light.p)
        light.n = dr.select(of_sun, -d, light.n)
        light.pdf = dr.select(of_sun, environment.pdf_direction(si, light, active), light.pdf)
        one_over_density = dr.pi * self.square * (_SHARES / _SIDE**2) / (word // _SIDE**2)
        return light, dr.select(of_sun, _radiance(environment, d, active) * one_over_density,
                                weight)

    def direction(self, u: mi.Float, v: mi.Float) -> mi.Vector3f:
        """w."""
        t = self.square * u
        sine, cosine = dr.sincos(dr.two_pi * v)
        frame = mi.Frame3f(self.axis)
        return ((1 - 0.5 * t) * self.axis
                + dr.sqrt(t * (1 - 0.25 * t)) * (cosine * frame.s + sine * frame.t))


def find_sun(scene: mi.Scene) -> Sun | None:
    """The sun of a scene's environment, None where nothing in it is small and bright."""
    environment = scene.environment()
    if environment is None:
        return None
    row, column = _places(_ROWS, _COLUMNS)
    polar, around = row * (dr.pi / _ROWS), column * (dr.two_pi / _COLUMNS)
    d = mi.Vector3f(dr.sin(polar) * dr.cos(around), dr.cos(polar), dr.sin(polar) * dr.sin(around))
    light = _luminances(environment, d)
    if not light.max() > _BRIGHTER * light.mean():
        return None
    found = spot(light, d.numpy().T.astype(np.float64), dr.sin(polar).numpy())
    if found is None:
        return None
    index = next(i for i, e in enumerate(scene.emitters()) if e.is_environment())
    sun = Sun(dr.opaque(mi.Vector3f, found[0].tolist()), dr.opaque(mi.Float, found[1]),
              dr.opaque(mi.UInt32, index), mi.UInt32(0))
    row, column = _places(_SIDE * _FINER, _SIDE * _FINER)
    finer = sun.direction(row / (_SIDE * _FINER), column / (_SIDE * _FINER))
    cells = _luminances(environment, finer).reshape(_SIDE, _FINER, _SIDE, _FINER).mean((1, 3))
    return replace(sun, shares=owned(mi.UInt32, shared_out(cells.ravel())))


def _places(rows: int, columns: int) -> tuple[mi.Float, mi.Float]:
    """(row, column) of the middles of a grid's cells, row by row."""
    lane = dr.arange(mi.UInt32, rows * columns)
    row = lane // columns
    return mi.Float(row) + 0.5, mi.Float(lane - row * columns) + 0.5


def _luminances(environment: mi.Emitter, d: mi.Vector3f) -> np.ndarray:
    """(n,) float64, from n directions."""
    with dr.suspend_grad():
        light = mi.luminance(_radiance(environment, d)).numpy().astype(np.float64)
    return np.broadcast_to(light, dr.width(d))


def _radiance(environment: mi.Emitter, d: mi.Vector3f, active: mi.Bool | bool = True) -> mi.Color3f:
    """L of directions."""
    seen = dr.zeros(mi.SurfaceInteraction3f)
    seen.wi = -d
    return environment.eval(seen, active)


def shared_out(light: np.ndarray) -> np.ndarray:
    """`Sun.shares` by luminance, (n,), of n = `_SIDE`^2 cells."""
    wanted = light / light.sum() * (_SHARES - len(light))
    count = 1 + wanted.astype(int)
    most = np.argsort(count - 1 - wanted, kind="stable")[:_SHARES - count.sum()]
    count[most] += 1
    cells = np.arange(len(light))
    return np.repeat(cells + len(light) * count, count).astype(np.uint32)


def spot(light: np.ndarray, directions: np.ndarray, areas: np.ndarray
         ) -> tuple[np.ndarray, float] | None:
    """s and R^2 of the brightest spot of (n,) luminances, None where it is not small and bright.

    Args:
        directions: (n, 3), of length 1. areas: (n,), of the pixels, up to a factor.
    """
    brightest = directions[light.argmax()]
    near = (directions @ brightest > np.cos(_WIDEST)) & (light >= _RIM * light.max())
    axis = (light * areas)[near] @ directions[near]
    axis /= np.linalg.norm(axis)
    step = np.sqrt(2) * np.pi / _ROWS
    chord = np.linalg.norm(directions[near] - axis, axis=1).max() + step
    inside = np.linalg.norm(directions - axis, axis=1) < chord
    within, beyond = (np.average(light[part], weights=areas[part]) for part in (inside, ~inside))
    if chord > 2 * np.sin(_WIDEST / 2) or within < _BRIGHTER * beyond:
        return None
    return axis, float(chord**2)
