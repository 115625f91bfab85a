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

Mirrors are flat here, without maps, and opaque. In scenes in which shadow rays go through something
(`panes.py`) none is looked into; nor is a point that shines looked for, which Mitsuba's `path` does
not find in mirrors either.

Source: the method of images, known from acoustics; next-event estimation through one specular
surface is manifold next-event estimation (Hanika et al. 2015), which for flat mirrors needs no
iteration.
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

from .strata import power_heuristic


@dataclass
class Mirrors:
    """Flat mirrors of a scene as it stands, M of them.

    shapes: indices in the JIT registry. planes: four numbers each, (n, d), n . x = d on it.
    rows: by registry index, which mirror it is, from 1; 0: none. count: M.
    """

    shapes: mi.UInt32
    planes: mi.Float
    rows: mi.UInt32
    count: int

    def image(self, mirror: mi.UInt32, point: mi.Point3f, active: mi.Bool) -> mi.Point3f:
        """Of a point, in the plane of a mirror."""
        n, d = self._plane(mirror, active)
        return point - 2 * (dr.dot(n, point) - d) * n

    def reflected(self, mirror: mi.UInt32, direction: mi.Vector3f,
                  active: mi.Bool) -> mi.Vector3f:
        n, _ = self._plane(mirror, active)
        return direction - 2 * dr.dot(n, direction) * n

    def on_one_side(self, mirror: mi.UInt32, a: mi.Point3f, b: mi.Point3f,
                    active: mi.Bool) -> mi.Bool:
        """Whether two points are on one side of a mirror."""
        n, d = self._plane(mirror, active)
        return (dr.dot(n, a) - d) * (dr.dot(n, b) - d) > 0

    def row(self, shape: mi.ShapePtr, active: mi.Bool) -> mi.UInt32:
        """Of a shape."""
        return dr.gather(mi.UInt32, self.rows, shape_index(shape, active), active)

    def _plane(self, mirror: mi.UInt32, active: mi.Bool) -> tuple[mi.Vector3f, mi.Float]:
        x, y, z, d = (dr.gather(mi.Float, self.planes, 4 * mirror + i, active) for i in range(4))
        return mi.Vector3f(x, y, z), d


def find_mirrors(stage: MitsubaScene) -> Mirrors | None:
    """Of a scene, at its frame; None where there are none, or rays go through something."""
    if not stage.images.flat or stage.clear is not None:
        return None
    shapes, planes = stage.flat_mirrors()
    return Mirrors(owned(mi.UInt32, shapes), owned(mi.Float, planes.ravel()),
                   stage.images.numbered(shapes), len(shapes))


@dr.syntax
def light_in_mirrors(scene: mi.Scene, si: mi.SurfaceInteraction3f, sampler: Sampler, mirrors: Any,
                     active: mi.Bool) -> mi.Color3f:
    """Radiance toward `si.wi` of light that one mirror sends there; two rays, one after another."""
    context, reflection = mi.BSDFContext(), mi.BSDFContext()
    reflection.type_mask = mi.BSDFFlags.DeltaReflection
    mirror = dr.minimum(mi.UInt32(sampler.next_1d() * mirrors.count), mirrors.count - 1)
    image = dr.zeros(mi.SurfaceInteraction3f)
    image.p = mirrors.image(mirror, si.p, active)
    image.time, image.wavelengths = si.time, si.wavelengths
    light, weight = scene.sample_emitter_direction(image, sampler.next_2d(), False, active)
    onward = mirrors.reflected(mirror, light.d, active)
    value, p = si.bsdf().eval_pdf(context, si, si.to_local(onward), active)
    w = power_heuristic(light.pdf / mirrors.count, p)
    c = dr.select(active & (light.pdf != 0) & ~light.delta,
                  w * mirrors.count * value * weight, 0)
    seeks = (dr.max(c) > 0) & mirrors.on_one_side(mirror, si.p, light.p, active)
    ray = si.spawn_ray(onward)
    pi = scene.ray_intersect_preliminary(ray, coherent=False, active=seeks)
    wanted = dr.gather(mi.UInt32, mirrors.shapes, mirror, seeks)
    seeks &= pi.is_valid() & (shape_index(pi.shape, seeks & pi.is_valid()) == wanted)
    there = pi.compute_surface_interaction(ray, mi.RayFlags.All, seeks)
    _, left = there.bsdf().sample(reflection, there, 0.5, mi.Point2f(0.5), seeks)
    seeks &= dr.max(left) > 0
    seen = seeks & ~scene.ray_test(there.spawn_ray_to(light.p), seeks)
    return dr.select(seen, c * left, 0)
