"""Light by way of smooth balls: a vertex looks for it, through them and in them, as for light.

A lamp that shines on a floor through a ball of glass is found only by directions that a BSDF's
sample draws, by rare chance if it is small. But by way of a ball all is in one plane. With x a
vertex, y a point of a light, d1 and d2 their distances from the centre c of a ball of radius 1, and
eta its index of refraction, a way that meets the ball at an angle t to its normal goes round c by

    pi + g(t),  g(t) = 2 t - 2 asin(sin t / eta) - asin(sin t / d1) - asin(sin t / d2),   through,
    h(t) = 2 t - asin(sin t / d1) - asin(sin t / d2),                                     reflected.

From x to y that has to be as much as the angle between them at c, this way round or the other: g is
-e or e, h is pi - e, with e the angle by which they are not opposite. g is convex, as h is, and
g(0) = 0, so there are at most four such ways, and Newton's method finds each from where it begins
(t = pi/2, or 0) without a step beyond. One of them is traced, drawn in proportion to what it may
bring; at a path's first vertex, of those to several y. y is drawn by Mitsuba's own emitter sampling
as if from c, with density p there; a beam of a solid angle at x has at y, seen from c, 1/K of that,

    K = sin t cos t / (d1^2 cos a cos b sin e |g'(t)|),  sin a = sin t / d1, sin b = sin t / d2,

so that the density of the direction that leaves x is p |n . (y - c)| / (d2 K |n . o|), with o the
direction that arrives at y and n the normal there. Weights of multiple importance sampling are by
that one, and a sampled direction that comes by one ball to a light is weighed likewise: where ways
run together it is of no use, and weighs nothing.

Of a frame's path the first vertices alone look for it (`path.py`), of a reference's all.

Balls are spheres of smooth glass without maps, denser than what is around them, and of smooth
metal. What is reflected inside of them, or comes by two, is left to chance, and all in scenes in
which shadow rays go through something (`panes.py`); points that shine are not looked for, which
Mitsuba's `path` does not find in glass either.

Source: manifold next-event estimation (Hanika et al. 2015), of spheres, whose ways are found
without a walk, and all of them; weights and densities are our own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from onespp.render.host.aligned import owned
from onespp.render.mitsuba.images import shape_index
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.sampler import Sampler

from .reservoir import offered
from .strata import power_heuristic

_STEPS = 20      # of Newton's method: where two ways are nearly one, each halves the error
_STILL = 1e-6    # radians
_SOLVED = 1e-5
_AT_FIRST = 4    # points of lights that the first vertex of a path compares,
_CLOSE, _AT_CLOSE = 0.4, 16  # and where it is so close to a ball, as radius over distance
_SHIFT = (0.7548776662, 0.5698402910)  # from one to the next (R2, Roberts 2018)
_NEAREST = 1.0001  # distances from a centre, radii


@dataclass
class Balls:
    """Those of a scene as it stands, M of them.

    shapes: indices in the JIT registry. places: four numbers each, centre and radius. indices: of
    refraction, 0 where nothing goes through. rows: by registry index, which ball it is, from 1; 0:
    none. count: M.
    """

    shapes: mi.UInt32
    places: mi.Float
    indices: mi.Float
    rows: mi.UInt32
    count: int

    def row(self, shape: mi.ShapePtr, active: mi.Bool) -> mi.UInt32:
        """Of a shape."""
        return dr.gather(mi.UInt32, self.rows, shape_index(shape, active), active)

    def place(self, ball: mi.UInt32, active: mi.Bool) -> tuple[mi.Point3f, mi.Float]:
        """Centre and radius."""
        x, y, z, r = (dr.gather(mi.Float, self.places, 4 * ball + i, active) for i in range(4))
        return mi.Point3f(x, y, z), r

    def index(self, ball: mi.UInt32, active: mi.Bool) -> mi.Float:
        """Of refraction, 0 where nothing goes through."""
        return dr.gather(mi.Float, self.indices, ball, active)

    def share_of_pdf(self, x: mi.Point3f, hit: mi.DirectionSample3f, si: mi.SurfaceInteraction3f,
                     ball: mi.UInt32, sine: mi.Float, refracted: mi.Bool, active: mi.Bool,
                     is_first: mi.Bool | None) -> mi.Float:
        """The density over solid angle at x of a direction that went by a ball to a light, over
        that at its centre of the direction from there.

        Args:
            hit: the latter. si: where the light was met. sine: of the angle at which the ball was.
            is_first: whether x is a frame's path's first vertex; None: it is none.
        """
        c, r = self.place(ball, active)
        far = ~si.is_valid()
        near = r / dr.norm(x - c)
        ways = _Ways(near, dr.select(far, 0, r / dr.norm(si.p - c)))
        inverse = dr.select(refracted, dr.rcp(self.index(ball, active)), 0)
        spread = ways.spread(sine, *ways.turned(dr.safe_asin(sine), inverse))
        facing = dr.dot(hit.n, si.to_world(si.wi)) / dr.dot(hit.n, hit.d)
        share = 1 / (self.count * spread * dr.select(far, 1, dr.abs(facing)))
        if is_first is not None:
            share *= _compared(near, is_first)
        return dr.select(active & ways.possible & dr.isfinite(share), share, 0)


@dataclass
class _Ways:
    """By a ball, between points of these inverse distances from its centre, radii."""

    near: mi.Float
    far: mi.Float

    @property
    def possible(self) -> mi.Bool:
        """Whether both points are outside."""
        return dr.maximum(self.near, self.far) < 1 / _NEAREST

    def turned(self, t: Any, inverse: Any) -> tuple[Any, Any]:
        """g and g' at angles; with an inverse index of refraction of 0 h and h'."""
        s, c = dr.sincos(t)
        twice = dr.select(inverse > 0, 2, 0)
        g = 2 * t - twice * dr.safe_asin(s * inverse)
        slope = 2 - c * twice * inverse * _rsqrt(s * inverse)
        for part in (self.near, self.far):
            g -= dr.safe_asin(s * part)
            slope -= c * part * _rsqrt(s * part)
        return g, slope

    def spread(self, sine: Any, g: Any, slope: Any) -> Any:
        """K of a way that meets the ball at an angle of that sine, with g and g' (or h) there."""
        per = dr.select(sine > 1e-4, sine / dr.abs(dr.sin(g)), dr.rcp(dr.abs(slope)))
        return (per * dr.square(self.near) * dr.safe_sqrt(1 - dr.square(sine))
                * _rsqrt(sine * self.near) * _rsqrt(sine * self.far) / dr.abs(slope))


def _rsqrt(sine: Any) -> Any:
    """One over a cosine."""
    return dr.rsqrt(dr.maximum(1 - dr.square(sine), 1e-12))


def _reflectance(sine: Any, inverse: mi.Float) -> Any:
    """Of glass of such an inverse index of refraction (Fresnel), unpolarised."""
    outside, inside = (dr.safe_sqrt(1 - dr.square(s)) for s in (sine, sine * inverse))
    return 0.5 * (dr.square((inverse * outside - inside) / (inverse * outside + inside))
                  + dr.square((outside - inverse * inside) / (outside + inverse * inside)))


def find_balls(stage: MitsubaScene) -> Balls | None:
    """Of a scene, at its frame; None where there are none, or rays go through something."""
    if not stage.images.round or stage.clear is not None:
        return None
    shapes, places, indices = stage.balls()
    return Balls(owned(mi.UInt32, shapes), owned(mi.Float, places.ravel()),
                 owned(mi.Float, indices), stage.images.numbered(shapes), len(shapes))


def _compared(near: mi.Float, is_first: mi.Bool) -> mi.UInt32:
    """How many points of lights a vertex compares: most where a ball is so close that its light
    comes from a small part of a lamp, one where the path has had another vertex.

    Args:
        near: radius of the ball over the distance of its centre.
    """
    at_first = dr.select(near > _CLOSE, mi.UInt32(_AT_CLOSE), _AT_FIRST)
    return dr.select(is_first, at_first, 1)


@dr.syntax
def light_by_balls(scene: mi.Scene, si: mi.SurfaceInteraction3f, sampler: Sampler, balls: Any,
                   is_first: mi.Bool, left: mi.UInt32, active: mi.Bool) -> mi.Color3f:
    """Radiance toward `si.wi` of light that one ball sends there; three rays, one after another.

    Args:
        is_first: whether it is the first vertex of a frame's path. (A reference's compares one
            point, as its lanes are at vertices of all depths and would wait for the first ones.)
        left: segments that the path may still have.
    """
    context = mi.BSDFContext()
    ball = dr.minimum(mi.UInt32(sampler.next_1d() * balls.count), balls.count - 1)
    c, r = balls.place(ball, active)
    index = balls.index(ball, active)
    centre = dr.zeros(mi.SurfaceInteraction3f)
    centre.p, centre.time, centre.wavelengths = c, si.time, si.wavelengths
    to_centre = c - si.p
    near = r / dr.norm(to_centre)
    compared = _compared(near, is_first)
    u = dr.normalize(to_centre)
    drawn, which, n = sampler.next_2d(), sampler.next_1d(), mi.Vector3f(si.n)

    # Ways to some points of lights, of which one is picked.
    way, total, tried = _Way.none(), mi.Float(0), mi.UInt32(0)
    trying = active & (near < 1 / _NEAREST)
    while dr.hint(trying, exclude=[scene, active, c, r, index, centre, near, u, n, drawn, left,
                                    compared], label="ball"):
        point = drawn + mi.Float(tried) * mi.Point2f(*_SHIFT)
        light, weight = scene.sample_emitter_direction(centre, point - dr.floor(point), False,
                                                       trying)
        far = mi.has_flag(light.emitter.flags(), mi.EmitterFlags.Infinite)
        ways = _Ways(near, dr.select(far, 0, r / light.dist))
        lit = trying & (light.pdf != 0) & ~light.delta & ways.possible
        tried += 1
        trying &= tried < compared

        # The plane of both points and the centre: u from x to it, v toward y, w around it at y.
        along = dr.dot(u, light.d)
        across = light.d - along * u
        width = dr.norm(across)
        v = dr.select(width > 1e-6, across / width, mi.coordinate_system(u)[0])
        w = width * u - along * v
        t, g, slope, solved = _solved(ways, dr.atan2(width, along), index, lit)
        side, sine = mi.Vector4f(-1, 1, 1, 1), dr.sin(t)
        a, b = sine * near, sine * ways.far
        spread = ways.spread(sine, g, slope)
        cosine = dr.abs(dr.safe_sqrt(1 - dr.square(a)) * dr.dot(n, u) + side * a * dr.dot(n, v))
        facing = dr.safe_sqrt(1 - dr.square(b)) + side * b * (dr.dot(light.n, w)
                                                              / dr.dot(light.n, light.d))
        facing = dr.select(far, 1, facing)
        through = dr.select((index > 0) & (left > 3), mi.Float(1), 0)
        mirrored = dr.select(index > 0, _reflectance(sine, dr.rcp(index)), 1)
        passed = dr.square(1 - mirrored)
        brings = spread * facing * mi.Vector4f(passed.x, passed.y, passed.z, mirrored.w)
        share = dr.select(solved & (facing > 0) & dr.isfinite(brings), brings * cosine, 0)
        share *= (dr.select(lit, mi.luminance(weight), 0)
                  * mi.Vector4f(through, through, through, 1))
        for k in range(4):
            total += share[k]
            taken, which = offered(which, share[k], total)
            onward = dr.safe_sqrt(1 - dr.square(a[k])) * u + side[k] * a[k] * v
            way = dr.select(taken, _Way(onward, light.d, light.p, far, mi.Bool(k < 3),
                                        weight * (spread[k] * facing[k]),
                                        light.pdf / (spread[k] * facing[k]), share[k]), way)

    value, p = si.bsdf().eval_pdf(context, si, si.to_local(way.onward), active)
    seeks = active & (total > 0) & (dr.max(value) > 0)
    start = si.spawn_ray(way.onward)
    wanted = dr.gather(mi.UInt32, balls.shapes, ball, seeks)
    there = _met(scene, start, wanted, seeks)
    sample, passed = there.bsdf().sample(context, there, dr.select(way.refracted, mi.Float(1), 0),
                                         mi.Point2f(0.5), there.is_valid())
    passed *= sample.pdf
    ray = there.spawn_ray(there.to_world(sample.wo))
    out = _met(scene, ray, wanted, seeks & there.is_valid() & way.refracted)
    sample, more = out.bsdf().sample(context, out, 1, mi.Point2f(0.5), out.is_valid())
    passed = dr.select(way.refracted, passed * more * sample.pdf, passed)
    seeks &= there.is_valid() & (dr.max(passed) > 0)
    last = dr.select(way.refracted, out, there)
    blocked = scene.ray_test(dr.select(way.far, last.spawn_ray(way.toward),
                                       last.spawn_ray_to(way.point)), seeks)
    pdf = way.pdf * compared / balls.count
    brought = value * passed * way.light * (balls.count * power_heuristic(pdf, p))
    return dr.select(seeks & ~blocked, brought * total / (way.share * compared), 0)


@dataclass
class _Way:
    """From a point by a ball to a light.

    onward: where it leaves to. toward: the direction of the light, if that is `far`; point: else
    where it is. refracted: through the ball. light: radiance over pdf; pdf: over solid angle at the
    first point. share: by which it was picked.
    """

    onward: mi.Vector3f
    toward: mi.Vector3f
    point: mi.Point3f
    far: mi.Bool
    refracted: mi.Bool
    light: mi.Color3f
    pdf: mi.Float
    share: mi.Float

    @staticmethod
    def none() -> _Way:
        return _Way(mi.Vector3f(0, 0, 1), mi.Vector3f(0, 0, 1), mi.Point3f(0), mi.Bool(False),
                    mi.Bool(False), mi.Color3f(0), mi.Float(1), mi.Float(1))


@dr.syntax
def _solved(ways: _Ways, aside: mi.Float, index: mi.Float, active: mi.Bool,
            ) -> tuple[mi.Vector4f, mi.Vector4f, mi.Vector4f, Any]:
    """Angles of the ways, g and g' (or h and h') there, and which of the ways there are.

    Through, crossing the line to the centre; not, the nearer to the rim; not, the other; reflected.

    Args:
        aside: e.
    """
    inverse = mi.Vector4f(dr.select(index > 0, dr.rcp(index), 0))
    inverse.w = mi.Float(0)
    sought = mi.Vector4f(aside, -aside, -aside, dr.pi - aside)
    falls = mi.Vector4f(1, 1, -1, 1)
    t = mi.Vector4f(dr.pi / 2, dr.pi / 2, 0, dr.pi / 2)
    steps, going = mi.UInt32(0), mi.Bool(active)
    while dr.hint(going, exclude=[ways, inverse, sought, falls, active], label="ways"):
        g, slope = ways.turned(t, inverse)
        nearer = dr.select(slope * falls > 0, dr.clip(t - (g - sought) / slope, 0, dr.pi / 2), t)
        steps += 1
        going = active & (steps < _STEPS) & (dr.max(dr.abs(nearer - t)) > _STILL)
        t = nearer
    g, slope = ways.turned(t, inverse)
    return t, g, slope, (dr.abs(g - sought) < _SOLVED) & (slope * falls > 0) & (t > 0)


def _met(scene: mi.Scene, ray: mi.Ray3f, shape: mi.UInt32,
         active: mi.Bool) -> mi.SurfaceInteraction3f:
    """Where a ray meets a shape that nothing hides; not valid where it does not."""
    pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active)
    met = active & pi.is_valid()
    met &= shape_index(pi.shape, met) == shape
    return pi.compute_surface_interaction(ray, mi.RayFlags.All, met)
