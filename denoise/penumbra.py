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

from collections.abc import Sequence

import drjit as dr
import numpy as np

from render.frame import Frame

from .stencil import Float, Stencil
from .view import camera_from_screen

_SAMPLES = 2048   # pixels that sizes of lights are estimated from
_FEWEST = 4       # points of a light, or its size is not known
_FARTHEST = 1e15  # of a point of a light that counts


def light_sizes(frame: Frame) -> np.ndarray:
    """(objects + 1,) float32: twice the deviation of the points of each object that shadow rays
    asked for and, last, of the points of nobody's lights. Infinite for less than `_FEWEST`."""
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


def sharpness(stencil: Stencil, blocked: Float, share: Float, cosine: Float, light_id: Float,
              depth: Float, focal: Float, sizes: Float) -> list[Float]:
    """Whether each pixel's shadow ray was stopped, 1 or 0, and q where it was.

    Args:
        blocked: of `shadow_motion.stopped`. share: d / D. cosine: between the ray and the normal.
        light_id: what the ray was sent to. focal: f. sizes: of `light_sizes`.
    """
    nobody = float(dr.width(sizes) - 1)
    size = dr.gather(stencil.Float, sizes, stencil.UInt(
        dr.select(blocked, dr.select(light_id >= 0, light_id, nobody), 0)))
    left = dr.square((1 - share) * cosine)
    q = left / dr.maximum(dr.square(size * share * focal / depth) + left, 1e-20)
    return [dr.select(blocked, stencil.Float(1), 0), dr.select(blocked & (q > 0), q, 0)]


def narrowness(around: Sequence[Float], scale: Float, fewest: float) -> Float:
    """log2(e) q / (2 p^2) of each pixel: what a tap's squared distance takes off the log2 of its
    weight. around: `sharpness`, smoothed. scale: log2(e) / (2 p^2)."""
    share, q = around
    there = share > fewest
    return dr.select(there, scale * q / dr.select(there, share, 1), 0)
