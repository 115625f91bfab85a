"""Light that goes on through masks and panes: what a shadow ray sees through them.

The hole of a mask and a thin pane let light through without turning it (Mitsuba's `Null` lobes).
A shadow ray that took them for walls would leave such light to the direction that the BSDF's sample
takes, which meets a small lamp by rare chance. So a shadow ray goes on through them, and counts

    T = product of their straight transmittances,

and a direction that was sampled is weighed against light sampling from the last vertex that turned
it: weights of multiple importance sampling are of a vertex and a direction alone, and add up to 1
whatever the ray goes through. A passage is a segment of the path all the same, as in Mitsuba, and
no scattering event. So it is through slabs of glass, which shift a ray (`slabs.py`).

Source: the index-matched media boundaries of Mitsuba's `volpath`, for surfaces alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from onespp.render.host.aligned import owned
from onespp.render.mitsuba.images import shape_index
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi

from .slabs import Slabs, find_slabs


@dataclass
class Aim:
    """Of a shadow ray. point: of a light; far: in the sky. toward: the direction in which it leaves
    the surface. which: slabs that it goes through, as of `Between`; None where there are none."""

    point: mi.Point3f
    far: mi.Bool
    toward: mi.Vector3f
    which: mi.UInt32 | None


@dataclass
class Panes:
    """What light goes through, of a scene as it stands. clear: by registry index, 1 for shapes that
    let it straight through. slabs: None where there are none."""

    clear: mi.UInt32
    slabs: Slabs | None

    def no_aim(self) -> Aim:
        return Aim(mi.Point3f(0), mi.Bool(False), mi.Vector3f(0, 0, 1),
                   None if self.slabs is None else mi.UInt32(0))

    def aimed(self, x: mi.Point3f, light: mi.DirectionSample3f, weight: mi.Color3f, active: mi.Bool,
              ) -> tuple[mi.DirectionSample3f, mi.Color3f, Aim]:
        """A point of a light and its radiance over density, by the way through slabs: its direction
        and its density are of that; and that way. Points that shine are not seen through any, as by
        Mitsuba's `path`."""
        far = is_far(light)
        if self.slabs is None:
            return light, weight, Aim(light.p, far, light.d, None)
        between = self.slabs.between(x, light.d, light.dist, far, active)
        toward, ratio = between.bent(light.d, light.dist, far, light.n)
        seen = (ratio > 0) & (~light.delta | (between.which == 0))
        light = mi.DirectionSample3f(light)
        light.d, light.pdf = toward, dr.select(seen, light.pdf * ratio, 0)
        return (light, dr.select(seen, weight / ratio, 0),
                Aim(light.p, far, toward, between.which))


def find_panes(stage: MitsubaScene) -> Panes | None:
    """Of a scene, at its frame; None where light goes through nothing."""
    slabs = find_slabs(stage)
    if stage.clear is None and slabs is None:
        return None
    clear = owned(mi.UInt32, stage.images.clear) if stage.clear is None else stage.clear
    return Panes(clear, slabs)


def is_far(light: mi.DirectionSample3f) -> mi.Bool:
    """Whether a light's point is in the sky."""
    return mi.has_flag(light.emitter.flags(), mi.EmitterFlags.Infinite)


@dataclass
class Passage:
    """What is between a surface and a light's point.

    through: T, 0 where something stops the ray. distance: from the surface to that, 0 if nothing
    does; shape: which, its index in the JIT registry, 0 for none; face: which of its faces.
    """

    through: mi.Color3f
    distance: mi.Float
    shape: mi.UInt32
    face: mi.UInt32


@dr.syntax
def passage(scene: mi.Scene, si: mi.SurfaceInteraction3f, aim: Any, panes: Any, most: mi.UInt32,
            active: mi.Bool) -> Passage:
    """From a surface to a light's point.

    Args:
        aim: of `Panes.aimed`. panes: `Panes`. most: faces that the ray may go through.
    """
    point, which = aim.point, aim.which
    through, distance = mi.Color3f(dr.select(active, 1, 0)), mi.Float(0)
    shape, face = mi.UInt32(0), mi.UInt32(0)
    has_slabs: bool = panes.slabs is not None
    crossed: Any = mi.UInt32(0) if has_slabs else None
    inside: Any = mi.UInt32(0) if has_slabs else None
    ray, left, going = si.spawn_ray_to(point), mi.UInt32(most), mi.Bool(active)
    if dr.hint(has_slabs, mode="scalar"):
        ray = dr.select(which != 0, si.spawn_ray(aim.toward), ray)
    while dr.hint(going, exclude=[scene, si, aim, point, which, panes, has_slabs, active],
                  label="panes"):
        pi = scene.ray_intersect_preliminary(ray, coherent=False, active=going)
        met = going & pi.is_valid()
        here = pi.compute_surface_interaction(ray, mi.RayFlags.All, met)
        index = shape_index(pi.shape, met)
        asked = met & (left > 0) & (dr.gather(mi.UInt32, panes.clear, index, met) != 0)
        if dr.hint(has_slabs, mode="scalar"):
            asked &= inside == 0
        share = here.bsdf().eval_null_transmission(here, asked)
        passes = asked & (dr.max(share) > 0)
        onward = here.spawn_ray_to(point)
        if dr.hint(has_slabs, mode="scalar"):
            at = panes.slabs.crossing(here, inside, met & (left > 0))
            crosses = (at.bit & which) != 0
            sample, weight = here.bsdf().sample(mi.BSDFContext(), here, 1, mi.Point2f(0.5), crosses)
            refracts = crosses & mi.has_flag(sample.sampled_type, mi.BSDFFlags.DeltaTransmission)
            share = dr.select(refracts, weight * sample.pdf, share)
            passes |= refracts & (dr.max(share) > 0)
            crossed |= dr.select(refracts, at.left, 0)
            inside = dr.select(refracts, dr.select(at.enters, at.slab, 0), inside)
            is_bent = (which != 0) & (aim.far | (crossed != which))
            d = dr.select(refracts, here.to_world(sample.wo), ray.d)
            onward = dr.select(is_bent, here.spawn_ray(d), onward)
        through *= dr.select(passes, share, dr.select(met, 0, 1))
        stopped = met & ~passes
        distance = dr.select(stopped, dr.norm(here.p - si.p), distance)
        shape = dr.select(stopped, index, shape)
        face = dr.select(stopped, pi.prim_index, face)
        ray = onward
        left -= dr.select(passes, mi.UInt32(1), 0)
        going = passes
    if dr.hint(has_slabs, mode="scalar"):
        through = dr.select(crossed == which, through, 0)
    return Passage(through, distance, shape, face)


@dataclass
class Gone:
    """What a path has gone through since its origin, all that light sampling goes through, too.

    slabs: a bit for each that it has left. inside: the one that it is in, from 1; 0: none. any:
    whether it has gone through something.
    """

    slabs: mi.UInt32
    inside: mi.UInt32
    any: mi.Bool

    @staticmethod
    def none() -> Gone:
        return Gone(mi.UInt32(0), mi.UInt32(0), mi.Bool(False))

    def after(self, si: mi.SurfaceInteraction3f, sample: mi.BSDFSample3f, panes: Panes,
              active: mi.Bool) -> tuple[Gone, mi.Bool]:
        """Behind a surface; and whether a sampled direction goes on through it."""
        is_null, is_refracted = (mi.has_flag(sample.sampled_type, flag) for flag in (
            mi.BSDFFlags.Null, mi.BSDFFlags.DeltaTransmission))
        goes = (active & is_null & (self.inside == 0)
                & (dr.gather(mi.UInt32, panes.clear, shape_index(si.shape, active), active) != 0))
        if panes.slabs is None:
            return Gone(self.slabs, self.inside, self.any | goes), goes
        at = panes.slabs.crossing(si, self.inside, active & is_refracted)
        crosses = at.enters | at.leaves
        inside = dr.select(crosses, dr.select(at.enters, at.slab, 0), self.inside)
        return Gone(self.slabs | at.left, inside, self.any | goes | at.leaves), goes | crosses


def density_through(gone: Gone, x: mi.Point3f, hit: mi.DirectionSample3f, is_sky: mi.Bool,
                    slabs: Slabs, active: mi.Bool) -> mi.Float:
    """The density of light sampling at x of a direction that has come to a light through slabs,
    over that by the straight line; 0 where light sampling does not go through these."""
    between = slabs.between(x, hit.d, hit.dist, is_sky, active)
    _, ratio = between.bent(hit.d, hit.dist, is_sky, hit.n)
    return dr.select((between.which == gone.slabs) & (gone.inside == 0), ratio, 0)
