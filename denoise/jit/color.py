"""Colours of arrays, linear Rec. 709.

Kernels that weigh by luminance filter (r, l, b) instead of (r, g, b), so that no tap computes its
luminance; g comes out of the three at the end, with an error of 1e-7 times the brightest of them.
"""

# pyright: standard
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import drjit as dr

from .arrays import Color, Float

LUMINANCE = (0.2126, 0.7152, 0.0722)


def luminance(color: Sequence[Float]) -> Float:
    """Relative luminance of linear Rec. 709 radiance."""
    red, green, blue = LUMINANCE
    return dr.fma(color[0], red, dr.fma(color[1], green, color[2] * blue))


def with_green(color: LuminanceColor) -> Color:
    """(r, g, b) of (r, l, b)."""
    r, y, b = color
    red, green, blue = LUMINANCE
    return Color(r, dr.fma(r, -red / green, dr.fma(b, -blue / green, y * (1 / green))), b)


class LuminanceColor(NamedTuple):
    """A colour whose green is told by its luminance."""

    red: Float
    luminance: Float
    blue: Float


def with_luminance(color: Color) -> LuminanceColor:
    """(r, l, b) of (r, g, b)."""
    return LuminanceColor(color.red, luminance(color), color.blue)
