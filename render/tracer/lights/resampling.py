"""Direct light at the first hit by resampling a fixed stratification of all lights.

Symbols: k a stratum (a cell of an emitter's sample square, which `scene_lights.py` cuts into 4 x 4,
fewer where lights are many), c_k the unshadowed contribution of k's midpoint, l(.) luminance,
U = sum_k c_k, K strata in all. Stratum k is picked with

    p_k = (1 - DELTA) l(c_k) / l(U) + DELTA / K,

and a random point in it, with contribution c, gets the vertex's one shadow ray, which sees it
(v = 1) or not (v = 0). With the weight w of multiple importance sampling,

    D = v w c / p_k    and the lights that the BSDF's sample runs into, weighted likewise,

add up to an unbiased estimate of direct light. U has no noise, and V = l(D) / l(U) is the noisy
share of it that arrives: a filter of V alone leaves texture, shading and highlights of direct light
as they are. What purely specular lobes reflect is in neither.

Any weights do that add up to 1; those of `strata.py` tame lights that touch the surface, and leave
as little as they can to what the BSDF's sample runs into, which U does not tell. The uniform part
DELTA reaches lights whose midpoints all lie below the horizon.

Where several lights meet, V is noise of which of them was picked. So lights are in groups g
(`scene_lights.py`) with a visibility each. There w_k c_k is in the place of c_k where strata are
picked, w_k being the weight of k's midpoint; U_g is its sum over the strata of g, P_g that of p_k.
The ray, if it went to g, tells

    y = v l(w c) P_g / (p_k l(U_g)),   omega = l(w_k c_k) P_g / (p_k l(U_g)).

Over the picks in g, omega has the mean 1 and y that of V_g, the share of U_g that arrives: the sum
of y over that of omega, over pixels that see the same of g, is V_g without noise of choice. What
the BSDF's sample runs into is in no group; unshadowed, it is U - sum U_g.

A sky's strata are tens of degrees wide. A lobe that is narrower sees one midpoint or none, and U
would be bright in the wrong places. So where a surface has no other lobes, by `NARROW`, the sky is
in no U and in no group; its light arrives all the same.

Source: resampled importance sampling (Talbot et al. 2005) with the ratio estimator of Heitz et al.
2018 ("Combining analytic direct illumination and stochastic shadows"), U by midpoints.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from onespp.render.mitsuba.images import shape_index
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.sampler import Sampler

from .clusters import Clusters, light_of_cluster
from .middles import Middles, middles_of
from .panes import passage
from .reservoir import offered
from .strata import light_point
from .sun import SUN_BIT, Sun

DELTA = 0.1
MOST_CALLED = 16  # BSDFs, up to which each compares strata in a call of its own
NARROW = 0.2  # alpha, up to which lobes see too little of a sky's strata
_DIMMEST = 1e-6  # share of l(U): a group that gives less has no visibility


@dataclass
class Lights:
    """All strata of a scene's lights, in the order of `scene.emitters()`, the sun's last.

    stratum: which part of which light it is (`stratum_word`). group: that it is in. sizes: strata
    in each group, none where all lights are one; of_sky: those of the sky. emitters: E, 1 or more.
    environment: index of that emitter, E where there is none. sun: None where there is none.
    clusters: of each stratum, None where no light speaks for others. surfaces: `ptr` of the BSDFs
    that shapes have. middles: of the scene as it stands, None where each pixel is to ask the lights
    themselves.
    """

    stratum: mi.UInt32
    group: mi.UInt32
    sizes: tuple[int, ...]
    of_sky: tuple[int, ...]
    emitters: int
    environment: mi.UInt32
    sun: Sun | None = None
    clusters: Clusters | None = None
    surfaces: frozenset[int] = frozenset()
    middles: Middles | None = None

    def now(self, scene: mi.Scene) -> Lights:
        """With the middles of the scene as it stands, if all of its lights have them."""
        return replace(self, middles=middles_of(scene, self.stratum, self.share(self.stratum),
                                                self.clusters, self.sun))

    def is_sky(self, k: mi.UInt32) -> mi.Bool:
        """Whether stratum k is of the environment, but not its sun's."""
        word = dr.gather(mi.UInt32, self.stratum, k)
        return (word >> 8 == self.environment) & (word & SUN_BIT == 0)

    def share(self, stratum: mi.UInt32) -> mi.Float:
        """By how much the density of a stratum's light counts in weights: see `strata.py`."""
        return dr.select(stratum >> 8 == self.environment, 1 / self.emitters, 1)


@dataclass
class GroupSample:
    """What the shadow ray says of the group of lights that it went to (see the module's header).

    unshadowed: U_g of every group. group: g, -1 if no ray was sent. visibility: y. weight: omega.
    chance: P_g.
    """

    unshadowed: list[mi.Color3f]
    group: mi.Int32
    visibility: mi.Float
    weight: mi.Float
    chance: mi.Float


@dataclass
class DirectLight:
    """The light sample's part of D, and U (radiance, see the module's header); and its shadow ray.

    light: from the surface to the light's point, 0 where no ray was sent. blocker_distance: from
    the surface to what stopped the ray, 0 if nothing did. light_shape, blocker_shape: index in the
    JIT registry, 0 for none; blocker_face: which of its faces. to_sun: the ray went to the sun.
    groups: None where all lights are one.
    """

    direct: mi.Color3f
    unshadowed: mi.Color3f
    light: mi.Vector3f
    light_shape: mi.UInt32
    blocker_distance: mi.Float
    blocker_shape: mi.UInt32
    blocker_face: mi.UInt32
    to_sun: mi.Bool
    groups: GroupSample | None = None

    def through(self, throughput: mi.Color3f) -> DirectLight:
        """The same, seen in mirrors that leave so much of it."""
        groups = self.groups and replace(
            self.groups, unshadowed=[throughput * u for u in self.groups.unshadowed])
        return replace(self, direct=throughput * self.direct,
                       unshadowed=throughput * self.unshadowed, groups=groups)


@dataclass
class Pick:
    """A stratum, picked by p_k, its number; luminance: of its w_k c_k. unshadowed: U; by_group: of
    each U_g; total: l of their sum."""

    unshadowed: mi.Color3f
    total: mi.Float
    by_group: list[mi.Color3f]
    stratum: mi.UInt32
    luminance: mi.Float

    @staticmethod
    def none(lights: Lights) -> Pick:
        """Of a surface to which no light can give anything."""
        return Pick(mi.Color3f(0), mi.Float(0), [mi.Color3f(0) for _ in lights.sizes],
                    mi.UInt32(0), mi.Float(0))


@dr.syntax
def resample_lights(scene: mi.Scene, si: mi.SurfaceInteraction3f, sampler: Sampler,
                    active: mi.Bool, lights: Any, narrow: Any = None, panes: Any = None,
                    most: Any = None) -> DirectLight:
    """Direct light toward `si.wi` from light sampling, one shadow ray a lane.

    Args:
        lights: `Lights`, of the scene. narrow: mask of surfaces that have no lobes but such as
            `NARROW` tells, None where there are none or there is no sky.
        panes, most: as of `panes.passage`; panes is None where rays go through nothing.
    """
    strata = dr.width(lights.stratum)
    choice, jitter = sampler.next_1d(), sampler.next_2d()
    pick = _picked(scene, si, choice, active, lights, narrow)
    picked, total = pick.stratum, pick.total
    p = dr.select(total <= 0, 1, (1 - DELTA) * strata * pick.luminance / total + DELTA) / strata
    stratum = dr.gather(mi.UInt32, lights.stratum, picked, active)

    more = mi.Float(1)
    if dr.hint(lights.clusters is not None, mode="scalar"):
        stratum, more = light_of_cluster(lights.clusters, picked, scene, si, jitter,
                                         sampler.next_2d(), active, lights.sun)
    point = light_point(scene, si, stratum, jitter, active, lights.sun, panes)
    c, light = more * point.c, point.light
    lit = active & (dr.max(c) > 0)
    weight = point.weight(lights.share(stratum))
    if dr.hint(panes is not None, mode="scalar"):
        between = passage(scene, si, point.aim, panes, most, lit)
        shape, face, distance = between.shape, between.face, between.distance
        direct = dr.select(lit, between.through * weight * c / p, 0)
    else:
        toward = si.spawn_ray_to(light.p)
        blocker = scene.ray_intersect_preliminary(toward, coherent=False, active=lit)
        shadowed = blocker.is_valid()
        shape, face = shape_index(blocker.shape, lit & shadowed), blocker.prim_index
        distance = dr.select(lit & shadowed, blocker.t, 0)
        direct = dr.select(lit & ~shadowed, weight * c / p, 0)
    sample, to_sun = None, mi.Bool(False)
    if dr.hint(lights.sun is not None, mode="scalar"):
        to_sun = lit & ((stratum & SUN_BIT) != 0)
    if dr.hint(len(lights.sizes) > 0, mode="scalar"):
        group = dr.gather(mi.UInt32, lights.group, picked, active)
        told = active if narrow is None else active & ~(narrow & lights.is_sky(picked))
        sample = group_sample(lights, pick.by_group, group, total, mi.luminance(direct),
                              pick.luminance / p, told, narrow)
    return DirectLight(
        direct, pick.unshadowed,
        dr.select(lit, light.p - si.p, 0), shape_index(light.emitter.get_shape(), lit),
        distance, shape, face, to_sun, sample)


def _picked(scene: mi.Scene, si: mi.SurfaceInteraction3f, choice: mi.Float, active: mi.Bool,
            lights: Lights, narrow: mi.Bool | None) -> Pick:
    """A stratum, by what the middles of all give; choice: random, in [0, 1). narrow: as of
    `resample_lights`.

    Where few BSDFs are, each compares all strata in one call of its own, which saves a call a
    stratum; the more there are, the more of such calls have to be recorded.
    """
    middles, surfaces = lights.middles, lights.surfaces
    if middles is None:
        def asked(k: mi.UInt32, active: mi.Bool) -> tuple[mi.Color3f, mi.Float, mi.Float]:
            stratum = dr.gather(mi.UInt32, lights.stratum, k, active)
            middle = light_point(scene, si, stratum, mi.Point2f(0.5), active, lights.sun)
            scale = (1 if lights.clusters is None
                     else dr.gather(mi.Float, lights.clusters.scale, k, active))
            return middle.c, middle.weight(lights.share(stratum)), scale
        return _compared(asked, choice, active, lights, narrow)

    # (The last mask of a call is that of its lanes.)
    def at_one(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, choice: mi.Float,
               narrow: mi.Bool | None, active: mi.Bool) -> Pick:
        def told(k: mi.UInt32, active: mi.Bool) -> tuple[mi.Color3f, mi.Float, mi.Float]:
            middle = middles.at(k, si.p)
            value, pdf = bsdf.eval_pdf(mi.BSDFContext(), si, si.to_local(middle.d), active)
            c = dr.select(active & (middle.pdf > 0), value * middle.light, 0) / middle.square
            return c, middle.weight(pdf), middle.scale
        return _compared(told, choice, active, lights, narrow)

    def called(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, choice: mi.Float,
               narrow: mi.Bool | None, active: mi.Bool) -> Pick:
        is_lit = bsdf.ptr in surfaces and mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        return at_one(bsdf, si, choice, narrow, active) if is_lit else Pick.none(lights)

    if len(surfaces) > MOST_CALLED:
        return at_one(si.bsdf(), si, choice, narrow, active)
    return dr.dispatch(si.bsdf(), called, si, choice, narrow, active)


@dr.syntax
def _compared(contribution: Any, choice: mi.Float, active: mi.Bool, lights: Any,
              narrow: Any) -> Pick:
    """The same; contribution: of a stratum, where active: c, w, and s of `clusters.py`."""
    strata, groups = dr.width(lights.stratum), len(lights.sizes)
    # One pass: the sum, and a pick in proportion to luminance (a reservoir of one).
    left = mi.Float(choice)
    unshadowed, total = mi.Color3f(0), mi.Float(0)
    picked, picked_luminance = mi.UInt32(0), mi.Float(0)
    by_group = [mi.Color3f(0) for _ in lights.sizes]
    k = mi.UInt32(0)
    while dr.hint(k < strata, exclude=[active, lights, contribution, narrow],
                  max_iterations=strata, label="lights"):
        c, weight, scale = contribution(k, active)
        if dr.hint(lights.clusters is not None, mode="scalar"):
            c *= scale
        told = mi.Color3f(c)
        if dr.hint(narrow is not None, mode="scalar"):
            told = dr.select(narrow & lights.is_sky(k), 0, c)
        unshadowed += told
        if dr.hint(groups > 0, mode="scalar"):
            c = weight * c
            by_group = added(by_group, dr.gather(mi.UInt32, lights.group, k, active),
                             weight * told)
        luminance = mi.luminance(c)
        total += luminance
        taken, left = offered(left, luminance, total)
        picked = dr.select(taken, k, picked)
        picked_luminance = dr.select(taken, luminance, picked_luminance)
        k += 1

    dark = total <= 0
    uniform = dark | (left < DELTA)
    anywhere = dr.select(dark, choice, left / DELTA)
    picked = dr.select(uniform, dr.minimum(mi.UInt32(anywhere * strata), strata - 1), picked)
    c, weight, scale = contribution(picked, active & uniform)
    if dr.hint(groups > 0, mode="scalar"):
        c = weight * c
    if dr.hint(lights.clusters is not None, mode="scalar"):
        c *= scale
    picked_luminance = dr.select(uniform, mi.luminance(c), picked_luminance)
    return Pick(unshadowed, total, by_group, picked, picked_luminance)


def added(lights: list[mi.Color3f], group: mi.UInt32, light: mi.Color3f) -> list[mi.Color3f]:
    """The light of each group, with some more of one."""
    return [dr.select(group == g, u + light, u) for g, u in enumerate(lights)]


def group_sample(lights: Lights, unshadowed: list[mi.Color3f], group: mi.UInt32,
                 total: mi.Float, arrived: mi.Float, possible: mi.Float,
                 active: mi.Bool, narrow: mi.Bool | None) -> GroupSample:
    """What a ray to a group tells; arrived: v l(w c) / p_k. possible: l(w_k c_k) / p_k. narrow: as
    of `resample_lights`."""
    chance, of_group = mi.Float(0), mi.Float(0)
    for g, (size, of_sky) in enumerate(zip(lights.sizes, lights.of_sky)):
        if narrow is not None and of_sky:
            size = size - dr.select(narrow, mi.Float(of_sky), 0)
        luminance, is_it = mi.luminance(unshadowed[g]), group == g
        of_group = dr.select(is_it, luminance, of_group)
        share = (1 - DELTA) * luminance / total + DELTA * (size / sum(lights.sizes))
        chance = dr.select(is_it, share, chance)
    told = active & (of_group > _DIMMEST * total)
    scale = dr.select(told, chance / of_group, 0)
    return GroupSample(unshadowed, dr.select(told, mi.Int32(group), -1), scale * arrived,
                       scale * possible, dr.select(told, chance, 0))
