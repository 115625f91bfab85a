"""Light that a vertex looks for: a few points of the lights compared, one shadow ray.

Symbols: M points x_i, the i-th drawn by Mitsuba's own emitter sampling from stratum (u + i) / M of
its first coordinate, so that they spread over the lights; c_i, its weight of multiple importance
sampling x BSDF x emitter over its density, as if nothing were in between; l(.) luminance. One of
them, j, is kept with probability l(c_j) / sum_i l(c_i) (a reservoir of one) and gets the vertex's
shadow ray, which sees it (v = 1) or not (v = 0). It counts

    v c_j / l(c_j) x 1/M sum_i l(c_i),

whose mean over j is 1/M sum_i v_i c_i: unbiased for any M, and with the same weights as M = 1,
which is what Mitsuba's `path` does. Each further candidate costs a BSDF's value and no ray.

With few lights that are large or far a second candidate is worth its price, a fourth is not; where
there are many, most candidates are of lights that bring nothing here, and it takes more of them.

Source: resampled importance sampling (Talbot et al. 2005) with the streaming reservoir of
Bitterli et al. 2020 (ReSTIR), of the candidates of one vertex alone.
"""

from __future__ import annotations

from typing import Any

import drjit as dr

from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.sampler import Sampler

from .panes import passage
from .reservoir import offered
from .strata import power_heuristic

GOLDEN = 0.6180339887498949  # fractional part; its multiples spread evenly over [0, 1)
FEWEST, MOST = 2, 8


def candidates_for(scene: mi.Scene) -> int:
    """M for a scene: half its lights or more, a power of two, within bounds."""
    half = max(1, (len(scene.emitters()) + 1) // 2)
    return min(max(FEWEST, 1 << (half - 1).bit_length()), MOST)


@dr.syntax
def sought_light(scene: mi.Scene, si: mi.SurfaceInteraction3f, sampler: Sampler, candidates: int,
                 active: mi.Bool, panes: Any = None, most: Any = None) -> mi.Color3f:
    """Radiance toward `si.wi` from light sampling, weighed against BSDF sampling; one shadow ray.

    Args:
        candidates: M, 1 or more (1: as Mitsuba's `path`, with the same random numbers).
        active: where there is a lobe that is not purely specular.
        panes, most: as of `panes.passage`; panes is None where rays go through nothing.
    """
    context = mi.BSDFContext()
    bsdf = si.bsdf()
    start = sampler.next_2d()
    choice = mi.Float(0.5)
    if dr.hint(candidates > 1, mode="scalar"):
        choice = sampler.next_1d()
    total = mi.Float(0)
    kept, kept_luminance, place = mi.Color3f(0), mi.Float(0), mi.Point3f(0)
    aim = None if panes is None else panes.no_aim()
    i = mi.UInt32(0)
    while dr.hint(i < candidates, exclude=[scene, sampler, context, bsdf, si, start, active, panes],
                  max_iterations=candidates, label="candidates"):
        y = start.y + GOLDEN * i  # each candidate is uniform for itself; together they spread
        point = mi.Point2f((start.x + i) / candidates, y - dr.floor(y))
        light, weight = scene.sample_emitter_direction(si, point, False, active)
        tried = None
        if dr.hint(panes is not None, mode="scalar"):
            assert panes is not None
            light, weight, tried = panes.aimed(si.p, light, weight, active)
        value, p = bsdf.eval_pdf(context, si, si.to_local(light.d), active)
        w = dr.select(light.delta, 1, power_heuristic(light.pdf, p))
        c = dr.select(active & (light.pdf != 0), w * value * weight, 0)
        luminance = mi.luminance(c)
        total += luminance
        taken, choice = offered(choice, luminance, total)
        kept = dr.select(taken, c, kept)
        kept_luminance = dr.select(taken, luminance, kept_luminance)
        place = dr.select(taken, light.p, place)
        if dr.hint(panes is not None, mode="scalar"):
            aim = dr.select(taken, tried, aim)
        i += 1
    lit = active & (total > 0)
    scale = total / (kept_luminance * candidates)
    if dr.hint(panes is not None, mode="scalar"):
        through = passage(scene, si, aim, panes, most, lit).through
        return dr.select(lit, through * kept * scale, 0)
    shadowed = scene.ray_test(si.spawn_ray_to(place), lit)
    return dr.select(lit & ~shadowed, kept * scale, 0)
