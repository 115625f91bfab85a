"""Unit quaternions (w, x, y, z) as float64 arrays, and their exponential map.

A rotation vector is the axis times the angle in radians. Quaternions are multiplied like
rotation matrices: `multiply(a, b)` turns by b first.
"""

from __future__ import annotations

import numpy as np

from .transforms import Matrix, Vector


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    w = a[0] * b[0] - a[1:] @ b[1:]
    return np.concatenate([[w], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])])


def conjugate(q: np.ndarray) -> np.ndarray:
    return q * (1, -1, -1, -1)


def exp(rotation: np.ndarray) -> np.ndarray:
    """Quaternion of a rotation vector."""
    half = np.linalg.norm(rotation) / 2
    # sinc stays exact where the angle vanishes.
    return np.concatenate([[np.cos(half)], np.sinc(half / np.pi) / 2 * np.asarray(rotation, float)])


def log(q: np.ndarray) -> np.ndarray:
    """Rotation vector of a quaternion, the shorter way round (at most pi long)."""
    if q[0] < 0:
        q = -q
    sine = np.linalg.norm(q[1:])
    return q[1:] * (2 * np.arctan2(sine, q[0]) / sine if sine > 1e-12 else 2.0)


def from_axis_angle(axis: Vector, angle: float) -> np.ndarray:
    """Quaternion that turns by `angle` degrees about `axis` (any length but 0)."""
    return exp(np.asarray(axis, float) / np.linalg.norm(axis) * np.radians(angle))


def to_matrix(q: np.ndarray) -> Matrix:
    """4x4 rotation of a unit quaternion."""
    w, x, y, z = q
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += 2 * (w * cross + cross @ cross)
    return matrix
