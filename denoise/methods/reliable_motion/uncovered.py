"""A history for what was hidden: the surface beside the occluder, where that was (dual motion).

Symbols: x a pixel of a surface that the previous frame does not show, y where it would have been
there, o the object that was seen at y, m the motion of o from there to the current frame. The
pixel at the same place beside the occluder was x - m, for o moved by m: if that shows the same
surface, its light is what x has seen of it.

Source: Zeng et al. 2021, section 4.3, where it is y + (x - z), z = y + m.
"""

# pyright: standard
from __future__ import annotations

from dataclasses import replace

import drjit as dr

from onespp.denoise.history.records import surface_at
from onespp.denoise.history.reprojection import Motion, Place, ScreenShift, locate
from onespp.denoise.jit.arrays import Bool, Float
from onespp.denoise.jit.grid import Stencil


def beside_occluder(stencil: Stencil, place: Place, records: Float, words: int,
                    forward: Motion) -> tuple[Place, Bool]:
    """x - m, with the tests of `place`, and the mask of the pixels that were hidden by something.

    Args:
        place: of `locate`. records: of the frame before, of so many words.
        forward: `motion_between`, from the current frame to the one before it.
    """
    float_t = stencil.Float
    column, row = dr.floor(place.x), dr.floor(place.y)
    lane = stencil.UInt(row) * stencil.stride + stencil.UInt(column)
    occluder = surface_at(stencil, records, lane, words)
    at_row, at_column = (float_t(at) for at in stencil.pixel())
    back = ScreenShift(column - at_column, row - at_row)
    now = locate(stencil, occluder, forward, float_t(1), back)
    hidden = place.inside & now.inside & (occluder.id >= 0) & (occluder.id != place.id)
    x, y = (here + 0.5 - (moved - (was + 0.5)) for here, moved, was in (
        (at_column, now.x, column), (at_row, now.y, row)))
    hidden &= (x >= 0) & (x < stencil.width) & (y >= 0) & (y < stencil.height)
    return replace(place, x=dr.select(hidden, x, 0.5), y=dr.select(hidden, y, 0.5),
                   inside=hidden), hidden
