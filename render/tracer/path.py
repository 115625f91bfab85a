"""The path tracer: unidirectional, next-event estimation, multiple importance sampling.

Symbols (Veach 1997): beta, throughput of the path so far over its probability; p, a density over
solid angle; `depth`, segments behind the current vertex.

The estimator has the mean of Mitsuba's `path`, and less noise: a vertex may compare several points
of the lights (`candidates.py`), looks for light through masks and panes (`panes.py`), in flat
mirrors (`mirrors.py`) and by way of balls (`balls/`), and there is Russian roulette only where
paths may have more than `SHORT` segments: shorter ones cost little, and all that arrives counts. It
differs in what it returns:
radiance split by the number of scattering events, from one primary hit that the G-buffer shares;
and what a reflection needs: the part of indirect light whose first direction was sampled from a
glossy or mirror lobe, and what that path met next. Where a surface has several lobes, that is an
unbiased share of the whole (each direction counts as glossy with the probability that the glossy
lobe chose it), not the glossy lobe's value alone: it costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr

from onespp.render.mitsuba.images import shape_index
from onespp.render.mitsuba.variant import mi

from .layers import Course
from .lights.balls.balls import Balls
from .lights.balls.light import light_by_balls
from .lights.candidates import sought_light
from .lights.mirrors import Mirrors, light_in_mirrors
from .lights.origin import Origin, found_light
from .lights.panes import Panes
from .lights.resampling import DirectLight, Lights, resample_lights
from .replacement import Layer, Replaced
from .sampler import Sampler, Sobol

SHORT = 8  # segments, up to which paths end by themselves
FIRST = 5  # segments after which roulette begins, as in Mitsuba
_LIKELY = 0.95  # the largest probability to go on
_SEEKING = 2  # where there are balls or panes, vertices of a frame's path that look for light by
              # way of balls and mirrors: what later ones gain is not worth their time
LARGEST_VISIBILITY = 1e4  # picks of 16 lights give up to 2560, as `resampling.py` weighs them


@dataclass
class Radiance:
    """Radiance toward the camera, linear, by scattering events: none, one, more.

    specular: the part of `indirect` that left the first hit through a glossy or mirror lobe.
    hit_distance: from the first hit to the next, 0 if there is none. hit_shape: the shape met
    there, its index in the JIT registry, 0 if there is none; hit_face: which of its faces.
    caustic: the part of `indirect` that comes to the first hit by one ball (`lights/balls/`),
    None where there are none.
    straight: the part of all of it that straight paths found (`layers.py`), if that was asked for.
    `unshadowed`, `visibility` and `shadow_ray` are there if direct light was resampled: see
    `render/tracer/lights/resampling.py`.
    """

    emission: mi.Color3f
    direct: mi.Color3f
    indirect: mi.Color3f
    specular: mi.Color3f
    hit_distance: mi.Float
    hit_shape: mi.UInt32
    hit_face: mi.UInt32
    caustic: mi.Color3f | None = None
    unshadowed: mi.Color3f | None = None
    visibility: mi.Float | None = None
    shadow_ray: DirectLight | None = None
    straight: mi.Color3f | None = None


@dr.syntax
def trace(scene: mi.Scene, ray: mi.Ray3f, pi: mi.PreliminaryIntersection3f, sampler: Sampler,
          max_depth: int, candidates: int = 1, lights: Lights | None = None,
          behind: Replaced | Layer | None = None, tell_straight: bool = False,
          narrow: Callable[[mi.SurfaceInteraction3f], mi.Bool] | None = None,
          panes: Panes | None = None, mirrors: Mirrors | None = None,
          balls: Balls | None = None, bent: mi.UInt32 | None = None) -> Radiance:
    """One path a lane.

    Args:
        scene: what to trace. ray: camera rays. pi: their first hits.
        sampler: random numbers, advanced by the call.
        max_depth: longest path in segments, as in Mitsuba (1: emission, 2: direct light).
        candidates: points of the lights that a vertex compares before it sends its shadow ray.
        lights: those that direct light at the first hit is resampled from; None: it is by MIS too.
        behind: what `ray` and `pi` are behind, if anything. tell_straight: see `Radiance.straight`.
        narrow: whether a surface is so, as of `resample_lights`. panes, mirrors, balls: of the
            scene as it stands, None where light goes through none, or is looked for in none.
        bent: glass of `MitsubaScene`, in which straight paths may turn; None where there is none.
    """
    context = mi.BSDFContext()
    o, d, pi = mi.Point3f(ray.o), mi.Vector3f(ray.d), _as_state(pi)
    emission, direct, indirect = mi.Color3f(0), mi.Color3f(0), mi.Color3f(0)
    specular, through_gloss = mi.Color3f(0), mi.Bool(False)
    hit_distance, hit_shape, hit_face = mi.Float(0), mi.UInt32(0), mi.UInt32(0)
    straight = mi.Color3f(0) if tell_straight else None
    course = Course.begun(bent) if tell_straight else None
    caustic = None if balls is None else mi.Color3f(0)
    arrived = None  # direct light, but for what purely specular lobes reflect
    beta, eta = mi.Color3f(1), mi.Float(1) if max_depth > SHORT else None
    depth, longest, opacity = mi.UInt32(0), max_depth, None
    events = None if panes is None else mi.UInt32(0)  # of scattering, where they are not as many
    origin = Origin.camera(mirrors, balls, panes, compares=True)
    active = mi.Bool(True)
    if dr.hint(behind is not None, mode="scalar"):
        assert behind is not None
        beta, longest = mi.Color3f(behind.throughput), max_depth - behind.before
        opacity = behind.opacity
        active = dr.max(behind.throughput) > 0  # a packet without layers takes no step

    split = None
    if dr.hint(lights is not None, mode="scalar"):
        first = pi.compute_surface_interaction(ray)
        smooth = first.is_valid() & mi.has_flag(first.bsdf().flags(), mi.BSDFFlags.Smooth)
        if dr.hint(behind is not None, mode="scalar"):
            smooth &= longest > 1
        split = resample_lights(scene, first, sampler, smooth, lights,
                                None if narrow is None else narrow(first), panes,
                                mi.UInt32(longest) - 2)
        if dr.hint(behind is not None, mode="scalar"):
            assert behind is not None
            split = split.through(behind.throughput)
        direct += split.direct
        arrived = mi.Color3f(split.direct)

    while dr.hint(active, exclude=[scene, context, lights, longest, opacity, split, behind, narrow,
                                   panes, mirrors, balls, bent], max_iterations=max_depth,
                  label="path"):
        si = pi.compute_surface_interaction(mi.Ray3f(o, d))
        bsdf = si.bsdf()
        order = depth if events is None else events

        # Light that the last direction ran into (for depth 0: what the camera sees itself).
        surer = 1.0
        if dr.hint(lights is not None, mode="scalar"):
            assert lights is not None
            surer = dr.select((order == 1) & si.is_valid(), lights.emitters, 1)
        found = beta * found_light(scene, si, origin, surer, balls, panes, mirrors)

        # Light that this vertex looks for: one shadow ray.
        inner = si.is_valid() & (depth + 1 < longest)
        smooth = inner & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        if dr.hint(lights is not None, mode="scalar"):
            smooth &= depth > 0
            arrived += dr.select((order == 1) & ~origin.from_delta, found, 0)
        sought = beta * sought_light(scene, si, sampler, candidates, smooth, panes,
                                     longest - depth - 2)
        sent, seeks = mi.Color3f(0), mi.Bool(False)
        if dr.hint(mirrors is not None or balls is not None, mode="scalar"):
            # (Not where some of it would be specular.)
            seeks = inner & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) & (depth + 2 < longest)
            seeks &= (depth > 0) | ~mi.has_flag(bsdf.flags(), mi.BSDFFlags.Glossy)
            if dr.hint(balls is not None or panes is not None, mode="scalar"):
                seeks &= depth < _SEEKING
            if dr.hint(mirrors is not None, mode="scalar"):
                sent += beta * light_in_mirrors(scene, si, sampler, mirrors, longest - depth,
                                                seeks)
            if dr.hint(balls is not None, mode="scalar"):
                assert caustic is not None
                by_ball = beta * light_by_balls(scene, si, sampler, balls, depth == 0,
                                                longest - depth, seeks)
                sent += by_ball
                caustic += dr.select(depth == 0, by_ball, 0) + dr.select(
                    origin.came_by_ball(depth), found, 0)
        lobe = sampler.next_1d()
        if dr.hint(opacity is not None, mode="scalar"):  # of a mask's lobes, the surface's alone
            lobe *= dr.select(depth == 0, opacity, 1)
        bsdf_sample, bsdf_weight = bsdf.sample(context, si, lobe, sampler.next_2d(), inner)
        if dr.hint(opacity is not None, mode="scalar"):  # (its density has the opacity in it)
            bsdf_weight *= dr.select(depth == 0, opacity, 1)

        emission += dr.select(order == 0, found, 0)
        direct += dr.select(order == 1, found, 0) + dr.select(order == 0, sought, 0)
        further = dr.select(order >= 2, found, 0) + dr.select(order >= 1, sought, 0)
        if dr.hint(mirrors is not None or balls is not None, mode="scalar"):
            further += sent
        indirect += further
        specular += dr.select(through_gloss, further, 0)

        onward = si.spawn_ray(si.to_world(bsdf_sample.wo))
        o, d = onward.o, onward.d
        beta *= bsdf_weight
        is_delta, is_glossy = (mi.has_flag(bsdf_sample.sampled_type, flag)
                               for flag in (mi.BSDFFlags.Delta, mi.BSDFFlags.Glossy))
        through_gloss |= (depth == 0) & (is_delta | is_glossy)
        if dr.hint(tell_straight, mode="scalar"):
            assert straight is not None
            assert course is not None
            straight += dr.select(course.is_straight, found, 0)
            course = course.after(si, bsdf_sample, 1.0 if opacity is None else
                                  dr.select(depth == 0, opacity, 1), bent)
        origin, goes_on = origin.after(si, bsdf_sample, panes, mirrors, balls, seeks, inner,
                                       depth == 0)
        if dr.hint(events is not None, mode="scalar"):
            assert events is not None
            events += dr.select(goes_on, mi.UInt32(0), 1)
        active = inner & (dr.max(beta) > 0)
        depth += 1
        if dr.hint(max_depth > SHORT, mode="scalar"):
            assert eta is not None
            eta *= bsdf_sample.eta
            beta, goes_on = _roulette(beta, eta, depth, sampler.next_1d())
            active &= goes_on
        pi = scene.ray_intersect_preliminary(onward, coherent=False, active=active)
        met = active & (depth == 1) & pi.is_valid()
        hit_distance = dr.select(met, pi.t, hit_distance)
        hit_shape = dr.select(met, shape_index(pi.shape, met), hit_shape)
        hit_face = dr.select(met, pi.prim_index, hit_face)

    radiance = Radiance(emission, direct, indirect, specular, hit_distance, hit_shape, hit_face,
                        caustic, straight=straight)
    return _with_split(radiance, arrived, split)


@dr.syntax
def sum_of_samples(scene: mi.Scene, ray: mi.Ray3f, pi: mi.PreliminaryIntersection3f, sampler: Sobol,
                   start: mi.UInt32, end: mi.UInt32, max_depth: int,
                   candidates: int, panes: Panes | None = None,
                   mirrors: Mirrors | None = None, balls: Balls | None = None) -> mi.Color3f:
    """Sum of samples `start` to `end` - 1 of all lanes: the paths of `trace`, radiance alone.

    One loop over the vertices of all samples: a lane whose path has ended begins the next from the
    first hit, which is the same for all of them, and waits for no other lane's.

    Args:
        scene, ray, pi, max_depth, candidates, panes, mirrors, balls: as for `trace`.
        sampler: with the lanes' scrambling, at any sample.
    """
    first = pi.compute_surface_interaction(ray)
    total = mi.Float(end - start) * first.emitter(scene).eval(first)
    o, d, pi = mi.Point3f(ray.o), mi.Vector3f(ray.d), _as_state(pi)
    beta, eta, depth = mi.Color3f(0), mi.Float(1), mi.UInt32(0)
    origin = Origin.camera(mirrors, balls, panes)
    sample, dimension = mi.UInt32(start) - 1, mi.UInt32(0)
    alive = mi.Bool(False)  # on the way to a hit; at the beginning, all have to start
    running = first.is_valid() & (start < end) & (max_depth > 1)

    while dr.hint(running, exclude=[first, end, sampler, panes, mirrors, balls], label="samples"):
        met = pi.compute_surface_interaction(mi.Ray3f(o, d), active=alive)
        total += dr.select(alive, beta * found_light(scene, met, origin, balls=balls,
                                                      panes=panes, mirrors=mirrors), 0)

        alive &= met.is_valid() & (depth + 1 < max_depth)
        sample += dr.select(alive, mi.UInt32(0), 1)
        numbers = sampler.at(sample, dr.select(alive, dimension, 0))
        running = sample < end
        beta, depth = dr.select(alive, beta, 1), dr.select(alive, depth, 0)
        eta = dr.select(alive, eta, 1)
        si = dr.select(alive, met, first)

        bsdf = si.bsdf()
        smooth = running & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        total += beta * sought_light(scene, si, numbers, candidates, smooth, panes,
                                     max_depth - depth - 2)
        seeks = mi.Bool(False)
        if dr.hint(mirrors is not None or balls is not None, mode="scalar"):
            seeks = smooth & (depth + 2 < max_depth)
            if dr.hint(mirrors is not None, mode="scalar"):
                total += beta * light_in_mirrors(scene, si, numbers, mirrors, max_depth - depth,
                                                 seeks)
            if dr.hint(balls is not None, mode="scalar"):
                total += beta * light_by_balls(scene, si, numbers, balls, None, max_depth - depth,
                                               seeks)
        bsdf_sample, bsdf_weight = bsdf.sample(mi.BSDFContext(), si, numbers.next_1d(),
                                               numbers.next_2d(), running)
        onward = si.spawn_ray(si.to_world(bsdf_sample.wo))
        o, d = onward.o, onward.d
        beta *= bsdf_weight
        origin, _ = origin.begun(~alive).after(si, bsdf_sample, panes, mirrors, balls, seeks,
                                               running)
        alive = running & (dr.max(beta) > 0)
        depth += 1
        if dr.hint(max_depth > SHORT, mode="scalar"):
            eta *= bsdf_sample.eta
            beta, goes_on = _roulette(beta, eta, depth, numbers.next_1d())
            alive &= goes_on
        dimension = mi.UInt32(numbers.dimension)
        pi = scene.ray_intersect_preliminary(onward, coherent=False, active=alive)
    return total


def _as_state(pi: mi.PreliminaryIntersection3f) -> mi.PreliminaryIntersection3f:
    """A copy to be the state of a loop, without constants.

    What Embree alone needs OptiX leaves 0, before the loop and in it, and Dr.Jit records a loop a
    second time without a state that is a constant.
    """
    pi = mi.PreliminaryIntersection3f(pi)
    for field in (pi.valid, pi.shape_index, pi.instance):
        if field.state == dr.VarState.Literal:
            dr.make_opaque(field)
    return pi


def _roulette(beta: mi.Color3f, eta: mi.Float, depth: mi.UInt32,
              choice: mi.Float) -> tuple[mi.Color3f, mi.Bool]:
    """Throughput of what goes on, and whether a path does: by what it may still bring.

    Args:
        eta: product of the relative indices of refraction that it went through. Radiance grows with
            their square on the way in and falls on the way out, which is no loss.

    Source: as Mitsuba's `path`, with its default depth.
    """
    likely = dr.minimum(dr.max(beta) * dr.square(eta), _LIKELY)
    tried = depth >= FIRST
    return (dr.select(tried & (likely > 0), beta / likely, beta),
            ~tried | (choice < likely))


def _with_split(radiance: Radiance, arrived: mi.Color3f | None,
                split: DirectLight | None) -> Radiance:
    if split is not None:
        possible = mi.luminance(split.unshadowed)
        radiance.unshadowed, radiance.shadow_ray = split.unshadowed, split
        # Where U underflows (rough glass seen from inside) the ratio says nothing; D has it all.
        radiance.visibility = dr.select(possible > 0, dr.minimum(
            mi.luminance(arrived) / possible, LARGEST_VISIBILITY), 0)
    return radiance
