"""Vectors and 3x3 matrices of arrays."""

# pyright: standard
from __future__ import annotations

import drjit as dr
import numpy as np

from .arrays import Float, Matrix3, Vector3
from .grid import Stencil


def dot(a: Vector3, b: Vector3) -> Float:
    return dr.fma(a.x, b.x, dr.fma(a.y, b.y, a.z * b.z))


def cross(a: Vector3, b: Vector3) -> Vector3:
    return Vector3(*[dr.fma(a[i], b[j], -(a[j] * b[i])) for i, j in ((1, 2), (2, 0), (0, 1))])


def transform(matrix: Matrix3, vector: Vector3) -> Vector3:
    return Vector3(*[dot(row, vector) for row in matrix])


def opaque_matrix(stencil: Stencil, matrix: np.ndarray) -> Matrix3:
    """A (3, 3) matrix that a kernel takes as an argument."""
    return Matrix3(*[Vector3(*[stencil.opaque(x) for x in row]) for row in matrix])
