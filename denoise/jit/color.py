"""Luminance of colours of arrays, linear Rec. 709."""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr

from onespp.denoise.methods.atrous import LuminanceColor

from .arrays import Color, Float
from .color import LUMINANCE, luminance

LUMINANCE = (0.2126, 0.7152, 0.0722)


def luminance(color: Sequence[Float]) -> Float:
    """Relative luminance of linear Rec. 709 radiance."""
    red, green, blue = LUMINANCE
    return dr.fma(color[0], red, dr.fma(color[1], green, color[2] * blue))


def with_green(color: LuminanceColor) -> Color:
    r, y, b = color
    red, green, blue = LUMINANCE
    return Color(r, dr.fma(r, -red / green, dr.fma(b, -blue / green, y * (1 / green))), b)
