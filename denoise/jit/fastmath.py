"""A fast power of two, for weights."""

# pyright: standard
from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np

from .arrays import Float

# 2^f on [-1/2, 1/2] as a cubic: relative error below 8e-5.
_EXP2 = (0.99992811, 0.69326099, 0.24261114, 0.05517166)
_MAGIC = 1.5 * 2**23  # adding it rounds a float to an integer, in the low bits of the sum
_LEAST = -63
_LEAST_POWER = float(np.float32(_EXP2[0])) * 2.0**_LEAST  # what the cubic makes of it


def exp2(x: Float) -> Float:
    """2^x for -45 <= x <= 0 with a relative error below 8e-5; 0 below -63, also for -inf and NaN.

    `dr.exp2` costs more than the rest of a tap of a bilateral filter. This is a cubic in the
    fraction, with the integer part added to the bits of the exponent. Its least value is taken off,
    so that pixels which do not count have no weight at all. Squares of the others are no denormal
    numbers, on which a processor spends a sixth of a filter's time.
    """
    float_t: Any = type(x)
    int_t: Any = dr.int32_array_t(float_t)
    x = dr.select(x > _LEAST, x, _LEAST)  # one instruction; dr.maximum's NaN rules cost more
    rounded = x + _MAGIC
    f = x - (rounded - _MAGIC)
    c0, c1, c2, c3 = _EXP2
    power = dr.fma(dr.fma(dr.fma(f, c3, c2), f, c1), f, c0)
    integer: Any = dr.reinterpret_array(int_t, rounded)
    exponent = integer << 23  # to where a float keeps its exponent; the rest falls out
    bits: Any = dr.reinterpret_array(int_t, power) + exponent
    weight: Any = dr.reinterpret_array(float_t, bits)
    return weight - _LEAST_POWER


LOG2E = 1.4426950408889634
