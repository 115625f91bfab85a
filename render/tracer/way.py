"""A ray's way through mirrors and glass, and what is seen at its end.

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

Source: Zimmer et al. 2015, "Path-space motion estimation and decomposition for robust animation
filtering", section 4; lengths by the paraxial equations of a spherical mirror and of a refracting
sphere (Hecht, "Optics", chapter 5).
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr

from onespp.render.mitsuba.variant import mi

_FARTHEST = 1e7  # times the length along the ray, of images
_BENDS = 1e-5  # curvature times length, below which a pane leaves things where they are


@dataclass
class Way:
    """Where a camera ray is on its way.

    o, d: origin and direction of the last segment. throughput: of the surfaces before. before:
    segments before the last. along: their length. lens: a, b, c, e, of s -> (a s + b) / (c s + e),
    the length of the image of what is s behind the last surface. columns: of H. images: the shape
    that its end is an image in, its index in the JIT registry, 0 for none; several: whether there
    is another.
    """

    o: mi.Point3f
    d: mi.Vector3f
    throughput: mi.Color3f
    before: mi.UInt32
    along: mi.Float
    lens: tuple[mi.Float, mi.Float, mi.Float, mi.Float]
    columns: tuple[mi.Vector3f, mi.Vector3f, mi.Vector3f]
    images: mi.UInt32
    several: mi.Bool

    @staticmethod
    def of(ray: mi.Ray3f) -> Way:
        """Of a camera ray."""
        return Way(mi.Point3f(ray.o), mi.Vector3f(ray.d), mi.Color3f(1), mi.UInt32(0), mi.Float(0),
                   (mi.Float(1), mi.Float(0), mi.Float(0), mi.Float(1)),
                   (mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0), mi.Vector3f(0, 0, 1)),
                   mi.UInt32(0), mi.Bool(False))

    @property
    def ray(self) -> mi.Ray3f:
        """The last segment."""
        return mi.Ray3f(self.o, self.d)

    def length(self, t: mi.Float) -> mi.Float:
        """Of the image, from the camera, of what the last segment meets after t."""
        a, b, c, e = self.lens
        plain = self.along + t
        length = dr.fma(a, t, b) / dr.fma(c, t, e)
        return dr.select((length > 0) & (length < _FARTHEST * plain), length, plain)


@dr.syntax
def stepped(way: Way, si: mi.SurfaceInteraction3f, t: mi.Float, shape: mi.UInt32, wo: mi.Vector3f,
            eta: mi.Float, passes: mi.Bool, weight: mi.Color3f) -> Way:
    """One surface further.

    Args:
        si, t, shape: what the last segment meets, after which length, and its registry index.
        wo: the direction onward, in the frame of `si`. eta: of the surface, 1 where it reflects.
        passes: whether it goes through. weight: what the surface leaves of light.
    """
    ray, (x, y, z), (a, b, c, e) = way.ray, way.columns, way.lens
    onward = si.to_world(wo)
    leaving = si.spawn_ray(onward)  # a little off the surface, which a mirror reverses
    there = dr.dot(leaving.o - ray.o, ray.d)
    t = dr.select(passes, there, 2 * t - there)
    k = _curvature(si)
    p, q = dr.select(passes, eta, 1), dr.select(passes, (1 - eta) * k, 2 * k)
    a, b, c, e = (dr.fma(a, dr.fma(t, q, 1), b * q), p * dr.fma(a, t, b),
                  dr.fma(c, dr.fma(t, q, 1), e * q), p * dr.fma(c, t, e))
    # Columns of H: turned by what takes the direction onward to the one before.
    n = dr.normalize(onward - ray.d)
    folded = combined(x, y, z, n)
    if ~passes:
        x, y, z = x - 2 * n.x * folded, y - 2 * n.y * folded, z - 2 * n.z * folded
    else:
        x, y, z = _turned(x, y, z, onward, ray.d)
    is_image = ~passes | ((eta != 1) & (dr.abs(k) * t > _BENDS))
    several = way.several | (is_image & (way.images != 0) & (way.images != shape))
    images = dr.select(is_image & (way.images == 0), shape, way.images)
    return Way(leaving.o, leaving.d, way.throughput * weight, way.before + 1, way.along + t,
               (a, b, c, e), (x, y, z), images, several)


def combined(x: mi.Vector3f, y: mi.Vector3f, z: mi.Vector3f, v: mi.Vector3f) -> mi.Vector3f:
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
    return (combined(x, y, z, row_x), combined(x, y, z, row_y), combined(x, y, z, row_z))


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
