"""Primary surface replacement: the first surface that scatters light, behind mirrors and glass.

What a mirror shows is as good to filter as what the camera sees itself, if a frame tells of it what
it tells of that. So the camera's ray is followed through mirrors, clear glass and the holes of
masks, and the surface that it comes to is the pixel's: radiance is split there, and the G-buffer is
that of its image. Where a surface both reflects and lets through, the ray follows what is more of
it; the rest, a layer of its own, is a path of its own, whose light counts as specular, and of which
`layers.py` tells more. Images are where `way.py` puts them.

A mask of opacity o lets 1 - o through. Below 1/2 the ray goes on; the surface, with o, is the other
layer. From there on it is the pixel's surface, and what is behind it is the other.

The mean of a frame is what it was: what is followed is not random, and of the layers left aside one
is picked in proportion to its luminance.

Source: Zimmer et al. 2015, "Path-space motion estimation and decomposition for robust animation
filtering", section 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from onespp.render.mitsuba.images import shape_index
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi

from .layers import Aside
from .lights.reservoir import offered
from .sampler import Sampler
from .way import Way, combined, stepped

_THROUGH = +mi.BSDFFlags.DeltaTransmission | +mi.BSDFFlags.Null


@dataclass
class Layer:
    """A ray that leaves a pixel's chain of surfaces, and what of its light the pixel shows.

    o, d: origin and direction. throughput: 0 where there is none, over the probability of its
    having been picked. before: segments before it. opacity: of the mask that it meets first, 1
    where that is to be met by chance as others are; None if there are no masks.
    """

    o: mi.Point3f
    d: mi.Vector3f
    throughput: mi.Color3f
    before: mi.UInt32
    opacity: mi.Float | None

    @property
    def ray(self) -> mi.Ray3f:
        return mi.Ray3f(self.o, self.d)


@dataclass
class Replaced:
    """Where a camera ray came to.

    ray, pi: the last segment, and its hit. throughput: of the surfaces before. before: segments
    before the last. length: of the image from the camera, in stage units. columns: of H. images:
    the shape that it is an image in, its index in the JIT registry, 0 for none; several: whether
    there is another. opacity: of a mask that the surface is cut out by, else 1; None if there are
    no masks. other: what else is seen there, if anything in the scene is clear. aside: what of all
    that has no noise.
    """

    ray: mi.Ray3f
    pi: mi.PreliminaryIntersection3f
    throughput: mi.Color3f
    before: mi.UInt32
    length: mi.Float
    columns: tuple[mi.Vector3f, mi.Vector3f, mi.Vector3f]
    images: mi.UInt32
    several: mi.Bool
    opacity: mi.Float | None
    other: Layer | None = None
    aside: Aside | None = None

    def unfolded(self, v: mi.Vector3f) -> mi.Vector3f:
        """H v: a direction at the surface, as the image has it."""
        return combined(*self.columns, v)

    def row(self, stage: MitsubaScene) -> mi.UInt32:
        """Of `Images`: which images it is among."""
        return stage.row_of_images(self.images, self.several)

    @property
    def layer(self) -> Replaced:
        """Where the brightest of `aside` came to."""
        assert self.aside is not None
        return _came_to(self.aside.way, self.aside.pi)

    @property
    def layer_share(self) -> mi.Float:
        """Of that one's luminance of the throughput in its own and the surface's."""
        assert self.aside is not None
        own = mi.luminance(self.throughput)
        if self.opacity is not None:
            own *= self.opacity
        both = own + self.aside.brightness
        return dr.select(self.aside.brightness > 0, self.aside.brightness / both, 0)


@dr.syntax
def replaced(stage: MitsubaScene, ray: mi.Ray3f, pi: mi.PreliminaryIntersection3f,
             sampler: Sampler) -> Replaced:
    """The surfaces behind mirrors and glass, of rays and their first hits.

    Args:
        stage: has images. sampler: advanced if they are layered.
    """
    scene, max_depth = stage.mi_scene, stage.description.max_depth
    rows, masks, layered = stage.image_rows, stage.masks, stage.images.layered
    bent = stage.bent_glass
    reflect, through = mi.BSDFContext(), mi.BSDFContext()
    reflect.type_mask, through.type_mask = mi.BSDFFlags.DeltaReflection, _THROUGH
    way, pi = Way.of(ray), mi.PreliminaryIntersection3f(pi)
    opacity = None if masks is None else mi.Float(1)
    absent: Any = None  # no state of the loop where nothing is layered
    other, aside, total, picked, left = (absent,) * 5
    if dr.hint(layered, mode="scalar"):
        other = Layer(mi.Point3f(ray.o), mi.Vector3f(ray.d), mi.Color3f(0), mi.UInt32(0), opacity)
        aside, left = Aside.none(ray), sampler.next_1d()
        total, picked = mi.Float(0), mi.Float(1)
    active = pi.is_valid() & (max_depth > 1)

    while dr.hint(active, exclude=[stage, rows, masks, bent, reflect, through],
                  max_iterations=max_depth, label="images"):
        si = pi.compute_surface_interaction(way.ray, mi.RayFlags.All | mi.RayFlags.dNSdUV, active)
        bsdf = si.bsdf()
        shape = shape_index(pi.shape, active)
        is_clear = active & (dr.gather(mi.UInt32, rows, shape, active) != 0)
        sample, weight = bsdf.sample(reflect, si, 0.5, mi.Point2f(0.5), is_clear)
        wo, eta, passes = mi.Vector3f(sample.wo), mi.Float(1), mi.Bool(False)
        if dr.hint(layered, mode="scalar"):
            is_mask, o = mi.Bool(False), mi.Float(1)
            if dr.hint(masks is not None, mode="scalar"):
                is_mask = active & (dr.gather(mi.UInt32, masks, shape, active) != 0)
                is_clear &= ~is_mask
                o = dr.select(is_mask, 1 - dr.mean(bsdf.eval_null_transmission(si, is_mask)), 1)
                opacity = dr.select(is_mask & (o >= 0.5), o, opacity)
            is_hole = is_mask & (o < 0.5)
            beyond, share = bsdf.sample(through, si, 0.5, mi.Point2f(0.5), is_clear)
            passes = is_hole | (dr.max(share) > dr.max(weight))
            left_aside = dr.select(is_mask, dr.select(is_hole, 1, 1 - o),
                                   dr.select(passes, weight, share))
            rest = way.throughput * left_aside
            wo_aside = dr.select(is_mask, -si.wi, dr.select(passes, sample.wo, beyond.wo))
            ray_aside = si.spawn_ray(si.to_world(wo_aside))
            brightness = dr.select(is_clear | is_mask, mi.luminance(rest), 0)
            brightness *= dr.select(is_hole, o, 1)
            total += brightness
            taken, left = offered(left, brightness, total)
            other.o = dr.select(taken, dr.select(is_hole, way.o, ray_aside.o), other.o)
            other.d = dr.select(taken, dr.select(is_hole, way.d, ray_aside.d), other.d)
            other.throughput = dr.select(taken, rest, other.throughput)
            other.before = dr.select(
                taken, dr.select(is_hole, way.before, way.before + 1), other.before)
            if dr.hint(masks is not None, mode="scalar"):
                other.opacity = dr.select(taken, dr.select(is_hole, o, 1), other.opacity)
            picked = dr.select(taken, brightness, picked)
            is_one = brightness > 0
            goes_in = is_mask | ~passes
            there = dr.select(is_hole, way, stepped(
                way, si, pi.t, shape, wo_aside, dr.select(is_mask | passes, 1, beyond.eta),
                goes_in, left_aside))
            met = scene.ray_intersect_preliminary(there.ray, coherent=False,
                                                  active=is_one & ~is_hole)
            aside = aside.with_layer(scene, there, dr.select(is_hole, pi, met),
                                     dr.select(is_hole, o, 1), max_depth, is_one, bent)
            wo = dr.select(is_hole, -si.wi, dr.select(passes, beyond.wo, wo))
            weight = dr.select(is_hole, 1 - o, dr.select(passes, share, weight))
            eta = dr.select(passes & ~is_hole, beyond.eta, 1)
            is_clear |= is_hole
        active &= is_clear & (dr.max(weight) > 0)

        if active:
            way = stepped(way, si, pi.t, shape, wo, eta, passes, weight)
            pi = scene.ray_intersect_preliminary(way.ray, coherent=False, active=active)
            active &= pi.is_valid() & (way.before + 1 < max_depth)

    if dr.hint(layered, mode="scalar"):
        other.throughput *= dr.select(total > 0, total / picked, 0)
    return _came_to(way, pi, opacity, other, aside)


def _came_to(way: Way, pi: mi.PreliminaryIntersection3f, opacity: mi.Float | None = None,
             other: Layer | None = None, aside: Aside | None = None) -> Replaced:
    return Replaced(way.ray, pi, way.throughput, way.before, way.length(pi.t), way.columns,
                    way.images, way.several, opacity, other, aside)
