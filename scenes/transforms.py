"""4x4 transforms of column vectors, float64. `a @ b` applies b first.

Angles are in degrees, axes need not be unit length, lengths are scene units.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

Matrix = np.ndarray
Vector = Sequence[float] | np.ndarray


def identity() -> Matrix:
    return np.eye(4)


def translate(offset: Vector) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def scale(factor: float | Vector) -> Matrix:
    matrix = np.eye(4)
    matrix[[0, 1, 2], [0, 1, 2]] = factor
    return matrix


def rotate(axis: Vector, angle: float) -> Matrix:
    """Rotation by `angle` degrees, counter-clockwise when `axis` points at the viewer.

    Source: Rodrigues' formula.
    """
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += (math.sin(math.radians(angle)) * cross
                       + (1 - math.cos(math.radians(angle))) * cross @ cross)
    return matrix


def look_at(origin: Vector, target: Vector, up: Vector = (0, 1, 0)) -> Matrix:
    """world_from_camera of a camera at `origin` that looks at `target`.

    Camera space: x to the right, y down, z forward (so depth is positive).

    Raises:
        ValueError: origin and target coincide, or `up` is parallel to the view.
    """
    forward = np.asarray(target, float) - np.asarray(origin, float)
    right = np.cross(forward, np.asarray(up, float))
    if not np.linalg.norm(right) > 1e-12 * np.linalg.norm(forward) * np.linalg.norm(up):
        raise ValueError(f"look_at({origin}, {target}, {up}): the view direction is zero "
                         "or parallel to up")
    forward /= np.linalg.norm(forward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0] = right
    matrix[:3, 1] = np.cross(forward, right)
    matrix[:3, 2] = forward
    matrix[:3, 3] = origin
    return matrix
