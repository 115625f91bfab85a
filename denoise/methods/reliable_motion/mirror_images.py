"""Where the image that a surface reflects was seen in the previous frame.

Symbols, in camera space: X a surface point, n its normal, v the unit direction to it, d the
distance from X to what its path met next; T_i previous_camera_from_camera of object i (s of the
surface, h of what was hit); ' the previous frame.

    H = X + d (v - 2 (v . n) n),  H' = T_h H,  X' = T_s X
    image  H' - 2 ((H' - X') . n') n'

The image lies behind the surface's tangent plane, and is seen through the pixel that it projects
to. There glossy light has another history, if that pixel shows the surface.

Source: Zeng et al. 2021, section 4.2. Departures: a frame tells how far its path went and what it
met, but not in which direction: the mirror direction, the middle of the lobe, stands for it. The
distance is that of the frame's own sample of the lobe, so that rough surfaces ask at places that
vary from pixel to pixel and from frame to frame, as in the paper. The plane is a mirror; a curved
surface, whose images are smaller, is taken for its tangent plane.
"""

# pyright: standard
from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.geometry.cameras import screen_from_camera
from onespp.denoise.history.reflections import seen_in
from onespp.denoise.history.reprojection import Place
from onespp.denoise.history.shadow_motion import moved
from onespp.denoise.inputs.shadow_rays import MATRIX_WORDS, shadow_table
from onespp.denoise.inputs.surface import SurfaceSample
from onespp.denoise.jit.arrays import Bool, Float, Matrix3, Vector3
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.vector import dot, opaque_matrix, transform
from onespp.render.frame import Frame

NEEDED = ("specular", "hit_distance", "hit_id")


class Reflection(NamedTuple):
    """What a frame's surfaces reflect.

    Attributes:
        distance: d, 0 for nothing. hit_id: object ID of what was hit. position: X.
        table: of `shadow_table`. objects: their number. screen_from_camera: of the frame before.
    """

    distance: Float
    hit_id: Float
    position: Vector3
    table: Float
    objects: Float
    screen_from_camera: Matrix3


def read_reflection(frame: Frame, previous: Frame, position: Vector3,
                    stencil: Stencil) -> Reflection:
    """Of the frame before, the matrices alone are read."""
    distance, hit_id = (stencil.load(np.ascontiguousarray(frame[name], np.float32))[0]
                        for name in NEEDED[1:])
    return Reflection(distance, hit_id, position, stencil.table(shadow_table(previous, frame)),
                      stencil.opaque(len(frame.world_from_object)),
                      opaque_matrix(stencil, screen_from_camera(previous)))


def image_place(stencil: Stencil, surface: SurfaceSample, reflection: Reflection,
                place: Place) -> tuple[Place, Bool]:
    """Where the image was, with the tests of `place`, and whether there was one."""
    distance, hit_id, position, table, objects, screen = reflection
    has_image = (place.inside & (hit_id >= 0) & (hit_id < objects) & (surface.id < objects)
                 & (distance > 0) & (distance < 1e15))

    def before(object_: Float, point: Vector3) -> Vector3:
        row = 2 * stencil.UInt(dr.select(has_image, object_, 0))
        return moved(stencil.unpack(table, row, MATRIX_WORDS), point)

    hit = before(hit_id, seen_in(position, surface.normal, distance))
    foot = before(stencil.Float(surface.id), position)
    normal = place.normal
    height = dot(Vector3(*[h - f for h, f in zip(hit, foot)]), normal)
    x, y, depth = transform(screen, Vector3(*[dr.fma(-2 * height, c, h)
                                              for h, c in zip(hit, normal)]))
    has_image &= (height > 0) & (depth > 0)
    shrink = 1 / dr.select(has_image, depth, 1)
    x, y = x * shrink, y * shrink
    has_image &= (x >= 0) & (x < stencil.width) & (y >= 0) & (y < stencil.height)
    return replace(place, x=dr.select(has_image, x, 0.5), y=dr.select(has_image, y, 0.5),
                   inside=has_image), has_image
