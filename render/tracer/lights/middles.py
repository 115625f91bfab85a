"""The middles of strata of lights: what all pixels have in common of them, found once a frame.

A pixel that compares all strata asks every light for a point, and what lights do for that (a search
in a picture, in the faces of a mesh, in an environment map) is the same for all pixels. So each
stratum has a row of numbers, of which a pixel makes what the light itself would give, to the bit:

    area    a point of a shape, its normal, its density by area: all shapes but spheres, and all
            that shine as pictures;
    sphere  the centre and the radius: points are drawn of the part that a pixel sees;
    far     a direction, its density, radiance over it: environments, their sun, the directional.

Source: Mitsuba's `area`, `Shape::sample_direction` and `Sphere::sample_direction`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import drjit as dr
import numpy as np

from onespp.render.host.aligned import owned
from onespp.render.mitsuba.variant import mi

from .clusters import Clusters
from .strata import power_heuristic, stratum_place
from .sun import Sun

_ALIKE, _PICTURE, _SPHERE, _FAR = range(4)  # kinds; a picture's points are drawn by its light
_COLUMNS = 24
_SMALL_ANGLE = 0.00068523  # sin^2 of 1.5 degrees, as in Mitsuba


@dataclass
class Middle:
    """Of a stratum, toward a point. d: unit. pdf: over solid angle. light: radiance over that, 0
    where it sends none. square: how many times the stratum is smaller than the light. share: as of
    `Lights.share`. scale: as of `Clusters`."""

    d: mi.Vector3f
    pdf: mi.Float
    light: mi.Color3f
    delta: mi.Bool
    square: mi.Float
    share: mi.Float
    scale: mi.Float

    def weight(self, bsdf_pdf: mi.Float) -> mi.Float:
        """As of `LightPoint`."""
        return dr.select(self.delta, 1, power_heuristic(self.share * self.pdf, bsdf_pdf))


@dataclass
class Middles:
    """table: `_COLUMNS` numbers a stratum, evaluated. kinds: that there are."""

    table: mi.Float
    kinds: tuple[int, ...]

    def at(self, k: mi.UInt32, p: mi.Point3f) -> Middle:
        """Of stratum k, toward p."""
        count = _COLUMNS if _SPHERE in self.kinds else 16
        row = [x for i in range(0, count, 4)
               for x in dr.gather(mi.Vector4f, self.table, k * (_COLUMNS // 4) + i // 4)]
        place, n, q = mi.Point3f(row[:3]), mi.Vector3f(row[3:6]), row[6]
        light, kind = mi.Color3f(row[7:10]), row[10]
        d, pdf, sends = mi.Vector3f(place), q, mi.Bool(True)
        if {_ALIKE, _PICTURE} & {*self.kinds}:
            toward, density, faces = _of_area(place, n, q, kind == _PICTURE, p)
            near = kind <= _PICTURE
            d, pdf, sends = (dr.select(near, a, b) for a, b in (
                (toward, d), (density, pdf), (faces, sends)))
        if _SPHERE in self.kinds:
            toward, density, faces = _of_sphere(place, n, q, row[16:], p)
            near = kind == _SPHERE
            d, pdf, sends = (dr.select(near, a, b) for a, b in (
                (toward, d), (density, pdf), (faces, sends)))
        light = dr.select(kind == _FAR, light, dr.select(sends, light / pdf, 0))
        return Middle(d, pdf, light, row[14] != 0, row[11], row[12], row[13])


def middles_of(scene: mi.Scene, stratum: mi.UInt32, share: mi.Float,
               clusters: Clusters | None, sun: Sun | None) -> Middles | None:
    """Those of a scene as it stands, None where some light is of no kind that has a row.

    Args:
        stratum, clusters, sun: as of `Lights`. share: of each stratum, `Lights.share`.
    """
    told = [_kind(emitter) for emitter in scene.emitters()]
    if None in told or not told:
        return None
    count = dr.width(stratum)
    emitter = dr.gather(mi.EmitterPtr, scene.emitters_dr(), stratum >> 8)
    kind = dr.gather(mi.UInt32, mi.UInt32(told), stratum >> 8)
    place, side = stratum_place(stratum, mi.Point2f(0.5))
    far, is_sphere = kind == _FAR, kind == _SPHERE
    with dr.suspend_grad():
        nowhere = dr.zeros(mi.SurfaceInteraction3f, count)
        light, weight = emitter.sample_direction(nowhere, place, far)
        if sun is not None:
            light, weight = sun.told_apart(scene, nowhere, stratum, place, light, weight, far)
        point, _ = emitter.sample_position(0, place, ~far)
        seen = dr.zeros(mi.SurfaceInteraction3f, count)
        seen.p, seen.n, seen.uv, seen.wi = point.p, point.n, point.uv, mi.Vector3f(0, 0, 1)
        radiance = emitter.eval(seen, ~far)
        sine, cosine = dr.sincos(place.y * dr.two_pi)
        centre, radius, outside, sign = _spheres(scene, told, stratum >> 8)
        inward = mi.warp.square_to_uniform_sphere(place)
        columns = [
            *dr.select(far, light.d, dr.select(is_sphere, centre, point.p)),
            *dr.select(is_sphere, mi.Vector3f(place.x, sine, cosine), point.n),
            dr.select(far, light.pdf, point.pdf), *dr.select(far, weight, radiance),
            kind, dr.square(side), share,
            dr.gather(mi.Float, clusters.scale, dr.arange(mi.UInt32, count)) if clusters else 1,
            dr.select(far & light.delta, 1, 0), 0, radius, outside, sign, *inward]
        columns = [mi.Float(column) for column in columns]
        columns += [mi.Float(0)] * (_COLUMNS - len(columns))
    dr.eval(columns)
    table = np.stack([np.broadcast_to(column.numpy(), count) for column in columns], -1)
    return Middles(owned(mi.Float, table), tuple(sorted({*cast(Sequence[int], told)})))


def _kind(emitter: mi.Emitter) -> int | None:
    if mi.has_flag(emitter.flags(), mi.EmitterFlags.Infinite):
        return _FAR
    shape = emitter.get_shape()
    if emitter.class_name() != "AreaLight" or shape is None:
        return None
    if mi.has_flag(emitter.flags(), mi.EmitterFlags.SpatiallyVarying):
        return _PICTURE
    kind = shape.class_name()
    if kind == "Sphere":
        return _SPHERE
    return _ALIKE if shape.is_mesh() or kind in ("Rectangle", "Disk", "Cylinder") else None


def _spheres(scene: mi.Scene, kinds: Sequence[int | None], emitter: mi.UInt32,
             ) -> tuple[mi.Point3f, mi.Float, mi.Float, mi.Float]:
    """Centre, radius, that within which a point is inside, and the sign of normals; of strata."""
    if _SPHERE not in kinds:
        return mi.Point3f(0), mi.Float(0), mi.Float(0), mi.Float(0)
    centres, radii, outsides, signs = [], [], [], []
    for one, kind in zip(scene.emitters(), kinds):
        centre, radius, sign = mi.Point3f(0), mi.Float(0), 1.0
        if kind == _SPHERE:
            place: Any = mi.traverse(one.get_shape())["to_world"]
            centre, radius = place @ mi.Point3f(0), dr.norm(place @ mi.Vector3f(1, 0, 0))
            sign = -1.0 if one.get_shape().has_flipped_normals() else 1.0
        centres.append(centre)
        radii.append(radius)
        outsides.append(radius * (1 - sign * mi.math.RayEpsilon))
        signs.append(mi.Float(sign))
    x, y, z = ([centre[i] for centre in centres] for i in range(3))
    columns = [dr.gather(mi.Float, dr.concat(values), emitter)
               for values in (x, y, z, radii, outsides, signs)]
    return mi.Point3f(columns[:3]), columns[3], columns[4], columns[5]


def _of_area(place: mi.Point3f, n: mi.Vector3f, density: mi.Float, is_picture: mi.Bool,
             p: mi.Point3f) -> tuple[mi.Vector3f, mi.Float, mi.Bool]:
    """Direction, its density, and whether anything is sent there."""
    d = place - p
    squared = dr.squared_norm(d)
    d = d / dr.sqrt(squared)
    cosine = dr.dot(d, n)
    stretched = squared / dr.abs(cosine)
    alike = density * dr.select(dr.isfinite(stretched), stretched, 0)
    picture = dr.select(cosine < 0, density * squared / -cosine, 0)
    return (d, dr.select(is_picture, picture, alike),
            (cosine < 0) & (is_picture | (alike != 0)))


def _of_sphere(centre: mi.Point3f, place: mi.Vector3f, one_over_area: mi.Float,
               row: Sequence[mi.Float], p: mi.Point3f,
               ) -> tuple[mi.Vector3f, mi.Float, mi.Bool]:
    """The same; place: on the sample square, x, sine and cosine of the angle that y tells."""
    radius, outside, sign, inward = row[0], row[1], row[2], mi.Vector3f(row[3:6])
    x, sine, cosine = place
    toward = centre - p
    squared = dr.squared_norm(toward)
    one_over = dr.rsqrt(squared)
    widest = radius * one_over  # sine of half the angle that the sphere fills
    widest2, one_over_widest = dr.square(widest), dr.rcp(widest)
    cosine_widest = dr.safe_sqrt(1 - widest2)
    sine2 = dr.select(widest2 > _SMALL_ANGLE, 1 - dr.square(dr.fma(cosine_widest - 1, x, 1)),
                      widest2 * x)
    cosine_alpha = sine2 * one_over_widest + dr.safe_sqrt(1 - sine2) * dr.safe_sqrt(
        dr.fma(-sine2, dr.square(one_over_widest), 1))
    sine_alpha = dr.safe_sqrt(dr.fma(-cosine_alpha, cosine_alpha, 1))
    n = mi.Frame3f(toward * -one_over).to_world(mi.Vector3f(
        cosine * sine_alpha, sine * sine_alpha, cosine_alpha))
    is_outside = squared > dr.square(outside)
    n = dr.select(is_outside, n, inward)
    d = dr.fma(n, radius, centre) - p
    squared = dr.squared_norm(d)
    length = dr.sqrt(squared)
    d = d / length
    seen = dr.select(length == 0, 0, dr.inv_two_pi / (1 - cosine_widest))
    pdf = dr.select(is_outside, seen, one_over_area * squared / dr.abs(dr.dot(d, n)))
    return d, pdf, (dr.dot(d, n * sign) < 0) & (pdf != 0)
