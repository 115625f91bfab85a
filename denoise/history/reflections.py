"""How far a history of glossy light can be trusted: by how far the mirror direction has turned.

A surface's history is of the light that it sent to where the camera was. What a glossy lobe
reflects comes from around the mirror direction r, and is another where r has turned by more than
the lobe is wide: in a mirror at once, on a rough surface hardly ever. With ' the previous frame, v
the unit direction from the camera to the surface and n its normal, both in world axes,

    r = v - 2 (v . n) n,   t = min(|r - r'| / (2 alpha + LEAST_WIDTH), 1),

alpha being the roughness (of GGX; its lobe is about twice as wide in r as in normals). t is the
least weight of the current frame: after f frames of equal motion, history has turned by some f
times that, so t ~ 1 / f keeps it within the lobe. Where all stands still, mirrors have a history.

What is reflected may move itself: with d how far a path went along r, H = X + d r, and H' where
that point of what it hit was,

    u = min(|H - H'| / (d (2 alpha + LEAST_WIDTH)), 1),

0 where a path met nothing, or what stands still. Its mean over some pixels around, and over those
that history is from (what has moved out of a reflection leaves a history of it), counts fourfold,
up to 1: a quarter of the paths is enough.

Our own; NRD and Zeng et al. 2021 follow the virtual image instead, which a curved mirror does not
have.
"""

# pyright: standard
from __future__ import annotations

from typing import NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.geometry.cameras import camera_from_screen
from onespp.denoise.inputs.path_hits import Hits
from onespp.denoise.inputs.shadow_rays import MATRIX_WORDS
from onespp.denoise.jit.arrays import Float, Matrix3, Vector3
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.vector import dot, opaque_matrix, transform
from onespp.render.frame import Frame

from .reprojection import Place
from .shadow_motion import moved

LEAST_WIDTH = 0.005  # radians, of a mirror's lobe: a pixel or two
_WIDTH = 2.0  # of a lobe, over its roughness
_ENOUGH = 4.0  # times the mean of u


class Lobes(NamedTuple):
    """What reflects, and the views of two frames.

    Attributes:
        roughness: alpha. position: X, in camera space.
        camera_from_screen: of the previous frame. turn: from its camera's axes to those of the
            current one.
    """

    roughness: Float
    position: Vector3
    camera_from_screen: Matrix3
    turn: Matrix3


def lobes_between(previous: Frame, current: Frame, roughness: Float, position: Vector3,
                  stencil: Stencil) -> Lobes:
    """What `turned` asks for."""
    rotation, before = (np.asarray(frame.camera_from_world)[:3, :3]
                        for frame in (current, previous))
    return Lobes(roughness, position, opaque_matrix(stencil, camera_from_screen(previous)),
                 opaque_matrix(stencil, rotation @ np.linalg.inv(before)))


def turned(lobes: Lobes, normal: Vector3, place: Place) -> Float:
    """t, where there is a history.

    Args:
        normal: n, in camera space. place: of `locate`.
    """
    ray = transform(lobes.camera_from_screen,
                    Vector3(place.x, place.y, type(place.x)(1)))
    before = transform(lobes.turn, _mirrored(ray, place.normal))
    d = Vector3(*[a - b for a, b in zip(_mirrored(lobes.position, normal), before)])
    return dr.minimum(dr.sqrt(dot(d, d)) / _width(lobes.roughness), 1)


def image_motion(stencil: Stencil, hits: Hits, roughness: Float, normal: Vector3,
                 position: Vector3) -> Float:
    """u of each pixel, 0 where there is no lobe (roughness 1); position: X."""
    d = hits.distance
    met = (d > 0) & (hits.id >= 0) & (hits.id < hits.objects) & (roughness < 1)
    row = stencil.UInt(dr.select(met, hits.id, 0))
    shift = moved(stencil.unpack(hits.shifts, row, MATRIX_WORDS),
                  seen_in(position, normal, d))
    far = d * _width(roughness)
    length = dr.sqrt(dot(shift, shift))
    return dr.select(met, dr.select(length < far, length / dr.select(met, far, 1), 1), 0)


def image_turned(stencil: Stencil, around: Float, before: Float, place: Place) -> Float:
    """How much more of a reflection has moved than is still right, from 0 to 1.

    Args:
        around: `image_motion`, smoothed. before: the same of the previous frame, in its pixels.
    """
    lane = stencil.UInt(place.y) * stencil.stride + stencil.UInt(place.x)
    left = dr.gather(stencil.Float, before, dr.select(place.inside, lane, 0), place.inside)
    return dr.minimum(_ENOUGH * dr.maximum(around, left), 1)


def seen_in(position: Vector3, normal: Vector3, distance: Float) -> Vector3:
    """X + d r, what a mirror at X shows, so far from it; camera space."""
    return Vector3(*[dr.fma(distance, r, x)
                     for r, x in zip(_mirrored(position, normal), position)])


def _width(roughness: Float) -> Float:
    """Radians of a lobe."""
    return dr.fma(roughness, _WIDTH, LEAST_WIDTH)


def _mirrored(view: Vector3, normal: Vector3) -> Vector3:
    """r, of a direction of any length."""
    scale = dr.rsqrt(dr.maximum(dot(view, view), 1e-30))
    v = Vector3(*[c * scale for c in view])
    twice = 2 * dot(v, normal)
    return Vector3(*[c - twice * n for c, n in zip(v, normal)])
