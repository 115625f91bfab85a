"""How objects moved between two frames, float64."""

from __future__ import annotations

import numpy as np

from onespp.render.frame import Frame


def world_motions(previous: Frame, current: Frame) -> np.ndarray:
    """(objects, 4, 4) M' M^-1, exactly the identity for an object at rest; NaN for one that only
    one of the frames has, or whose M has changed and cannot be inverted."""
    motion = _before(previous, current) @ inverses(current.world_from_object)
    motion[at_rest(previous, current)] = np.eye(4)
    return motion


def at_rest(previous: Frame, current: Frame) -> np.ndarray:
    """(objects,) bool: whether M is as it was."""
    return (_before(previous, current) == current.world_from_object).all((1, 2))


def _before(previous: Frame, current: Frame) -> np.ndarray:
    """(objects, 4, 4) M' of each object of the current frame, NaN where there is none."""
    before = np.full(current.world_from_object.shape, np.nan)
    count = min(len(before), len(previous.world_from_object))
    before[:count] = previous.world_from_object[:count]
    return before


def inverses(matrices: np.ndarray) -> np.ndarray:
    """(n, k, k) inverses, NaN where there is none."""
    try:
        return np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full(matrices.shape, np.nan)
        return np.concatenate([inverses(matrix[None]) for matrix in matrices])
