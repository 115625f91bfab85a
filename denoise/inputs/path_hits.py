"""What each pixel's path met first, and how that has moved."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from onespp.denoise.geometry.motion import world_motions
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.grid import Stencil
from onespp.render.frame import Frame

from .shadow_rays import MATRIX_WORDS


class Hits(NamedTuple):
    """First hits of paths, traced and not yet evaluated.

    Attributes:
        distance: d, from the surface; 0 for nothing. id: object ID of what was hit, or less than 0.
        shifts: of `shift_table`. objects: their number.
    """

    distance: Float
    id: Float
    shifts: Float
    objects: Float


def read_hits(frame: Frame, previous: Frame, stencil: Stencil) -> Hits:
    """Hits of a frame, nothing where it does not tell of them; of the frame before, the matrices
    alone are read."""
    distance, id_ = (stencil.load(np.asarray(frame[name], np.float32))[0] if name in frame
                     else stencil.opaque(nothing)
                     for name, nothing in (("hit_distance", 0), ("hit_id", -1)))
    return Hits(distance, id_, stencil.table(shift_table(previous, frame)),
                stencil.opaque(len(frame.world_from_object)))


def shift_table(previous: Frame, frame: Frame) -> np.ndarray:
    """(objects, 16) float32: of each object the matrix V (M' M^-1 - I) V^-1, V being
    camera_from_world of the current frame: from a point of it, in camera space, to how far away it
    was. 0 for what is at rest, NaN where `world_motions` is."""
    v = frame.camera_from_world
    shift = v @ (world_motions(previous, frame) - np.eye(4)) @ np.linalg.inv(v)
    return shift.astype(np.float32).reshape(-1, MATRIX_WORDS)
