"""Direct light at the first hit by resampling a fixed stratification of all lights.

Symbols: k a stratum (each emitter's sample square is cut into GRID x GRID), c_k the unshadowed
contribution of k's midpoint, l(.) luminance, U = sum_k c_k, K strata in all. Stratum k is picked
with

    p_k = (1 - DELTA) l(c_k) / l(U) + DELTA / K,

and a random point in it, with contribution c, gets the vertex's one shadow ray, which sees it
(v = 1) or not (v = 0). With the weight w of multiple importance sampling,

    D = v w c / p_k    and the lights that the BSDF's sample runs into, weighted likewise,

add up to an unbiased estimate of direct light. U has no noise, and V = l(D) / l(U) is the noisy
share of it that arrives: a filter of V alone leaves texture, shading and highlights of direct light
as they are. What purely specular lobes reflect is in neither.

The weights are those of plain light sampling: any weights do that add up to 1, and these tame
lights that touch the surface. The uniform part DELTA reaches lights whose midpoints all lie below
the horizon.

Source: resampled importance sampling (Talbot et al. 2005) with the ratio estimator of Heitz et al.
2018 ("Combining analytic direct illumination and stochastic shadows"), U by midpoints.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr

from onespp.render.mitsuba.variant import mi

from .sampler import Sampler

GRID = 4
DELTA = 0.1


@dataclass
class DirectLight:
    """The light sample's part of D, and U (radiance, see the module's header); and its shadow ray.

    light: from the surface to the light's point, 0 where no ray was sent. blocker_distance: from
    the surface to what stopped the ray, 0 if nothing did. light_shape, blocker_shape: index in the
    JIT registry, 0 for none.
    """

    direct: mi.Color3f
    unshadowed: mi.Color3f
    light: mi.Vector3f
    light_shape: mi.UInt32
    blocker_distance: mi.Float
    blocker_shape: mi.UInt32


@dr.syntax
def resample_lights(scene: mi.Scene, si: mi.SurfaceInteraction3f, sampler: Sampler,
                    active: mi.Bool) -> DirectLight:
    """Direct light toward `si.wi` from light sampling, one shadow ray a lane."""
    emitters = len(scene.emitters())
    strata = GRID * GRID * emitters
    choice, jitter = sampler.next_1d(), sampler.next_2d()

    # One pass: the sum, and a pick in proportion to luminance (a reservoir of one).
    left = mi.Float(choice)
    unshadowed, total = mi.Color3f(0), mi.Float(0)
    picked, picked_luminance = mi.UInt32(0), mi.Float(0)
    k = mi.UInt32(0)
    while dr.hint(k < strata, max_iterations=strata, label="lights"):
        c, _ = contribution(scene, si, k, mi.Point2f(0.5), active)
        luminance = mi.luminance(c)
        unshadowed += c
        total += luminance
        share = dr.select(total > 0, luminance / total, 0)
        taken = left < share
        picked = dr.select(taken, k, picked)
        picked_luminance = dr.select(taken, luminance, picked_luminance)
        # What is left of the random number is uniform again.
        left = dr.select(taken, left / share, (left - share) / dr.maximum(1 - share, 1e-9))
        left = dr.clip(left, 0, 1 - 2.0**-24)
        k += 1

    dark = total <= 0
    uniform = dark | (left < DELTA)
    anywhere = dr.select(dark, choice, left / DELTA)
    picked = dr.select(uniform, dr.minimum(mi.UInt32(anywhere * strata), strata - 1), picked)
    midpoint, _ = contribution(scene, si, picked, mi.Point2f(0.5), active & uniform)
    picked_luminance = dr.select(uniform, mi.luminance(midpoint), picked_luminance)
    p = dr.select(dark, 1, (1 - DELTA) * strata * picked_luminance / total + DELTA) / strata

    c, light = contribution(scene, si, picked, jitter, active)
    lit = active & (dr.max(c) > 0)
    toward = si.spawn_ray_to(light.p)
    blocker = scene.ray_intersect_preliminary(toward, coherent=False, active=lit)
    shadowed = blocker.is_valid()
    bsdf_pdf = si.bsdf().pdf(mi.BSDFContext(), si, si.to_local(light.d), lit)
    w = dr.select(light.delta, 1, power_heuristic(light.pdf / emitters, bsdf_pdf))
    return DirectLight(
        dr.select(lit & ~shadowed, w * c / p, 0), unshadowed,
        dr.select(lit, light.p - si.p, 0), shape_index(light.emitter.get_shape(), lit),
        dr.select(lit & shadowed, blocker.t, 0), shape_index(blocker.shape, lit & shadowed))


def shape_index(shape: mi.ShapePtr, active: mi.Bool) -> mi.UInt32:
    """Index in the JIT registry, 0 where not `active`."""
    return dr.select(active, dr.reinterpret_array(mi.UInt32, shape), 0)


def contribution(scene: mi.Scene, si: mi.SurfaceInteraction3f, k: mi.UInt32, place: mi.Point2f,
                 active: mi.Bool) -> tuple[mi.Color3f, mi.DirectionSample3f]:
    """c_k at a place in stratum k, and the point of the light that it comes from."""
    emitter = dr.gather(mi.EmitterPtr, scene.emitters_dr(), k // (GRID * GRID), active)
    cell = k % (GRID * GRID)
    sample = (mi.Point2f(cell % GRID, cell // GRID) + place) / GRID
    light, weight = emitter.sample_direction(si, sample, active)
    value = si.bsdf().eval(mi.BSDFContext(), si, si.to_local(light.d), active)
    c = dr.select(active & (light.pdf > 0), value * weight, 0) / (GRID * GRID)
    return c, light


def power_heuristic(p: mi.Float, q: mi.Float) -> mi.Float:
    """Power heuristic weight of a sample drawn with density p where q could have drawn it too.

    Source: Veach 1997, section 9.2.2, exponent 2. Infinite or zero densities give 1 or 0.
    """
    w = dr.square(p) / (dr.square(p) + dr.square(q))
    return dr.select(p > 0, dr.select(dr.isfinite(w), w, 1), 0)
