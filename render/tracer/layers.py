"""What can be said without noise of the layers that a pixel leaves aside.

Where a surface both reflects and lets through, or is a half-open mask, the ray that goes on from
there shows one of two layers (`replacement.py`). The others are followed too, from surface to
surface, as long as a sample of the surface goes on in one and the same direction more often than
not. What they come to gives guides of the brightest of them; and the lamps and the sky that they
meet there, `lamps`, is light that a path finds by chance, often by rare chance: the picture of a
lamp in a ball of glass. In bent glass a lamp is in many places, by as many reflections inside: up
to twice a layer *turns* there, and takes of two ways, out and back inside, the less likely one. A
path that goes where layers are followed is *straight*. One layer is traced, and at each surface one
way taken, by the probabilities that weigh their light, so that light found by straight paths has
the mean `lamps`. So a frame has the one instead of the other, as emission, which leaves the mean
and takes its noise out.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr

from onespp.render.mitsuba.images import shape_index
from onespp.render.mitsuba.variant import mi

from .way import Way, stepped

_MOST_TURNS = 2  # of a layer
_ONWARD = 0.5  # probability of a direction, above which it is the one that is followed


@dataclass
class Aside:
    """Of a pixel's layers.

    lamps: light of all of them that lamps and the environment send at once. way, pi: the end of the
    brightest; its throughput includes the opacity of a mask that it ends at. brightness: luminance
    of that, 0 where there is no layer.
    """

    lamps: mi.Color3f
    way: Way
    pi: mi.PreliminaryIntersection3f
    brightness: mi.Float

    @staticmethod
    def none(ray: mi.Ray3f) -> Aside:
        pi = dr.zeros(mi.PreliminaryIntersection3f)
        pi.t = dr.inf
        return Aside(mi.Color3f(0), Way.of(ray), pi, mi.Float(0))

    def with_layer(self, scene: mi.Scene, way: Way, pi: mi.PreliminaryIntersection3f,
                   opacity: mi.Float, max_depth: int, active: mi.Bool,
                   bent: mi.UInt32 | None) -> Aside:
        """With another layer, where active; arguments as of `_followed`."""
        way, pi, lamps = _followed(scene, way, pi, opacity, max_depth, active, bent)
        brightness = dr.select(active, mi.luminance(way.throughput), 0)
        brighter = brightness > self.brightness
        return Aside(self.lamps + lamps, dr.select(brighter, way, self.way),
                     dr.select(brighter, pi, self.pi),
                     dr.select(brighter, brightness, self.brightness))


@dataclass
class Course:
    """Of a path: whether it has gone where layers are followed, and its turns so far; None where
    there are none."""

    is_straight: mi.Bool
    turns: mi.UInt32 | None

    @staticmethod
    def begun(bent: mi.UInt32 | None) -> Course:
        """bent: of `MitsubaScene.bent_glass`."""
        return Course(mi.Bool(True), None if bent is None else mi.UInt32(0))

    def after(self, si: mi.SurfaceInteraction3f, sample: mi.BSDFSample3f,
              opacity: mi.Float | float, bent: mi.UInt32 | None) -> Course:
        """Behind the next surface; opacity: as of `_is_onward`; bent: as for `begun`."""
        goes_on, turns = _is_onward(sample, opacity), self.turns
        if turns is not None:
            assert bent is not None
            turned = _is_turn(sample) & _may_turn(si, bent, self.is_straight)
            turns = turns + dr.select(turned, mi.UInt32(1), 0)
            goes_on |= turned & (turns <= _MOST_TURNS)
        return Course(self.is_straight & goes_on, turns)


def _is_onward(sample: mi.BSDFSample3f, opacity: mi.Float | float) -> mi.Bool:
    """Whether a sample went where a layer is followed.

    Args:
        opacity: of the mask of whose lobes it is one of the surface's own, else 1.
    """
    is_delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
    return is_delta & (sample.pdf > _ONWARD * opacity)


def _may_turn(si: mi.SurfaceInteraction3f, bent: mi.UInt32, active: mi.Bool) -> mi.Bool:
    """Whether light is inside of bent glass there, and goes out or is reflected back."""
    inside = active & (si.wi.z < 0)
    return inside & (dr.gather(mi.UInt32, bent, shape_index(si.shape, inside), inside) != 0)


def _is_turn(sample: mi.BSDFSample3f) -> mi.Bool:
    """Whether a sample, where there may be a turn, took the less likely way."""
    return mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta) & (sample.pdf < _ONWARD)


def _beyond(way: Way, si: mi.SurfaceInteraction3f, pi: mi.PreliminaryIntersection3f,
            sample: mi.BSDFSample3f, weight: mi.Color3f, active: mi.Bool) -> Way:
    """A surface further, as a sample goes; weight: that sample's, over its probability."""
    passes = ~mi.has_flag(sample.sampled_type, mi.BSDFFlags.DeltaReflection)
    return stepped(way, si, pi.t, shape_index(pi.shape, active), sample.wo,
                   dr.select(passes, sample.eta, 1), passes, weight * sample.pdf)


@dr.syntax
def _followed(scene: mi.Scene, way: Way, pi: mi.PreliminaryIntersection3f, opacity: mi.Float,
              max_depth: int, active: mi.Bool, bent: mi.UInt32 | None, turns: int = _MOST_TURNS,
              ) -> tuple[Way, mi.PreliminaryIntersection3f, mi.Color3f]:
    """The end of a layer, and the light that its surfaces emit.

    Args:
        way, pi: its first segment, and what that meets. opacity: as of `Layer`. bent: of
            `MitsubaScene.bent_glass`. turns: how many it may take.
    """
    lamps, context = mi.Color3f(0), mi.BSDFContext()
    way, pi, left = dr.copy(way), mi.PreliminaryIntersection3f(pi), mi.Float(opacity)
    active = mi.Bool(active)
    while dr.hint(active, exclude=[context, bent], max_iterations=max_depth, label="layer"):
        si = pi.compute_surface_interaction(way.ray, mi.RayFlags.All | mi.RayFlags.dNSdUV, active)
        lamps += dr.select(active, way.throughput * si.emitter(scene).eval(si, active), 0)
        active &= si.is_valid() & (way.before + 1 < max_depth)
        # The lobe in the middle is the one that more than half of the samples take, if one is.
        sample, weight = si.bsdf().sample(context, si, _ONWARD * left, mi.Point2f(0.5), active)
        active &= _is_onward(sample, left)
        if dr.hint(bent is not None and turns > 0, mode="scalar"):
            assert bent is not None
            passes = ~mi.has_flag(sample.sampled_type, mi.BSDFFlags.DeltaReflection)
            turned = _may_turn(si, bent, active)
            other, share = si.bsdf().sample(context, si, dr.select(passes, mi.Float(0), 1),
                                            mi.Point2f(0.5), turned)
            turned &= _is_turn(other) & (dr.max(share) > 0)
            there = _beyond(way, si, pi, other, share, turned)
            met = scene.ray_intersect_preliminary(there.ray, coherent=False, active=turned)
            lamps += _followed(scene, there, met, mi.Float(1), max_depth, turned, bent,
                               turns - 1)[2]
        active &= dr.max(weight) > 0
        if active:
            way = _beyond(way, si, pi, sample, weight, active)
            left = mi.Float(1)
            pi = scene.ray_intersect_preliminary(way.ray, coherent=False, active=active)
    way.throughput *= left
    return way, pi, lamps
