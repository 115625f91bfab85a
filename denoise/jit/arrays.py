"""The types of Dr.Jit arrays, for annotations, and vectors of three.

A kernel is written once for the CPU and for CUDA; which of the two is known at run time. Both
offer the same operations with the same signatures, so type checkers are given those of the CPU.
At run time the names stand for anything: importing this module loads neither.
"""

# pyright: standard
from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from drjit.llvm import Array4f, ArrayXf, Bool, Float, Int, UInt
else:
    Array4f = ArrayXf = Bool = Float = Int = UInt = Any

__all__ = ["Array4f", "ArrayXf", "Bool", "Color", "Float", "Int", "Matrix3", "UInt", "Vector3"]


class Vector3(NamedTuple):
    """A direction or a position."""

    x: Float
    y: Float
    z: Float


class Matrix3(NamedTuple):
    """A 3x3 matrix, row by row."""

    x: Vector3
    y: Vector3
    z: Vector3


class Color(NamedTuple):
    """Linear Rec. 709."""

    red: Float
    green: Float
    blue: Float
