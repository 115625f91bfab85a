"""Light by way of flat mirrors: a vertex looks for it as for light itself, in what they show.

A lamp that shines on a floor by way of a mirror would be found only by directions that a BSDF's
sample draws, by rare chance if it is small. But what a flat mirror shows is what there is before
it, reflected. With x a vertex, x' its image in the plane of a mirror, and y a point of a light, the
way from x by the mirror to y is as long as the line from x' to y, and leaves x in the direction of
that line, reflected. So y is drawn by Mitsuba's own emitter sampling as if from x', one of M
mirrors by equal chance, and counts

    v R w f(x, y) L(y) M / p(y),

p being the density over solid angle at x', f the BSDF with its cosine, R what the mirror leaves, w
the weight of multiple importance sampling of p / M, and v whether the first thing that x meets on
that way is that mirror, and the mirror sees y. A sampled direction that comes by one mirror to a
light is weighed likewise: as one that leaves x'. What comes by two or more is left to it alone.

Mirrors are flat here, without maps: metal, panes without thickness, and both sides of a slab of
glass (`slabs.py`). Of a slab with the thickness T the side that is farther from x reflects what is
seen through glass of 2 T: unfolded, the way goes through a slab of that thickness, and so R is a
product, and p that of such a way. What goes through something beside is left to chance; and points
that shine are not looked for, which Mitsuba's `path` does not find in mirrors either.

Source: the method of images, known from acoustics; next-event estimation through one specular
surface is manifold next-event estimation (Hanika et al. 2015), which for flat mirrors needs no
iteration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from onespp.render.host.aligned import owned
from onespp.render.mitsuba.images import shape_index
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.sampler import Sampler

from .panes import is_far
from .slabs import FACING, FAR, WORDS, Between, goes_through_slabs
from .strata import power_heuristic


@dataclass
class Mirrors:
    """Flat mirrors of a scene as it stands, M of them; a slab of glass has two, one after another.

    shapes: indices in the JIT registry. planes: four numbers each, (n, d), n . x = d on it, n
    outward. rows: by registry index, which mirror it is, the first of two, from 1; 0: none. count:
    M. glass: thickness and index of refraction, 0 of what is no slab's side; None where there are
    no slabs.
    """

    shapes: mi.UInt32
    planes: mi.Float
    rows: mi.UInt32
    count: int
    glass: mi.Float | None

    def image(self, mirror: mi.UInt32, point: mi.Point3f, active: mi.Bool) -> mi.Point3f:
        """Of a point, in the plane of a mirror."""
        n, d = self.plane(mirror, active)
        return point - 2 * (dr.dot(n, point) - d) * n

    def reflected(self, mirror: mi.UInt32, direction: mi.Vector3f,
                  active: mi.Bool) -> mi.Vector3f:
        n, _ = self.plane(mirror, active)
        return direction - 2 * dr.dot(n, direction) * n

    def heights(self, mirror: mi.UInt32, x: mi.Point3f, light: mi.DirectionSample3f,
                active: mi.Bool) -> tuple[mi.Float, mi.Float]:
        """Of a vertex and of a point of a light above a mirror; the sky is far on its side."""
        n, d = self.plane(mirror, active)
        return mi.Float(dr.dot(n, x) - d), dr.select(
            is_far(light), mi.Float(dr.dot(n, light.d)) * FAR, mi.Float(dr.dot(n, light.p) - d))

    def row(self, shape: mi.ShapePtr, active: mi.Bool) -> mi.UInt32:
        """Of a shape, the first if there are two."""
        return dr.gather(mi.UInt32, self.rows, shape_index(shape, active), active)

    def row_at(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.UInt32:
        """Of a place on a shape, 0 where it is none: on a slab, its side."""
        row = self.row(si.shape, active)
        if self.glass is None:
            return row
        thickness, _ = self.slab(row - 1, active & (row != 0))
        is_slab = thickness > 0
        n, _ = self.plane(row - 1, is_slab)
        cosine = mi.Float(dr.dot(n, si.n))
        return dr.select(is_slab, dr.select(dr.abs(cosine) > FACING,
                                            dr.select(cosine > 0, row, row + 1), 0), row)

    def slab(self, mirror: mi.UInt32, active: mi.Bool) -> tuple[mi.Float, mi.Float]:
        """Thickness and index of refraction, 0 of what is no slab's side."""
        if self.glass is None:
            return mi.Float(0), mi.Float(1)
        return (dr.gather(mi.Float, self.glass, 2 * mirror, active),
                dr.gather(mi.Float, self.glass, 2 * mirror + 1, active))

    def other_side(self, mirror: mi.UInt32, active: mi.Bool) -> mi.UInt32:
        """Of a slab, from one of its sides."""
        shape = dr.gather(mi.UInt32, self.shapes, mirror, active)
        first = dr.gather(mi.UInt32, self.rows, shape, active) - 1
        return 2 * first + 1 - mirror

    def unfolded(self, mirror: mi.UInt32, d: mi.Vector3f, distance: mi.Float, is_far: mi.Bool,
                 n: mi.Normal3f, behind: mi.Bool) -> tuple[mi.Vector3f, mi.Float]:
        """`Between.bent` of the way from an image, through what glass is before the mirror.

        Args:
            behind: whether the mirror is a slab's side that is seen from inside.
        """
        if self.glass is None:
            return d, mi.Float(1)
        thickness, index = self.slab(mirror, behind)
        normal, _ = self.plane(mirror, behind)
        between = Between(dr.select(behind, mi.UInt32(1), 0), mi.Bool(False), normal, 2 * thickness,
                          dr.select(behind, index, 1))
        return between.bent(d, distance, is_far, n)

    def plane(self, mirror: mi.UInt32, active: mi.Bool) -> tuple[mi.Vector3f, mi.Float]:
        x, y, z, d = (dr.gather(mi.Float, self.planes, 4 * mirror + i, active) for i in range(4))
        return mi.Vector3f(x, y, z), d


def find_mirrors(stage: MitsubaScene) -> Mirrors | None:
    """Of a scene, at its frame; None where there are none."""
    has_slabs = goes_through_slabs(stage)
    if not (stage.images.flat or has_slabs):
        return None
    shapes, planes = stage.flat_mirrors()
    if not has_slabs:
        return Mirrors(owned(mi.UInt32, shapes), owned(mi.Float, planes.ravel()),
                       stage.images.numbered(shapes), len(shapes), None)
    slabs, words = stage.slabs()
    centre, n, thickness = words[:, :3], words[:, 12:15], words[:, 15:16]
    sides = [np.hstack([sign * n, sign * (n * centre).sum(1, keepdims=True) + thickness / 2])
             for sign in (1, -1)]
    planes = np.concatenate([planes, np.stack(sides, 1).reshape(-1, 4)]).astype(np.float32)
    glass = np.zeros((len(planes), 2), np.float32)
    glass[len(shapes):] = np.repeat(words[:, 15:WORDS], 2, 0)
    rows = np.array(stage.images.numbered(shapes))
    rows[slabs] = np.where(thickness[:, 0] > 0, len(shapes) + 1 + 2 * np.arange(len(slabs)), 0)
    return Mirrors(owned(mi.UInt32, np.append(shapes, np.repeat(slabs, 2))),
                   owned(mi.Float, planes.ravel()), owned(mi.UInt32, rows), len(planes),
                   owned(mi.Float, glass.ravel()))


@dr.syntax
def light_in_mirrors(scene: mi.Scene, si: mi.SurfaceInteraction3f, sampler: Sampler, mirrors: Any,
                     left: mi.UInt32, active: mi.Bool) -> mi.Color3f:
    """Radiance toward `si.wi` of light that one mirror sends there; two rays, one after another, of
    sides of slabs four.

    Args:
        left: segments that the path may still have.
    """
    context = mi.BSDFContext()
    mirror = dr.minimum(mi.UInt32(sampler.next_1d() * mirrors.count), mirrors.count - 1)
    image = dr.zeros(mi.SurfaceInteraction3f)
    image.p = mirrors.image(mirror, si.p, active)
    image.time, image.wavelengths = si.time, si.wavelengths
    light, weight = scene.sample_emitter_direction(image, sampler.next_2d(), False, active)
    toward, pdf, behind = light.d, light.pdf, mi.Bool(False)
    own, height = mirrors.heights(mirror, si.p, light, active)
    possible = own * height > 0
    if dr.hint(mirrors.glass is not None, mode="scalar"):
        thickness, _ = mirrors.slab(mirror, active)
        behind = (thickness > 0) & (own < 0)
        possible &= ~behind | ((dr.maximum(own, height) < -thickness) & (left > 4))
        toward, ratio = mirrors.unfolded(mirror, light.d, light.dist, is_far(light), light.n,
                                         behind)
        pdf, weight = pdf * ratio, weight / ratio
    onward = mirrors.reflected(mirror, toward, active)
    value, p = si.bsdf().eval_pdf(context, si, si.to_local(onward), active)
    w = power_heuristic(pdf / mirrors.count, p)
    c = dr.select(active & (pdf != 0) & ~light.delta, w * mirrors.count * value * weight, 0)
    seeks = (dr.max(c) > 0) & possible
    last, kept = _reflected(scene, si.spawn_ray(onward), mirrors, mirror, behind, seeks)
    seeks &= dr.max(kept) > 0
    ray = last.spawn_ray_to(light.p)
    if dr.hint(mirrors.glass is not None, mode="scalar"):
        ray = dr.select(behind & is_far(light), last.spawn_ray(toward), ray)
    seen = seeks & ~scene.ray_test(ray, seeks)
    return dr.select(seen, c * kept, 0)


@dr.syntax
def _reflected(scene: mi.Scene, ray: mi.Ray3f, mirrors: Any, mirror: mi.UInt32, behind: mi.Bool,
               active: mi.Bool) -> tuple[mi.SurfaceInteraction3f, mi.Color3f]:
    """Where a ray leaves a mirror, and what it keeps; 0 where it does not come by it."""
    reflection, context = mi.BSDFContext(), mi.BSDFContext()
    reflection.type_mask = mi.BSDFFlags.DeltaReflection
    if dr.hint(mirrors.glass is None, mode="scalar"):
        there = _met(scene, ray, mirrors, mirror, active)
        _, kept = there.bsdf().sample(reflection, there, 0.5, mi.Point2f(0.5), there.is_valid())
        return there, dr.select(there.is_valid(), kept, 0)
    other = mirrors.other_side(mirror, active & behind)
    there = _met(scene, ray, mirrors, dr.select(behind, other, mirror), active)
    sample, kept = there.bsdf().sample(context, there, dr.select(behind, mi.Float(1), 0),
                                       mi.Point2f(0.5), there.is_valid())
    kept = dr.select(there.is_valid(), kept * sample.pdf, 0)
    inner = there.spawn_ray(there.to_world(sample.wo))
    inside = _met(scene, inner, mirrors, mirror, behind & (dr.max(kept) > 0))
    sample, more = inside.bsdf().sample(context, inside, 0, mi.Point2f(0.5), inside.is_valid())
    reflected = more * sample.pdf
    out = _met(scene, inside.spawn_ray(inside.to_world(sample.wo)), mirrors, other,
               inside.is_valid())
    sample, more = out.bsdf().sample(context, out, 1, mi.Point2f(0.5), out.is_valid())
    through = dr.select(out.is_valid(), kept * reflected * more * sample.pdf, 0)
    return dr.select(behind, out, there), dr.select(behind, through, kept)


def _met(scene: mi.Scene, ray: mi.Ray3f, mirrors: Mirrors, mirror: mi.UInt32,
         active: mi.Bool) -> mi.SurfaceInteraction3f:
    """`met_shape` of a mirror: of a slab, that side."""
    si = met_shape(scene, ray, dr.gather(mi.UInt32, mirrors.shapes, mirror, active), active)
    if mirrors.glass is not None:
        si.t = dr.select(mirrors.row_at(si, si.is_valid()) == mirror + 1, si.t, dr.inf)
    return si


def met_shape(scene: mi.Scene, ray: mi.Ray3f, shape: mi.UInt32,
              active: mi.Bool) -> mi.SurfaceInteraction3f:
    """Where a ray meets a shape, by its index in the JIT registry, that nothing hides; not valid
    where it does not."""
    pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active)
    met = active & pi.is_valid()
    met &= shape_index(pi.shape, met) == shape
    return pi.compute_surface_interaction(ray, mi.RayFlags.All, met)
