"""Primary surface replacement: the first surface that scatters light, behind mirrors and glass.

What a mirror shows is as good to filter as what the camera sees itself, if a frame tells of it what
it tells of that. So the camera's ray is followed through mirrors, clear glass and the holes of
masks, and the surface that it comes to is the pixel's: radiance is split there, and the G-buffer is
that of its image. Where a surface both reflects and lets through, the ray follows what is more of
it; the rest, a layer of its own, is a path of its own, whose light counts as specular.

Symbols: t_i, the length of segment i; n_i, the shading normal at its end, toward the ray; k_i, the
mean curvature there, positive if the surface bulges toward the ray; eta_i, the index of refraction
behind the surface over that before it; d, the ray's direction from the camera.

    throughput  product of reflectances and transmittances; it is in all light, and in the albedo,
                so that light over albedo is the irradiance of the surface.
    unfolding   H, directions at the surface -> those of its image: the product of 1 - 2 n_i n_i^T
                where it was reflected, and of the shortest turn back where it was refracted.
    length      of the image from the camera. What is s behind a surface is seen at

                    s / (1 + 2 k_i s)               in a mirror,
                    s / (eta_i - (eta_i - 1) k_i s)   through glass,

                and s -> t_i + that, from the last surface to the first: flat mirrors add up
                lengths. An image behind the camera counts as if all were flat and nothing bent.
    place       camera + length d: it projects to its pixel, as a surface does.

A bent surface's image is only nearly at rest when the camera moves (that depends on the angle, and
differs along and across), which is what methods have to bear with.

A mask of opacity o lets 1 - o through. Below 1/2 the ray goes on; the surface, with o, is the other
layer. From there on it is the pixel's surface, and what is behind it is the other.

The mean of a frame is what it was: what is followed is not random, and of the layers left aside one
is picked in proportion to its luminance.

Source: Zimmer et al. 2015, "Path-space motion estimation and decomposition for robust animation
filtering", section 4; lengths by the paraxial equations of a spherical mirror and of a refracting
sphere (Hecht, "Optics", chapter 5).
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr

from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi

from .lights.resampling import shape_index
from .lights.reservoir import offered
from .sampler import Sampler

_THROUGH = +mi.BSDFFlags.DeltaTransmission | +mi.BSDFFlags.Null
_FARTHEST = 1e7  # times the length along the ray, of images
_BENDS = 1e-5  # curvature times length, below which a pane leaves things where they are


@dataclass
class Layer:
    """A ray that leaves a pixel's chain of surfaces, and what of its light the pixel shows.

    throughput: 0 where there is none, over the probability of its having been picked. before:
    segments before it. opacity: of the mask that it meets first, 1 where that is to be met by
    chance as others are; None if there are no masks.
    """

    ray: mi.Ray3f
    throughput: mi.Color3f
    before: mi.UInt32
    opacity: mi.Float | None


@dataclass
class Replaced:
    """Where a camera ray came to.

    ray, pi: the last segment, and its hit. throughput: of the surfaces before. before: segments
    before the last. length: of the image from the camera, in stage units. columns: of H. images:
    the shape that it is an image in, its index in the JIT registry, 0 for none; several: whether
    there is another. opacity: of a mask that the surface is cut out by, else 1; None if there are
    no masks. other: what else is seen there, if anything in the scene is clear.
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
    other: Layer | None

    def unfolded(self, v: mi.Vector3f) -> mi.Vector3f:
        """H v: a direction at the surface, as the image has it."""
        return _combined(*self.columns, v)

    def row(self, stage: MitsubaScene) -> mi.UInt32:
        """Of `Images`: which images it is among."""
        return stage.row_of_images(self.images, self.several)


@dr.syntax
def replaced(stage: MitsubaScene, ray: mi.Ray3f, pi: mi.PreliminaryIntersection3f,
             sampler: Sampler) -> Replaced:
    """The surfaces behind mirrors and glass, of rays and their first hits.

    Args:
        stage: has images. sampler: advanced if they are layered.
    """
    scene, max_depth = stage.mi_scene, stage.description.max_depth
    rows, masks, layered = stage.image_rows, stage.masks, stage.images.layered
    reflect, through = mi.BSDFContext(), mi.BSDFContext()
    reflect.type_mask, through.type_mask = mi.BSDFFlags.DeltaReflection, _THROUGH
    ray, pi = mi.Ray3f(ray), mi.PreliminaryIntersection3f(pi)
    throughput, before = mi.Color3f(1), mi.UInt32(0)
    images, several = mi.UInt32(0), mi.Bool(False)
    x, y, z = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0), mi.Vector3f(0, 0, 1)
    a, b, c, e = mi.Float(1), mi.Float(0), mi.Float(0), mi.Float(1)  # s -> (a s + b) / (c s + e)
    along = mi.Float(0)
    opacity = None if masks is None else mi.Float(1)
    other = Layer(mi.Ray3f(ray), mi.Color3f(0), mi.UInt32(0), opacity)
    total, picked = mi.Float(0), mi.Float(1)
    left = mi.Float(0)
    if dr.hint(layered, mode="scalar"):
        left = sampler.next_1d()
    active = pi.is_valid() & (max_depth > 1)

    while dr.hint(active, max_iterations=max_depth, label="images"):
        si = pi.compute_surface_interaction(ray, mi.RayFlags.All | mi.RayFlags.dNSdUV, active)
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
            rest = throughput * dr.select(is_mask, dr.select(is_hole, 1, 1 - o),
                                          dr.select(passes, weight, share))
            aside = si.spawn_ray(si.to_world(dr.select(
                is_mask, -si.wi, dr.select(passes, sample.wo, beyond.wo))))
            aside = dr.select(is_hole, ray, aside)
            brightness = dr.select(is_clear | is_mask, mi.luminance(rest), 0)
            brightness *= dr.select(is_hole, o, 1)
            total += brightness
            taken, left = offered(left, brightness, total)
            other.ray = dr.select(taken, aside, other.ray)
            other.throughput = dr.select(taken, rest, other.throughput)
            other.before = dr.select(taken, dr.select(is_hole, before, before + 1), other.before)
            if dr.hint(masks is not None, mode="scalar"):
                other.opacity = dr.select(taken, dr.select(is_hole, o, 1), other.opacity)
            picked = dr.select(taken, brightness, picked)
            wo = dr.select(is_hole, -si.wi, dr.select(passes, beyond.wo, wo))
            weight = dr.select(is_hole, 1 - o, dr.select(passes, share, weight))
            eta = dr.select(passes & ~is_hole, beyond.eta, 1)
            is_clear |= is_hole
        active &= is_clear & (dr.max(weight) > 0)

        if active:
            throughput *= weight
            onward = si.to_world(wo)
            leaving = si.spawn_ray(onward)  # a little off the surface, which a mirror reverses
            t = dr.dot(leaving.o - ray.o, ray.d)
            t = dr.select(passes, t, 2 * pi.t - t)
            k = _curvature(si)
            p, q = dr.select(passes, eta, 1), dr.select(passes, (1 - eta) * k, 2 * k)
            a, b, c, e = (dr.fma(a, dr.fma(t, q, 1), b * q), p * dr.fma(a, t, b),
                          dr.fma(c, dr.fma(t, q, 1), e * q), p * dr.fma(c, t, e))
            along += t
            # Columns of H: turned by what takes the direction onward to the one before.
            n = dr.normalize(onward - ray.d)
            folded = _combined(x, y, z, n)
            if ~passes:
                x, y, z = x - 2 * n.x * folded, y - 2 * n.y * folded, z - 2 * n.z * folded
            else:
                x, y, z = _turned(x, y, z, onward, ray.d)
            is_image = ~passes | ((eta != 1) & (dr.abs(k) * t > _BENDS))
            several |= is_image & (images != 0) & (images != shape)
            images = dr.select(is_image & (images == 0), shape, images)
            before += 1
            ray = leaving
            pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active)
            active &= pi.is_valid() & (before + 1 < max_depth)

    plain = along + pi.t
    length = dr.fma(a, pi.t, b) / dr.fma(c, pi.t, e)
    length = dr.select((length > 0) & (length < _FARTHEST * plain), length, plain)
    other.throughput *= dr.select(total > 0, total / picked, 0)
    return Replaced(ray, pi, throughput, before, length, (x, y, z), images, several, opacity,
                    other if layered else None)


def _combined(x: mi.Vector3f, y: mi.Vector3f, z: mi.Vector3f, v: mi.Vector3f) -> mi.Vector3f:
    return dr.fma(x, v.x, dr.fma(y, v.y, z * v.z))


def _turned(x: mi.Vector3f, y: mi.Vector3f, z: mi.Vector3f, a: mi.Vector3f,
            b: mi.Vector3f) -> tuple[mi.Vector3f, mi.Vector3f, mi.Vector3f]:
    """Columns of H times the shortest rotation that takes a to b (unit, less than 180 degrees).

    Source: Moller and Hughes 1999, "Efficiently building a matrix to rotate one vector to another".
    """
    v, cosine = dr.cross(a, b), dr.dot(a, b)
    h = dr.rcp(1 + cosine)
    row_x = mi.Vector3f(dr.fma(h * v.x, v.x, cosine), dr.fma(h * v.x, v.y, v.z),
                        dr.fma(h * v.x, v.z, -v.y))
    row_y = mi.Vector3f(dr.fma(h * v.x, v.y, -v.z), dr.fma(h * v.y, v.y, cosine),
                        dr.fma(h * v.y, v.z, v.x))
    row_z = mi.Vector3f(dr.fma(h * v.x, v.z, v.y), dr.fma(h * v.y, v.z, -v.x),
                        dr.fma(h * v.z, v.z, cosine))
    # (row_i is the rotation's i-th column.)
    return (_combined(x, y, z, row_x), _combined(x, y, z, row_y), _combined(x, y, z, row_z))


def _curvature(si: mi.SurfaceInteraction3f) -> mi.Float:
    """Mean curvature of the shading normals, positive where it bulges toward `si.wi`.

    Source: do Carmo 1976, "Differential geometry of curves and surfaces", section 3.3.
    """
    u, v = si.dp_du, si.dp_dv
    e, f, g = dr.dot(u, u), dr.dot(u, v), dr.dot(v, v)
    twice = (g * dr.dot(si.dn_du, u) - f * (dr.dot(si.dn_du, v) + dr.dot(si.dn_dv, u))
             + e * dr.dot(si.dn_dv, v)) / (e * g - f * f)
    h = 0.5 * dr.select(dr.isfinite(twice), twice, 0)
    return dr.select(dr.dot(si.sh_frame.n, si.to_world(si.wi)) < 0, -h, h)
