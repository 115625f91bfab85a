"""How wide the soft edge of a shadow is: how far visibility may be filtered.

Past an edge that is d away from a surface, a light of size s, D away, throws a penumbra of width

    w = s d / ((D - d) cos),

cos being of the angle at which the light meets the surface: where it grazes, a penumbra is long. On
the screen that is w f / z pixels, f being the pixels of a unit length at depth 1. Each shadow ray
that was stopped tells d and D; s is how far the points lie apart that the frame's shadow rays asked
a light for. A level of `innovation.py` weighs a tap of visibility, r pixels away, also by

    exp(-r^2 q / (2 p^2)),

p a parameter and q the mean of 1 / (w^2 + 1) over the rays around that were stopped. Contact
shadows stay sharp, whatever the noise; where nothing is in the light's way, q is 0.

Source: Mehta et al. 2012, "Axis-Aligned Filtering for Interactive Sampled Soft Shadows", which
takes the extremes of d around a pixel, not a mean, and filters by this width alone.
"""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.geometry.cameras import camera_from_screen
from onespp.denoise.jit.arrays import Bool, Float
from onespp.denoise.jit.grid import Stencil
from onespp.render.frame import Frame

_SAMPLES = 2048   # pixels that sizes of lights are estimated from
_FEWEST = 4       # points of a light, or its size is not known
_FARTHEST = 1e15  # of a point of a light that counts


def light_sizes(frame: Frame) -> np.ndarray:
    """(objects + 1,) float32: twice the standard deviation of the points of each object that shadow
    rays asked for and, last, of the environment's points. Infinite for less than `_FEWEST`."""
    count = len(frame.world_from_object) + 1
    step = max(1, round((frame.height * frame.width / _SAMPLES) ** 0.5))
    some = slice(step // 2, None, step)
    depth, light, id_ = (frame[name][some, some] for name in ("depth", "light", "light_id"))
    b = camera_from_screen(frame)
    y, x = (np.arange(some.start, size, step)[:, None] + 0.5 for size in frame["id"].shape)
    ray = (y * b[:, 1])[:, None] + x * b[:, 0] + b[:, 2]
    with np.errstate(invalid="ignore", over="ignore"):
        point = depth[..., None] * ray + light @ frame.camera_from_world[:3, :3].T
        good = ((frame["id"][some, some] >= 0) & (np.abs(light).sum(-1) > 0)
                & (np.abs(point) < _FARTHEST).all(-1) & (id_ < count - 1))
    of, point = np.where(id_ < 0, count - 1, id_)[good].astype(int), point[good]
    number = np.bincount(of, minlength=count)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(of, values, count) / np.maximum(number, 1)

    center = np.stack([mean(point[:, c]) for c in range(3)], -1)
    size = 2 * np.sqrt(mean(np.square(point - center[of]).sum(-1)))
    return np.where(number < _FEWEST, np.inf, size).astype(np.float32)


class PenumbraSample(NamedTuple):
    """Whether a pixel's shadow ray was stopped, 1 or 0, and q where it was; or means of these."""

    blocked: Float
    inverse_width: Float


def penumbra_samples(stencil: Stencil, blocked: Bool, share: Float, cosine: Float, light_id: Float,
                     depth: Float, focal: Float, sizes: Float) -> PenumbraSample:
    """How sharp each pixel's shadow is.

    Args:
        blocked: of `shadow_motion.stopped`. share: d / D. cosine: between the ray and the normal.
        light_id: what the ray was sent to. focal: f. sizes: of `light_sizes`.
    """
    environment = float(dr.width(sizes) - 1)
    size = dr.gather(stencil.Float, sizes, stencil.UInt(
        dr.select(blocked, dr.select(light_id >= 0, light_id, environment), 0)))
    left = dr.square((1 - share) * cosine)
    q = left / dr.maximum(dr.square(size * share * focal / depth) + left, 1e-20)
    return PenumbraSample(dr.select(blocked, stencil.Float(1), 0),
                          dr.select(blocked & (q > 0), q, 0))


def footprint_falloff(around: PenumbraSample, scale: Float, min_share: float) -> Float:
    """log2(e) q / (2 p^2) of each pixel: what a tap's squared distance takes off the log2 of its
    weight.

    Args:
        around: `penumbra_samples`, smoothed. scale: log2(e) / (2 p^2).
        min_share: of the rays around; where fewer were stopped, nothing is in the light's way.
    """
    shadowed = around.blocked > min_share
    return dr.select(shadowed,
                     scale * around.inverse_width / dr.select(shadowed, around.blocked, 1), 0)
