"""The balls of a scene, which of them a vertex looks at, and how likely what it finds there is.

Balls are spheres of smooth glass without maps, denser than what is around them, and of smooth
metal. One is drawn in proportion to its (r / d)^2, r its radius and d the distance of its centre,
which is its solid angle where it is far.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import numpy as np

from onespp.render.host.aligned import owned
from onespp.render.mitsuba.images import shape_index
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi

from .ways import NEAREST, Ways

_POINTS = 2, 16      # of lights that a frame's first vertex compares, at least and at most, and
_POINTS_PER = 40     # times the root of the sum of (r / d)^2 of metal; others one
_DIRECTIONS = 32     # toward glass that it compares, at most,
_DIRECTIONS_PER = 64  # and times the root of that sum of glass,
_LEAST = 0.1         # none where that is less
_BOUNDED = 4        # lights, of which each has a sphere around it; more share one
_MOST_LIGHTS = 64   # with a sphere around
_MARGIN = 1.001     # of such a sphere


@dataclass
class Seen:
    """A ball from a vertex.

    centre, radius: of it. index: of refraction, 0 where nothing goes through. toward: direction of
    its centre. near: radius over distance of that.
    """

    centre: mi.Point3f
    radius: mi.Float
    index: mi.Float
    toward: mi.Vector3f
    near: mi.Float

    @property
    def per_angle(self) -> mi.Float:
        """One over its solid angle."""
        square = dr.square(self.near)
        return (1 + dr.safe_sqrt(1 - square)) / (dr.two_pi * square)

    @property
    def is_outside(self) -> mi.Bool:
        """Whether the vertex is."""
        return self.near < 1 / NEAREST

    def ways_to(self, distance: mi.Float, is_far: mi.Bool) -> Ways:
        """Those to a light at a distance from its centre; is_far: it is the sky."""
        return Ways(self.near, dr.select(is_far, 0, self.radius / distance))


@dataclass
class Draws:
    """Of balls, at a vertex: how many, and (r / d)^2 of each ball that may be drawn, 0 of others.
    (Scenes have 16 balls at most that count, `MOST` of `images.py`.)"""

    number: mi.UInt32
    shares: list[mi.Float]

    def density(self, ball: mi.UInt32) -> mi.Float:
        """How often a ball is drawn."""
        first, *others = self.shares
        if not others:
            return mi.Float(self.number)
        share = first
        for i, other in enumerate(others, 1):
            share = dr.select(ball == i, other, share)
        return dr.select(share > 0, self.number * share / sum(self.shares), 0)

    def drawn(self, u: mi.Float) -> mi.UInt32:
        """A ball, by a uniform random number: equal steps of it are spread over the balls."""
        sought, below, ball = u * sum(self.shares), mi.Float(0), mi.UInt32(0)
        for share in self.shares[:-1]:
            below = below + share
            ball += dr.select(sought >= below, mi.UInt32(1), 0)
        return ball


@dataclass
class Balls:
    """Those of a scene as it stands, M of them.

    shapes: indices in the JIT registry. places: four numbers each, centre and radius. indices: of
    refraction, 0 where nothing goes through. rows: by registry index, which ball it is, from 1; 0:
    none. is_glass: whether something goes through each. lights: spheres around what shines, four
    numbers each; None where it is not known, or there is a sky; bounds: how many.
    """

    shapes: mi.UInt32
    places: mi.Float
    indices: mi.Float
    rows: mi.UInt32
    is_glass: tuple[bool, ...]
    lights: mi.Float | None
    bounds: int

    def row(self, shape: mi.ShapePtr, active: mi.Bool) -> mi.UInt32:
        """Of a shape."""
        return dr.gather(mi.UInt32, self.rows, shape_index(shape, active), active)

    def place(self, ball: mi.UInt32, active: mi.Bool) -> tuple[mi.Point3f, mi.Float]:
        """Centre and radius."""
        return _sphere(self.places, ball, active)

    def seen(self, ball: mi.UInt32, x: mi.Point3f, active: mi.Bool) -> Seen:
        """From a vertex."""
        centre, radius = self.place(ball, active)
        distance = dr.norm(centre - x)
        return Seen(centre, radius, dr.gather(mi.Float, self.indices, ball, active),
                    (centre - x) / distance, radius / distance)

    def draws(self, x: mi.Point3f, is_first: mi.Bool | None) -> tuple[Draws, Draws | None]:
        """Of balls at a vertex, one for each point of a light, and for each direction toward glass;
        None where there are none.

        Args:
            is_first: whether it is the first of a frame's path; None: it is of a reference's.
        """
        shares = [self._share(x, ball) for ball in range(len(self.is_glass))]
        if is_first is None:
            return Draws(mi.UInt32(1), shares), None
        glass, metal = ([share if is_so is wanted else mi.Float(0)
                         for share, is_so in zip(shares, self.is_glass, strict=True)]
                        for wanted in (True, False))
        least, most = _POINTS
        points = mi.UInt32(dr.clip(_root(metal) * _POINTS_PER, least, most))
        to_points = Draws(dr.select(is_first, points, 1), shares)
        if not any(self.is_glass):
            return to_points, None
        near = _root(glass)
        directions = mi.UInt32(dr.minimum(near * _DIRECTIONS_PER, mi.Float(_DIRECTIONS)))
        return to_points, Draws(dr.select(is_first & (near > _LEAST), directions, 0), glass)

    def may_shine(self, start: mi.Point3f, along: mi.Vector3f) -> mi.Bool:
        """Whether a ray may come to a light."""
        if self.lights is None:
            return mi.Bool(True)
        meets = mi.Bool(False)
        for i in range(self.bounds):
            centre, radius = _sphere(self.lights, mi.UInt32(i), mi.Bool(True))
            to_centre = centre - start
            ahead, squared = dr.dot(to_centre, along), dr.squared_norm(to_centre)
            inside = squared < dr.square(radius)
            meets |= inside | ((ahead > 0) & (squared - dr.square(ahead) < dr.square(radius)))
        return meets

    def density(self, x: mi.Point3f, hit: mi.DirectionSample3f, si: mi.SurfaceInteraction3f,
                emitter_pdf: mi.Float, ball: mi.UInt32, sine: mi.Float, refracted: mi.Bool,
                is_first: mi.Bool | None, active: mi.Bool) -> mi.Float:
        """Of light sampling over solid angle at x, of a direction that went by a ball to a light.

        Args:
            hit: the light, from the ball's centre. si: where it was met. emitter_pdf: over solid
                angle there. sine: of the angle at which the ball was. refracted: whether it went
                through. is_first: of `draws`.
        """
        seen = self.seen(ball, x, active)
        to_points, to_glass = self.draws(x, is_first)
        density = (density_of_points(seen, hit, si, emitter_pdf, sine, refracted)
                   * to_points.density(ball))
        if to_glass is not None:
            aimed = dr.select(refracted & seen.is_outside,
                              to_glass.density(ball) * seen.per_angle, 0)
            density = together(density, aimed)
        return dr.select(active, density, 0)

    def _share(self, x: mi.Point3f, ball: int) -> mi.Float:
        centre, radius = self.place(mi.UInt32(ball), mi.Bool(True))
        return dr.minimum(dr.square(radius) / dr.squared_norm(centre - x), 1)


def density_of_points(seen: Seen, hit: mi.DirectionSample3f, si: mi.SurfaceInteraction3f,
                      emitter_pdf: mi.Float, sine: mi.Float, refracted: mi.Bool) -> mi.Float:
    """Over solid angle at the vertex, of points of lights that are drawn as if from the centre of
    a ball; arguments as of `Balls.density`."""
    is_far = ~si.is_valid()
    ways = seen.ways_to(dr.norm(si.p - seen.centre), is_far)
    inverse = dr.select(refracted, dr.rcp(seen.index), 0)
    spread = ways.spread(sine, *ways.turned(dr.safe_asin(sine), inverse))
    facing = dr.dot(hit.n, si.to_world(si.wi)) / dr.dot(hit.n, hit.d)
    density = emitter_pdf / (spread * dr.select(is_far, 1, dr.abs(facing)))
    return dr.select(ways.possible & dr.isfinite(density), density, 0)


def _root(shares: list[mi.Float]) -> mi.Float:
    """Of their sum."""
    return dr.sqrt(mi.Float(sum(shares)))


def together(points: mi.Float, directions: mi.Float) -> mi.Float:
    """What counts of two densities by the power heuristic, which adds up squares."""
    return dr.sqrt(dr.square(points) + dr.square(directions))


def find_balls(stage: MitsubaScene) -> Balls | None:
    """Of a scene, at its frame; None where there are none, or rays go through something."""
    if not stage.images.round or stage.clear is not None:
        return None
    shapes, places, indices = stage.balls()
    lights, bounds = _around_lights(stage.mi_scene)
    return Balls(owned(mi.UInt32, shapes), owned(mi.Float, places.ravel()),
                 owned(mi.Float, indices), stage.images.numbered(shapes, places[:, 3] > 0),
                 tuple(bool(index > 0) for index in indices), lights, bounds)


def _around_lights(scene: mi.Scene) -> tuple[mi.Float | None, int]:
    """`lights` and `bounds` of `Balls`."""
    emitters = scene.emitters()
    if scene.environment() is not None or len(emitters) > _MOST_LIGHTS:
        return None, 0
    shapes = [emitter.get_shape() for emitter in emitters]
    boxes = [shape.bbox() for shape in shapes if shape is not None]
    corners = np.array([[box.min, box.max] for box in boxes], np.float64).reshape(-1, 2, 3)
    if len(corners) > _BOUNDED:
        corners = np.stack([corners[:, 0].min(0), corners[:, 1].max(0)])[None]
    radii = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=-1) / 2
    spheres = np.column_stack([corners.mean(1), radii * _MARGIN]).astype(np.float32)
    return owned(mi.Float, np.append(spheres.ravel(), np.zeros(4, np.float32))), len(spheres)


def _sphere(table: mi.Float, row: mi.UInt32, active: mi.Bool) -> tuple[mi.Point3f, mi.Float]:
    x, y, z, r = (dr.gather(mi.Float, table, 4 * row + i, active) for i in range(4))
    return mi.Point3f(x, y, z), r
