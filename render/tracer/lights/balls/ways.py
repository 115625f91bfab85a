"""The ways from a point by a ball to another, and where a direction goes by it.

All is in one plane. With x and y the points, d1 and d2 their distances from the centre c of a ball
of radius 1, and eta its index of refraction, a way that meets the ball at an angle t to its normal
goes round c by

    pi + g(t),  g(t) = 2 t - 2 asin(sin t / eta) - asin(sin t / d1) - asin(sin t / d2),   through,
    h(t) = 2 t - asin(sin t / d1) - asin(sin t / d2),                                     reflected.

From x to y that has to be as much as the angle between them at c, this way round or the other: g is
-e or e, h is pi - e, with e the angle by which they are not opposite. g is convex, as h is, and
g(0) = 0, so there are at most four such ways, and Newton's method finds each from where it begins
(t = pi/2, or 0) without a step beyond. A beam of a solid angle at x has at y, seen from c, 1/K of
that,

    K = sin t cos t / (d1^2 cos a cos b sin e |g'(t)|),  sin a = sin t / d1, sin b = sin t / d2.

Source: manifold next-event estimation (Hanika et al. 2015), of spheres, whose ways are found
without a walk, and all of them; the equations and K are our own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from onespp.render.mitsuba.variant import mi

_STEPS = 20      # of Newton's method: where two ways are nearly one, each halves the error
_STILL = 1e-6    # radians
_SOLVED = 1e-5
NEAREST = 1.0001  # distances from a centre, radii


@dataclass
class Ways:
    """By a ball, between points of these inverse distances from its centre, radii."""

    near: mi.Float
    far: mi.Float

    @property
    def possible(self) -> mi.Bool:
        """Whether both points are outside."""
        return dr.maximum(self.near, self.far) < 1 / NEAREST

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


@dr.syntax
def solved(ways: Ways, aside: mi.Float, index: mi.Float, active: mi.Bool,
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


def through(along: mi.Vector3f, to_centre: mi.Vector3f, sine: mi.Float,
            index: mi.Float) -> tuple[mi.Vector3f, mi.Vector3f]:
    """Where a direction that goes through a ball leaves it, as the normal there, and whereto.

    Args:
        along: the direction. to_centre: from where it begins, radii. sine: of the angle at which
            it meets the ball. index: of refraction.
    """
    outside, inside = (dr.safe_sqrt(1 - dr.square(s)) for s in (sine, sine / index))
    first = (dr.dot(along, to_centre) - outside) * along - to_centre
    within = along / index + (outside / index - inside) * first
    last = mi.Vector3f(first + 2 * inside * within)
    return last, mi.Vector3f(index * within + (outside - index * inside) * last)


def reflectance(sine: Any, inverse: mi.Float) -> Any:
    """Of glass of such an inverse index of refraction (Fresnel), unpolarised."""
    outside, inside = (dr.safe_sqrt(1 - dr.square(s)) for s in (sine, sine * inverse))
    return 0.5 * (dr.square((inverse * outside - inside) / (inverse * outside + inside))
                  + dr.square((outside - inverse * inside) / (outside + inverse * inside)))


def _rsqrt(sine: Any) -> Any:
    """One over a cosine."""
    return dr.rsqrt(dr.maximum(1 - dr.square(sine), 1e-12))
