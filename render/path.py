"""The path tracer: unidirectional, next-event estimation, multiple importance sampling.

Symbols (Veach 1997): beta, throughput of the path so far over its probability; p, a density over
solid angle; `depth`, segments behind the current vertex.

The estimator is that of Mitsuba's `path` without Russian roulette (a scene's paths are short).
It differs in what it returns: radiance split by the number of scattering events, from one primary
hit that the G-buffer shares.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr

from .sampler import Sampler
from .variant import mi


@dataclass
class Radiance:
    """Radiance toward the camera, linear, by scattering events: none, one, more."""

    emission: mi.Color3f
    direct: mi.Color3f
    indirect: mi.Color3f


@dr.syntax
def trace(scene: mi.Scene, ray: mi.Ray3f, pi: mi.PreliminaryIntersection3f, sampler: Sampler,
          max_depth: int) -> Radiance:
    """One path a lane.

    Args:
        scene: what to trace. ray: camera rays. pi: their first hits.
        sampler: random numbers, advanced by the call.
        max_depth: longest path in segments, as in Mitsuba (1: emission, 2: direct light).
    """
    context = mi.BSDFContext()
    ray = mi.Ray3f(ray)
    pi = mi.PreliminaryIntersection3f(pi)
    emission, direct, indirect = mi.Color3f(0), mi.Color3f(0), mi.Color3f(0)
    beta = mi.Color3f(1)
    depth = mi.UInt32(0)
    previous_p = mi.Point3f(0)
    bsdf_pdf = mi.Float(1)
    from_delta = mi.Bool(True)
    active = mi.Bool(True)

    while dr.hint(active, max_iterations=max_depth, label="path"):
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
        light, light_weight = scene.sample_emitter_direction(si, sampler.next_2d(), True, smooth)
        lit = smooth & (light.pdf != 0)
        bsdf_value, p, bsdf_sample, bsdf_weight = bsdf.eval_pdf_sample(
            context, si, si.to_local(light.d), sampler.next_1d(), sampler.next_2d(), inner)
        mis = dr.select(light.delta, 1, power_heuristic(light.pdf, p))
        sought = dr.select(lit, beta * mis * bsdf_value * light_weight, 0)

        emission += dr.select(depth == 0, found, 0)
        direct += dr.select(depth == 1, found, 0) + dr.select(depth == 0, sought, 0)
        indirect += dr.select(depth >= 2, found, 0) + dr.select(depth >= 1, sought, 0)

        ray = si.spawn_ray(si.to_world(bsdf_sample.wo))
        beta *= bsdf_weight
        bsdf_pdf = mi.Float(bsdf_sample.pdf)
        from_delta = mi.has_flag(bsdf_sample.sampled_type, mi.BSDFFlags.Delta)
        previous_p = mi.Point3f(si.p)
        active = inner & (dr.max(beta) > 0)
        depth += 1
        pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active)

    return Radiance(emission, direct, indirect)


def power_heuristic(p: mi.Float, q: mi.Float) -> mi.Float:
    """Power heuristic weight of a sample drawn with density p where q could have drawn it too.

    Source: Veach 1997, section 9.2.2, exponent 2. Infinite or zero densities give 1 or 0.
    """
    w = dr.square(p) / (dr.square(p) + dr.square(q))
    return dr.select(p > 0, dr.select(dr.isfinite(w), w, 1), 0)
