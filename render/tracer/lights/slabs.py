"""Light through slabs: panes that are boxes of smooth glass, as windows are modelled.

What goes in at one side of a slab and out at the other, which is parallel, keeps its direction and
is shifted. So from a vertex x to a point y of a light there is one way through slabs with a normal
n, thickness T together and index of refraction eta, in the plane of n and y - x. With A what is not
glass of the distance along n, L the distance across it and tau the tangent of the way's angle to n,

    g(tau) = A tau + T tau / sqrt(eta^2 + (eta^2 - 1) tau^2) = L,

which Newton's method finds from max(L / (A + T), (L - T / sqrt(eta^2 - 1)) / A) on, neither of
which is above it: g is concave, so no step goes beyond. A beam of a solid angle at x has at y,
across the way, that times

    R^2 = (A / cos + T / sqrt(eta^2 - sin^2)) g'(tau) / cos,   g' = A + T eta^2 / sqrt(...)^3,

of the angle: what the squared distance is where there is no glass.

Which slabs are between x and y, the straight line says: those whose middles it crosses. All that
goes another way from x to y (in at a face and out at another, or by what the line misses at a
slab's rim) is left to the directions that a BSDF's sample draws: weights of multiple importance
sampling are by which slabs a path has gone through, so that nothing is counted twice or lost.

Source: Snell's law; the equation is that of a plane-parallel plate (Born and Wolf, "Principles of
Optics"), the density our own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from onespp.render.host.aligned import owned
from onespp.render.mitsuba.images import shape_index
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi

WORDS = 17  # of a slab in the table: centre, rows, normal, thickness, index of refraction
_STEPS = 8  # of Newton's method
_SOLVED = 1e-4  # share of L by which g may be off: else such a way is left to chance
_ALIKE = 1e-6  # by how much cosines and indices of what is parallel and alike differ at most
FACING = 1 - 1e-4  # least cosine between the normals of a slab's side and of a face of it
FAR = 1e12  # distance of the sky


@dataclass
class Between:
    """Slabs on the straight line from a vertex to a point.

    which: a bit for each. lost: whether they have different normals or glass. normal, thickness,
    index: of them all.
    """

    which: mi.UInt32
    lost: mi.Bool
    normal: mi.Vector3f
    thickness: mi.Float
    index: mi.Float

    def bent(self, d: mi.Vector3f, distance: mi.Float, is_far: mi.Bool,
             n: mi.Normal3f) -> tuple[mi.Vector3f, mi.Float]:
        """The direction in which the way through them leaves the vertex, and the density over solid
        angle of points of a light there, over that by the straight line.

        Args:
            d, distance: of the point, along the straight line. is_far: it is in the sky. n: the
                normal of the light at the point.
        """
        along = dr.dot(self.normal, d)
        across = d - along * self.normal
        sine = dr.norm(across)
        length, depth = distance * sine, distance * dr.abs(along)
        glass, square = self.thickness, dr.square(self.index)
        air, missed, slope = depth - glass, mi.Float(0), mi.Float(1)
        tangent = dr.maximum(length / depth, (length - glass * dr.rsqrt(square - 1)) / air)
        for step in range(_STEPS + 1):
            root = dr.rsqrt(square + (square - 1) * dr.square(tangent))
            slope = air + glass * square * root * dr.square(root)
            missed = air * tangent + glass * tangent * root - length
            if step < _STEPS:
                tangent -= missed / slope
        cosine = dr.rsqrt(1 + dr.square(tangent))
        bent_sine = tangent * cosine
        toward = (dr.select(along > 0, cosine, -cosine) * self.normal
                  + dr.select(sine > 0, bent_sine / sine, 0) * across)
        squared = ((air / cosine + glass * dr.rsqrt(square - dr.square(bent_sine))) * slope
                   / cosine)
        ratio = squared / dr.square(distance) * dr.abs(dr.dot(n, d) / dr.dot(n, toward))
        bends = (self.which != 0) & ~is_far
        is_way = dr.isfinite(ratio) & (dr.abs(missed) <= _SOLVED * length)
        return (dr.select(bends, toward, d),
                dr.select(self.lost | (bends & ~is_way), 0, dr.select(bends, ratio, 1)))


@dataclass
class Slabs:
    """Those of a scene as it stands. table: `WORDS` words of each: the centre, the rows that take
    an offset from there to shares of half its edges, thickness first; normal, thickness, index of
    refraction. rows: by registry index, which slab it is, from 1; 0: none. count: of slabs."""

    table: mi.Float
    rows: mi.UInt32
    count: int

    @dr.syntax
    def between(self, x: mi.Point3f, d: mi.Vector3f, distance: mi.Float, is_far: mi.Bool,
                active: mi.Bool) -> Any:
        """Slabs between a vertex and a point of a light; arguments as of `Between.bent`."""
        distance = dr.select(is_far, mi.Float(FAR), distance)
        found = Between(mi.UInt32(0), mi.Bool(False), mi.Vector3f(0, 0, 1), mi.Float(0),
                        mi.Float(1))
        k, asks = mi.UInt32(0), mi.Bool(active)
        while dr.hint(asks, exclude=[self, x, d, distance, active], label="slabs"):
            word = [dr.gather(mi.Float, self.table, WORDS * k + i, asks) for i in range(WORDS)]
            offset = x - mi.Point3f(*word[:3])
            rows = [mi.Vector3f(*word[i:i + 3]) for i in (3, 6, 9)]
            normal, index = mi.Vector3f(*word[12:15]), word[16]
            start, rate = mi.Float(dr.dot(rows[0], offset)), mi.Float(dr.dot(rows[0], d))
            end, met = dr.fma(distance, rate, start), -start / rate
            crosses = asks & (start * end < 0) & (dr.minimum(dr.abs(start), dr.abs(end)) > 1)
            for row in rows[1:]:
                beside = mi.Float(dr.dot(row, offset)) + met * mi.Float(dr.dot(row, d))
                crosses &= dr.abs(beside) < 1
            is_first = found.which == 0
            alike = ((dr.abs(mi.Float(dr.dot(normal, found.normal))) > 1 - _ALIKE)
                     & (dr.abs(index - found.index) < _ALIKE))
            found = Between(
                found.which | dr.select(crosses, mi.UInt32(1) << k, 0),
                found.lost | (crosses & ~is_first & ~alike),
                dr.select(crosses & is_first, normal, found.normal),
                found.thickness + dr.select(crosses, word[15], 0),
                dr.select(crosses & is_first, index, found.index))
            k += 1
            asks = active & (k < self.count)
        return found

    def crossing(self, si: mi.SurfaceInteraction3f, inside: mi.UInt32,
                 active: mi.Bool) -> Crossing:
        """Of a face that a path has met; inside: the slab that it is in, from 1; 0: none."""
        row = dr.gather(mi.UInt32, self.rows, shape_index(si.shape, active), active)
        there = active & (row != 0)
        normal = mi.Vector3f(*(dr.gather(mi.Float, self.table, WORDS * (row - 1) + i, there)
                               for i in (12, 13, 14)))
        faces = there & (dr.abs(mi.Float(dr.dot(normal, si.n))) > FACING)
        return Crossing(row, faces & (inside == 0) & (si.wi.z > 0),
                        faces & (inside == row) & (si.wi.z < 0))


@dataclass
class Crossing:
    """What goes through a face does. slab: from 1. enters, leaves: by a side of it."""

    slab: mi.UInt32
    enters: mi.Bool
    leaves: mi.Bool

    @property
    def bit(self) -> mi.UInt32:
        """Of the slab, in `Between.which`."""
        return dr.select(self.enters | self.leaves, mi.UInt32(1) << (self.slab - 1), 0)

    @property
    def left(self) -> mi.UInt32:
        """The same, 0 where it is not left."""
        return dr.select(self.leaves, self.bit, 0)


def goes_through_slabs(stage: MitsubaScene) -> bool:
    """Whether light does in a scene: not where it is looked for by way of balls, as what comes by
    both kinds is not known to either."""
    images = stage.images
    return bool(images.slabs) and not (images.round and stage.clear is None)


def find_slabs(stage: MitsubaScene) -> Slabs | None:
    """Of a scene, at its frame; None where light goes through none."""
    if not goes_through_slabs(stage):
        return None
    shapes, table = stage.slabs()
    return Slabs(owned(mi.Float, table.ravel()), stage.images.numbered(shapes), len(shapes))
