"""Light that goes straight on through masks and panes: what a shadow ray sees through them.

The hole of a mask and a thin pane let light through without turning it (Mitsuba's `Null` lobes).
A shadow ray that took them for walls would leave such light to the direction that the BSDF's sample
takes, which meets a small lamp by rare chance. So a shadow ray goes on through them, and counts

    T = product of their straight transmittances,

and a direction that was sampled is weighed against light sampling from the last vertex that turned
it: weights of multiple importance sampling are of a vertex and a direction alone, and add up to 1
whatever the ray goes through. A passage is a segment of the path all the same, as in Mitsuba, and
no scattering event.

Source: the index-matched media boundaries of Mitsuba's `volpath`, for surfaces alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr

from onespp.render.mitsuba.images import shape_index
from onespp.render.mitsuba.variant import mi


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
def passage(scene: mi.Scene, si: mi.SurfaceInteraction3f, point: mi.Point3f, clear: mi.UInt32,
            most: mi.UInt32, active: mi.Bool) -> Passage:
    """From a surface to a light's point.

    Args:
        clear: of `MitsubaScene.clear`. most: surfaces that the ray may go through.
    """
    through, distance = mi.Color3f(dr.select(active, 1, 0)), mi.Float(0)
    shape, face = mi.UInt32(0), mi.UInt32(0)
    ray, left, going = si.spawn_ray_to(point), mi.UInt32(most), mi.Bool(active)
    while dr.hint(going, exclude=[scene, si, point, clear, active], label="panes"):
        pi = scene.ray_intersect_preliminary(ray, coherent=False, active=going)
        met = going & pi.is_valid()
        here = pi.compute_surface_interaction(ray, mi.RayFlags.All, met)
        index = shape_index(pi.shape, met)
        asked = met & (left > 0) & (dr.gather(mi.UInt32, clear, index, met) != 0)
        share = here.bsdf().eval_null_transmission(here, asked)
        passes = asked & (dr.max(share) > 0)
        through *= dr.select(passes, share, dr.select(met, 0, 1))
        stopped = met & ~passes
        distance = dr.select(stopped, dr.norm(here.p - si.p), distance)
        shape = dr.select(stopped, index, shape)
        face = dr.select(stopped, pi.prim_index, face)
        ray = here.spawn_ray_to(point)
        left -= dr.select(passes, mi.UInt32(1), 0)
        going = passes
    return Passage(through, distance, shape, face)


def goes_through(sample: mi.BSDFSample3f, shape: mi.ShapePtr, clear: mi.UInt32,
                 active: mi.Bool) -> mi.Bool:
    """Whether a sampled direction goes straight on through what shadow rays go through, too."""
    return (active & mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null)
            & (dr.gather(mi.UInt32, clear, shape_index(shape, active), active) != 0))
