"""The path tracer: unidirectional, next-event estimation, multiple importance sampling.

Symbols (Veach 1997): beta, throughput of the path so far over its probability; p, a density over
solid angle; `depth`, segments behind the current vertex.

The estimator is that of Mitsuba's `path` without Russian roulette (a scene's paths are short).
It differs in what it returns: radiance split by the number of scattering events, from one primary
hit that the G-buffer shares; and what a reflection needs: the part of indirect light whose first
direction was sampled from a glossy or mirror lobe, and what that path met next. Where a surface has
several lobes, that is an unbiased share of the whole (each direction counts as glossy with the
probability that the glossy lobe chose it), not the glossy lobe's value alone: it costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr

from onespp.render.mitsuba.variant import mi

from .lights import DirectLight, LightGroups, power_heuristic, resample_lights, shape_index
from .sampler import Sampler


@dataclass
class Radiance:
    """Radiance toward the camera, linear, by scattering events: none, one, more.

    specular: the part of `indirect` that left the first hit through a glossy or mirror lobe.
    hit_distance: from the first hit to the next, 0 if there is none. hit_shape: the shape met
    there, its index in the JIT registry, 0 if there is none.
    `unshadowed`, `visibility` and `shadow_ray` are there if direct light was resampled: see
    `render/tracer/lights.py`.
    """

    emission: mi.Color3f
    direct: mi.Color3f
    indirect: mi.Color3f
    specular: mi.Color3f
    hit_distance: mi.Float
    hit_shape: mi.UInt32
    unshadowed: mi.Color3f | None = None
    visibility: mi.Float | None = None
    shadow_ray: DirectLight | None = None


@dr.syntax
def trace(scene: mi.Scene, ray: mi.Ray3f, pi: mi.PreliminaryIntersection3f, sampler: Sampler,
          max_depth: int, resampled: bool = False, groups: LightGroups | None = None) -> Radiance:
    """One path a lane.

    Args:
        scene: what to trace. ray: camera rays. pi: their first hits.
        sampler: random numbers, advanced by the call.
        max_depth: longest path in segments, as in Mitsuba (1: emission, 2: direct light).
        resampled: direct light at the first hit by resampling instead of by MIS.
        groups: of lights, which the shadow ray then tells apart.
    """
    context = mi.BSDFContext()
    ray = mi.Ray3f(ray)
    pi = mi.PreliminaryIntersection3f(pi)
    emission, direct, indirect = mi.Color3f(0), mi.Color3f(0), mi.Color3f(0)
    specular, through_gloss = mi.Color3f(0), mi.Bool(False)
    hit_distance, hit_shape = mi.Float(0), mi.UInt32(0)
    arrived = mi.Color3f(0)  # direct light, but for what purely specular lobes reflect
    beta = mi.Color3f(1)
    depth = mi.UInt32(0)
    previous_p = mi.Point3f(0)
    bsdf_pdf = mi.Float(1)
    from_delta = mi.Bool(True)
    active = mi.Bool(True)

    split = None
    if dr.hint(resampled and max_depth > 1, mode="scalar"):
        first = pi.compute_surface_interaction(ray)
        smooth = first.is_valid() & mi.has_flag(first.bsdf().flags(), mi.BSDFFlags.Smooth)
        split = resample_lights(scene, first, sampler, smooth, groups)
        direct += split.direct
        arrived += split.direct

    while dr.hint(active, exclude=[split], max_iterations=max_depth, label="path"):
        si = pi.compute_surface_interaction(ray)
        bsdf = si.bsdf(ray)

        # Light that the last direction ran into (for depth 0: what the camera sees itself).
        reference = dr.zeros(mi.Interaction3f)
        reference.p = previous_p
        hit = mi.DirectionSample3f(scene, si, reference)
        emitter_pdf = scene.pdf_emitter_direction(reference, hit, ~from_delta)
        found = beta * power_heuristic(bsdf_pdf, emitter_pdf) * hit.emitter.eval(si)

        # Light that this vertex looks for: one shadow ray.
        inner = si.is_valid() & (depth + 1 < max_depth)
        smooth = inner & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        if dr.hint(resampled, mode="scalar"):
            smooth &= depth > 0
            arrived += dr.select((depth == 1) & ~from_delta, found, 0)
        light, light_weight = scene.sample_emitter_direction(si, sampler.next_2d(), True, smooth)
        lit = smooth & (light.pdf != 0)
        bsdf_value, p, bsdf_sample, bsdf_weight = bsdf.eval_pdf_sample(
            context, si, si.to_local(light.d), sampler.next_1d(), sampler.next_2d(), inner)
        mis = dr.select(light.delta, 1, power_heuristic(light.pdf, p))
        sought = dr.select(lit, beta * mis * bsdf_value * light_weight, 0)

        emission += dr.select(depth == 0, found, 0)
        direct += dr.select(depth == 1, found, 0) + dr.select(depth == 0, sought, 0)
        further = dr.select(depth >= 2, found, 0) + dr.select(depth >= 1, sought, 0)
        indirect += further
        specular += dr.select(through_gloss, further, 0)

        ray = si.spawn_ray(si.to_world(bsdf_sample.wo))
        beta *= bsdf_weight
        bsdf_pdf = mi.Float(bsdf_sample.pdf)
        from_delta = mi.has_flag(bsdf_sample.sampled_type, mi.BSDFFlags.Delta)
        through_gloss |= (depth == 0) & (from_delta | mi.has_flag(bsdf_sample.sampled_type,
                                                                  mi.BSDFFlags.Glossy))
        previous_p = mi.Point3f(si.p)
        active = inner & (dr.max(beta) > 0)
        depth += 1
        pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active)
        met = active & (depth == 1) & pi.is_valid()
        hit_distance = dr.select(met, pi.t, hit_distance)
        hit_shape = dr.select(met, shape_index(pi.shape, met), hit_shape)

    radiance = Radiance(emission, direct, indirect, specular, hit_distance, hit_shape)
    return _with_split(radiance, arrived, split)


def _with_split(radiance: Radiance, arrived: mi.Color3f, split: DirectLight | None) -> Radiance:
    if split is not None:
        possible = mi.luminance(split.unshadowed)
        radiance.unshadowed, radiance.shadow_ray = split.unshadowed, split
        radiance.visibility = dr.select(possible > 0, mi.luminance(arrived) / possible, 0)
    return radiance
