"""Light by way of smooth balls: what a vertex gets of it, from a few of all ways there are.

A lamp that shines on a floor through a ball of glass is found only by directions that a BSDF's
sample draws, by rare chance if it is small. A vertex compares two kinds of ways to it, and one of
them is traced, drawn in proportion to what it may bring:

- To points of lights. y is drawn by Mitsuba's own emitter sampling as if from the ball's centre c,
  with density p there; `ways.py` tells the ways from x to it. With K and d2 of that module, the
  density of the direction that leaves x is p |n . (y - c)| / (d2 K |n . o|), o being the direction
  that arrives at y and n the normal there. It is of no use where ways run together.
- In directions toward the ball, of equal density in the cone around it, if it is of glass, at a
  frame's first vertex: more of them the greater it is from there. Of use where a lamp's image in
  the ball is large, as where light runs together. So that most need no ray, those that cannot come
  to a light are told by spheres around lights.

Weights of multiple importance sampling (Veach 1997) are by both densities, each as often as it
is drawn, and by that of the BSDF; a sampled direction that comes by one ball to a light is weighed
likewise (`Balls.density`).

Of a frame's path the first vertices alone look for it (`path.py`), of a reference's all. What is
reflected inside of a ball, or comes by two, is left to chance, and all in scenes in which shadow
rays go through something (`panes.py`); points that shine are not looked for, which Mitsuba's `path`
does not find in glass either.

Source: manifold next-event estimation (Hanika et al. 2015) of spheres; what is compared with it,
and the densities, are our own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.lights.mirrors import met_shape
from onespp.render.tracer.lights.panes import is_far
from onespp.render.tracer.lights.reservoir import offered
from onespp.render.tracer.lights.strata import power_heuristic
from onespp.render.tracer.sampler import Sampler

from .balls import Balls, Draws, Seen, density_of_points, together
from .ways import reflectance, solved, through

_SHIFT = (0.7548776662, 0.5698402910)  # from one to the next (R2, Roberts 2018)
_AWAY = 1.0001  # radii from a centre at which rays begin that have left the ball


@dataclass
class _Way:
    """From a point by a ball to a light.

    ball: which. onward: where it leaves to. toward: the direction of the light, if that is `far`;
    point: else where it is. refracted: through the ball. light: radiance over how often it is
    drawn, weighed against the other kind of ways; density: of both, over solid angle at the first
    point. share: by which one is picked.
    """

    ball: mi.UInt32
    onward: mi.Vector3f
    toward: mi.Vector3f
    point: mi.Point3f
    far: mi.Bool
    refracted: mi.Bool
    light: mi.Color3f
    density: mi.Float
    share: mi.Float


@dataclass
class _Picked:
    """One of the ways so far. total: of shares. left: of a random number."""

    way: _Way
    total: mi.Float
    left: mi.Float

    @staticmethod
    def none(left: mi.Float) -> _Picked:
        way = _Way(mi.UInt32(0), mi.Vector3f(0, 0, 1), mi.Vector3f(0, 0, 1), mi.Point3f(0),
                   mi.Bool(False), mi.Bool(False), mi.Color3f(0), mi.Float(1), mi.Float(1))
        return _Picked(way, mi.Float(0), left)

    def offered(self, way: _Way) -> _Picked:
        total = self.total + way.share
        taken, left = offered(self.left, way.share, total)
        return _Picked(dr.select(taken, way, self.way), total, left)


@dataclass
class _Sought:
    """What a vertex compares: ways to points of lights, and in directions toward glass.

    drawn: tells to which ball each of them is. place: which point or direction it is. left:
    segments that the path may still have.
    """

    points: Draws
    directions: Draws | None
    drawn: mi.Float
    place: mi.Point2f
    left: mi.UInt32

    def at(self, step: mi.UInt32, draws: Draws) -> tuple[mi.UInt32, mi.Point2f]:
        """Ball and place of one of so many."""
        place = self.place + mi.Float(step) * mi.Point2f(*_SHIFT)
        return draws.drawn((self.drawn + step) / draws.number), place - dr.floor(place)

    def aimed(self, seen: Seen, ball: mi.UInt32) -> mi.Float:
        """Density of directions toward a ball."""
        return mi.Float(0) if self.directions is None else (
            self.directions.density(ball) * seen.per_angle)


@dr.syntax
def light_by_balls(scene: mi.Scene, si: mi.SurfaceInteraction3f, sampler: Sampler, balls: Any,
                   is_first: mi.Bool | None, left: mi.UInt32, active: mi.Bool) -> mi.Color3f:
    """Radiance toward `si.wi` of light that one ball sends there; three rays, one after another,
    and one for each direction that may come to a light.

    Args:
        is_first: whether it is the first vertex of a frame's path; None: it is of a reference's.
            (That compares no more than one point, as its lanes are at vertices of all depths and
            would wait for the first ones.)
        left: segments that the path may still have.
    """
    points, directions = balls.draws(si.p, is_first)
    sought = _Sought(points, directions, sampler.next_1d(), sampler.next_2d(), left)
    picked = _Picked.none(sampler.next_1d())
    tried, trying = mi.UInt32(0), mi.Bool(active)
    while dr.hint(trying, exclude=[scene, balls, active, si, sought], label="points"):
        ball, place = sought.at(tried, sought.points)
        seen = balls.seen(ball, si.p, trying)
        for way in _to_a_point(scene, si, place, seen, ball, sought, trying):
            picked = picked.offered(way)
        tried += 1
        trying &= tried < sought.points.number

    if dr.hint(sought.directions is not None, mode="scalar"):
        assert sought.directions is not None
        tried, trying = mi.UInt32(0), active & (sought.directions.number > 0)
        while dr.hint(trying, exclude=[scene, balls, active, si, sought], label="directions"):
            ball, place = sought.at(tried, sought.directions)
            seen = balls.seen(ball, si.p, trying)
            onward, sine = _toward(seen, place)
            normal, toward = through(onward, seen.toward / seen.near, sine, seen.index)
            start = seen.centre + (_AWAY * seen.radius) * normal
            lit = trying & seen.is_outside & (seen.index > 0) & (sought.left > 3)
            lit &= balls.may_shine(start, toward)
            if dr.hint(lit, exclude=[scene, balls, active, si, sought, tried, trying, ball, seen,
                                     onward, sine, toward, start], label="shines"):
                ray = mi.Ray3f(start, toward, si.time, si.wavelengths)
                picked = picked.offered(
                    _in_a_direction(scene, si, ray, onward, sine, seen, ball, sought, lit))
            tried += 1
            trying &= tried < sought.directions.number
    return _brought(scene, si, balls, picked, active)


def _to_a_point(scene: mi.Scene, si: mi.SurfaceInteraction3f, place: mi.Point2f, seen: Seen,
                ball: mi.UInt32, sought: _Sought, active: mi.Bool) -> list[_Way]:
    """All ways by a ball to a point of a light."""
    centre = _centre(si, seen)
    light, weight = scene.sample_emitter_direction(centre, place, False, active)
    far = is_far(light)
    ways = seen.ways_to(light.dist, far)
    lit = active & (light.pdf != 0) & ~light.delta & ways.possible

    # The plane of both points and the centre: u from x to it, v toward y, w around it at y.
    n, u = mi.Vector3f(si.n), seen.toward
    along = dr.dot(u, light.d)
    across = light.d - along * u
    width = dr.norm(across)
    v = dr.select(width > 1e-6, across / width, mi.coordinate_system(u)[0])
    w = width * u - along * v
    t, g, slope, is_way = solved(ways, dr.atan2(width, along), seen.index, lit)
    side, sine = mi.Vector4f(-1, 1, 1, 1), dr.sin(t)
    a, b = sine * ways.near, sine * ways.far
    spread = ways.spread(sine, g, slope)
    cosine = dr.abs(dr.safe_sqrt(1 - dr.square(a)) * dr.dot(n, u) + side * a * dr.dot(n, v))
    facing = dr.safe_sqrt(1 - dr.square(b)) + side * b * (dr.dot(light.n, w)
                                                          / dr.dot(light.n, light.d))
    facing = dr.select(far, 1, facing)
    is_glass = seen.index > 0
    refracted = dr.select(is_glass & (sought.left > 3), mi.Float(1), 0)
    mirrored = dr.select(is_glass, reflectance(sine, dr.rcp(seen.index)), 1)
    passed = dr.square(1 - mirrored)
    drawn, aimed = sought.points.density(ball), sought.aimed(seen, ball)
    density = drawn * light.pdf / (spread * facing)
    both = together(density, mi.Vector4f(aimed, aimed, aimed, 0))
    brings = spread * facing * dr.square(density / both) / drawn
    share = brings * cosine * mi.Vector4f(passed.x, passed.y, passed.z, mirrored.w)
    share = dr.select(is_way & (facing > 0) & dr.isfinite(share), share, 0)
    share *= (dr.select(lit, mi.luminance(weight), 0)
              * mi.Vector4f(refracted, refracted, refracted, 1))
    return [_Way(ball, dr.safe_sqrt(1 - dr.square(a[k])) * u + side[k] * a[k] * v, light.d, light.p,
                 far, mi.Bool(k < 3), weight * brings[k], both[k], share[k]) for k in range(4)]


def _toward(seen: Seen, place: mi.Point2f) -> tuple[mi.Vector3f, mi.Float]:
    """A direction in the cone around a ball, and the sine of the angle at which it meets it."""
    cosine = 1 - place.x / (seen.per_angle * dr.two_pi)
    sine = dr.safe_sqrt(1 - dr.square(cosine))
    y, x = dr.sincos(dr.two_pi * place.y)
    along = mi.Frame3f(seen.toward).to_world(mi.Vector3f(sine * x, sine * y, cosine))
    return along, dr.minimum(sine / seen.near, 1)


def _in_a_direction(scene: mi.Scene, si: mi.SurfaceInteraction3f, ray: mi.Ray3f,
                    onward: mi.Vector3f, sine: mi.Float, seen: Seen, ball: mi.UInt32,
                    sought: _Sought, active: mi.Bool) -> _Way:
    """The way that leaves to `onward`, and a ball as `ray`, if that comes to a light.

    Args:
        sine: of the angle at which it meets the ball.
    """
    pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active)
    shines = active & dr.select(pi.is_valid(), pi.shape.is_emitter(),
                                scene.environment() is not None)
    there = pi.compute_surface_interaction(ray, mi.RayFlags.All, shines)
    centre = _centre(si, seen)
    hit = mi.DirectionSample3f(scene, there, centre)
    emitter_pdf = scene.pdf_emitter_direction(centre, hit, shines)
    density = density_of_points(seen, hit, there, emitter_pdf, sine, mi.Bool(True))
    aimed = sought.aimed(seen, ball)
    both = together(density * sought.points.density(ball), aimed)
    light = hit.emitter.eval(there, shines) * (aimed / dr.square(both))
    passed = dr.square(1 - reflectance(sine, dr.rcp(seen.index)))
    share = mi.luminance(light) * dr.abs(dr.dot(mi.Vector3f(si.n), onward)) * passed
    return _Way(ball, onward, ray.d, there.p, ~there.is_valid(), mi.Bool(True), light, both,
                dr.select(shines & dr.isfinite(share), share, 0))


def _brought(scene: mi.Scene, si: mi.SurfaceInteraction3f, balls: Balls, picked: _Picked,
             active: mi.Bool) -> mi.Color3f:
    """What comes by the way that was picked, for all of them."""
    context, way = mi.BSDFContext(), picked.way
    value, p = si.bsdf().eval_pdf(context, si, si.to_local(way.onward), active)
    seeks = active & (picked.total > 0) & (dr.max(value) > 0)
    wanted = dr.gather(mi.UInt32, balls.shapes, way.ball, seeks)
    there = met_shape(scene, si.spawn_ray(way.onward), wanted, seeks)
    sample, passed = there.bsdf().sample(context, there, dr.select(way.refracted, mi.Float(1), 0),
                                         mi.Point2f(0.5), there.is_valid())
    passed *= sample.pdf
    ray = there.spawn_ray(there.to_world(sample.wo))
    out = met_shape(scene, ray, wanted, seeks & there.is_valid() & way.refracted)
    sample, more = out.bsdf().sample(context, out, 1, mi.Point2f(0.5), out.is_valid())
    passed = dr.select(way.refracted, passed * more * sample.pdf, passed)
    seeks &= there.is_valid() & (dr.max(passed) > 0)
    last = dr.select(way.refracted, out, there)
    blocked = scene.ray_test(dr.select(way.far, last.spawn_ray(way.toward),
                                       last.spawn_ray_to(way.point)), seeks)
    brought = value * passed * way.light * power_heuristic(way.density, p)
    return dr.select(seeks & ~blocked, brought * (picked.total / way.share), 0)


def _centre(si: mi.SurfaceInteraction3f, seen: Seen) -> mi.SurfaceInteraction3f:
    """That of a ball, from where lights are sampled."""
    centre = dr.zeros(mi.SurfaceInteraction3f)
    centre.p, centre.time, centre.wavelengths = seen.centre, si.time, si.wavelengths
    return centre
