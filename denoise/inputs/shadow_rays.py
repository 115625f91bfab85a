"""A frame's shadow rays: where each went, and what stopped it."""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.geometry.cameras import camera_points, every, screen_from_camera
from onespp.denoise.geometry.motion import at_rest, inverses, world_motions
from onespp.denoise.jit.arrays import Bool, Float, Matrix3, Vector3
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.vector import dot, opaque_matrix
from onespp.render.channels import SHADOW, SUN
from onespp.render.frame import Frame

MATRIX_WORDS = 16      # floats


def has_shadow_rays(frame: Frame) -> bool:
    return all(name in frame for name in SHADOW)


def shadow_table(previous: Frame, current: Frame) -> np.ndarray:
    """(objects + 1, 2, 16) float32: T and T^-1 of each object and, last, of what stands still."""
    motions = np.concatenate([world_motions(previous, current), np.eye(4)[None]])
    t = previous.camera_from_world @ motions @ np.linalg.inv(current.camera_from_world)
    return np.stack([t, inverses(t)], 1).astype(np.float32).reshape(-1, 2, MATRIX_WORDS)


class ShadowRay(NamedTuple):
    """One ray a pixel, traced and not yet evaluated.

    Attributes:
        light: from the surface to the point of the light, world axes. light_id: its object ID, or
            less than 0.
        blocker_distance, blocker_id: of what stopped the ray.
    """

    light: Vector3
    light_id: Float
    blocker_distance: Float
    blocker_id: Float


class ShadowRays(NamedTuple):
    """What `follow_shadows` asks for.

    Attributes:
        ray: of each pixel. objects: their number.
        table: of `shadow_table`. light_sizes: of `penumbra.light_sizes`.
    """

    ray: ShadowRay
    table: Float
    light_sizes: Float
    camera_from_world: Matrix3
    screen_from_camera: Matrix3
    objects: Float


def read_shadow_rays(frame: Frame, previous: Frame, stencil: Stencil) -> ShadowRays:
    """The shadow rays of a frame; of the frame before, the matrices alone are read."""
    light, light_id, blocker_distance, blocker_id = (
        stencil.load(np.ascontiguousarray(frame[name], np.float32)) for name in SHADOW)
    return ShadowRays(ShadowRay(Vector3(*light), *light_id, *blocker_distance, *blocker_id),
                      stencil.table(shadow_table(previous, frame)),
                      stencil.table(light_sizes(frame)),
                      opaque_matrix(stencil, frame.camera_from_world[:3, :3]),
                      opaque_matrix(stencil, screen_from_camera(frame)),
                      stencil.opaque(len(frame.world_from_object)))


def stopped(rays: ShadowRays, id_: Float) -> tuple[Bool, Float]:
    """Whether an object stopped each shadow ray, and 1 over the whole ray's length."""
    (light, light_id, distance, blocker_id), objects = rays.ray, rays.objects
    length2 = dot(light, light)
    blocked = ((id_ >= 0) & (id_ < objects) & (distance > 0) & (length2 > 0) & (blocker_id >= 0)
               & (blocker_id < objects) & (light_id < objects))
    return blocked, dr.rsqrt(dr.select(blocked, length2, 1))


_LIGHT_SAMPLES = 2048   # pixels that sizes and motions of lights are estimated from
_FEWEST_POINTS = 4       # points of a light, or its size is not known
_FARTHEST = 1e15  # of a point of a light that counts


def light_sizes(frame: Frame) -> np.ndarray:
    """(objects + 2,) float32: twice the standard deviation of the points of each object that shadow
    rays asked for and, at `SUN` and -1, of the environment's sun and of the rest of it. Infinite
    for less than `_FEWEST_POINTS`."""
    objects, some = len(frame.world_from_object), every(frame, _LIGHT_SAMPLES)
    count = objects - SUN
    light, id_ = (frame[name][some, some] for name in ("light", "light_id"))
    with np.errstate(invalid="ignore", over="ignore"):
        point = camera_points(frame, some) + light @ frame.camera_from_world[:3, :3].T
        good = ((frame["id"][some, some] >= 0) & (np.abs(light).sum(-1) > 0)
                & (np.abs(point) < _FARTHEST).all(-1) & (id_ >= SUN) & (id_ < objects))
    of, point = np.where(id_ < 0, count + id_, id_)[good].astype(int), point[good]
    number = np.bincount(of, minlength=count)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(of, values, count) / np.maximum(number, 1)

    center = np.stack([mean(point[:, c]) for c in range(3)], -1)
    size = 2 * np.sqrt(mean(np.square(point - center[of]).sum(-1)))
    return np.where(number < _FEWEST_POINTS, np.inf, size).astype(np.float32)


def share_of_moving_lights(previous: Frame, frame: Frame) -> float:
    """Share of the shadow rays that went to lights that have moved."""
    some = every(frame, _LIGHT_SAMPLES)
    id_ = frame["light_id"][some, some][np.abs(frame["light"][some, some]).sum(-1) > 0]
    moved = ~at_rest(previous, frame)
    lights = id_[(id_ >= 0) & (id_ < len(moved))].astype(int)
    return float(moved[lights].sum() / max(len(id_), 1))
