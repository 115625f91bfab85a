"""An image seen between its pixels, by cubic interpolation.

Along each axis, with f in [0, 1) from the second of four pixels to the third, the weights are

    f (-1/2 + f (1 - f / 2)),  1 + f^2 (-5/2 + 3/2 f),  f (1/2 + f (2 - 3/2 f)),  f^2 (f - 1) / 2.

They keep an image sharp that is looked up again and again, where bilinear weights blur it; but they
overshoot at edges. So each row's value is held between those of the two pixels around, and then the
result between those of the two rows: no more than a mean, and continuous from pixel to pixel, which
bounds by the four pixels around are not. Off the image the nearest pixel of it counts.

Source: Catmull and Rom 1974, "A class of local interpolating splines",
doi:10.1016/B978-0-12-079050-0.50020-5.
"""

# pyright: standard
from __future__ import annotations

from collections.abc import Sequence

import drjit as dr

from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.grid import Stencil

_WORDS = 8  # of a packed gather, of which three are used


def pack_image(stencil: Stencil, color: Color) -> Float:
    """A colour as `catmull_rom` wants it. Traced, not evaluated."""
    return stencil.pack([*color, *[stencil.Float(0)] * (_WORDS - len(color))])


def catmull_rom(stencil: Stencil, image: Float, x: Float, y: Float) -> Color:
    """The colour at screen positions (x, y) [pixels] of an image of `pack_image`."""
    columns, x_weights = _four(stencil, x - 0.5, stencil.width)
    rows, y_weights = _four(stencil, y - 0.5, stencil.height)
    values = []
    for row in rows:
        taps = [stencil.unpack(image, stencil.UInt(row * stencil.stride + column), _WORDS, 3)
                for column in columns]
        values.append([_held(x_weights, along) for along in zip(*taps)])
    return Color(*[_held(y_weights, along) for along in zip(*values)])


def _held(weights: list[Float], values: Sequence[Float]) -> Float:
    """The weighted sum of four values, between the second and the third."""
    total = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:]):
        total = dr.fma(weight, value, total)
    _, second, third, _ = values
    return dr.clip(total, dr.minimum(second, third), dr.maximum(second, third))


def _four(stencil: Stencil, position: Float, size: int) -> tuple[list, list[Float]]:
    """Indices of the pixels around a position, and their weights."""
    second = dr.floor(position)
    f = position - second
    indices = [dr.clip(stencil.Int(second) + i, 0, size - 1) for i in (-1, 0, 1, 2)]
    return indices, [f * dr.fma(f, dr.fma(f, -0.5, 1), -0.5),
                     dr.fma(f * f, dr.fma(f, 1.5, -2.5), 1),
                     f * dr.fma(f, dr.fma(f, -1.5, 2), 0.5), 0.5 * f * f * (f - 1)]
