"""Several values a pixel carried from frame to frame, with SVGF's fallback.

A record is a pixel of the previous frame: object ID and sign of n_z, n_x, n_y, depth, then up to
12 values.
Symbols and tests are those of `reprojection.py`. Bilinear taps that pass are weighed and
renormalised; with less than `LEAST_WEIGHT` of them, the plain mean of those that pass among the
3x3 pixels around (Schied et al. 2017, section 4.2); else there is no history.

Departure from SVGF: it tests the difference of depths, this the distance from the tangent plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import drjit as dr

from render.frame import Frame

from .reprojection import LEAST_WEIGHT, Place
from .sparse import weighted_sums
from .stencil import Float, Stencil
from .surface import dot

WORDS = 16          # floats in a record, one cache line
MOST_VALUES = 12
_HEAD = WORDS - MOST_VALUES
_NOBODY = -2.0      # ID of an empty record


def no_history(stencil: Stencil) -> Float:
    """Records that no pixel finds."""
    return dr.opaque(stencil.Float, _NOBODY, stencil.lanes * WORDS)


def pack_records(stencil: Stencil, surface: list[Float], values: Sequence[Float]) -> Float:
    """Records of a frame; surface: ID, normal (3), depth."""
    if len(values) > MOST_VALUES:
        raise ValueError(f"a record holds {MOST_VALUES} values, not {len(values)}")
    id_, nx, ny, nz, depth = surface
    words = [stencil.Float(id_) + dr.select(nz < 0, stencil.Float(0.5), 0), nx, ny, depth, *values]
    words += [stencil.Float(0)] * (WORDS - len(words))
    return stencil.pack(words)


@dataclass(frozen=True)
class RecordState:
    """A method's records of the previous frame and its matrices, and what it works with."""

    stencil: Stencil
    records: Float = field(repr=False)
    previous: Frame | None = None
    works: Any = None


def look_up(stencil: Stencil, place: Place, records: Float, count: int, min_cosine: Float,
            fallback: bool = False, wanted: Any = None) -> tuple[list[Float], Any]:
    """The first `count` values of the previous frame's records where each pixel's surface was.

    Args:
        wanted: mask of the pixels that ask, if they are few; the others get no history.
    Returns:
        `count` arrays, 0 where there is no history, and the mask of where there is.
    """
    float_t, int_t = stencil.Float, stencil.Int

    def tap(column: Any, row: Any) -> tuple[list[Float], Any]:
        """Values of a record, and whether it passes."""
        on_screen = ((column >= 0) & (column < stencil.width)
                     & (row >= 0) & (row < stencil.height))
        lane = dr.select(on_screen, row * stencil.stride + column, 0)
        words = stencil.unpack(records, lane, WORDS, _HEAD + count)
        head, nx, ny, depth = words[:_HEAD]
        id_ = dr.floor(head)
        nz = dr.sqrt(dr.maximum(dr.fma(-nx, nx, dr.fma(-ny, ny, 1)), 0))
        normal = [nx, ny, dr.select(head == id_, nz, -nz)]
        center = [float_t(column) + 0.5, float_t(row) + 0.5, float_t(1)]
        near = dr.abs(dr.fma(depth, dot(place.plane, center), -place.offset)) < place.nearness
        turned = dot(place.normal, normal) > min_cosine
        passes = on_screen & (id_ == place.id) & (place.rough | (near & turned))
        return words[_HEAD:], passes

    left, top = dr.floor(place.x - 0.5), dr.floor(place.y - 0.5)
    fx, fy = place.x - 0.5 - left, place.y - 0.5 - top

    def corner(dy: Any, dx: Any) -> tuple[Float, list[Float]]:
        values, passes = tap(int_t(left) + dx, int_t(top) + dy)
        weight = dr.abs(fx + (float_t(dx) - 1)) * dr.abs(fy + (float_t(dy) - 1))
        return dr.select(passes, weight, 0), values

    if wanted is None:
        sums, total = [float_t(0)] * count, float_t(0)
        for dy in (0, 1):
            for dx in (0, 1):
                weight, values = corner(dy, dx)
                sums = [dr.fma(weight, v, s) for v, s in zip(values, sums)]
                total += weight
    else:
        total, sums = weighted_sums(stencil, wanted & place.inside, 4, count,
                                    lambda i: corner(i >> 1, i & 1))
    if fallback:
        lacking = place.inside & (total < LEAST_WEIGHT)

        def around(i: Any) -> tuple[Float, list[Float]]:
            dy = i // 3
            values, passes = tap(int_t(place.x) + (i - 3 * dy) - 1, int_t(place.y) + dy - 1)
            return dr.select(passes, float_t(1), 0), values

        number, mean = weighted_sums(stencil, lacking, 9, count, around)
        sums = [dr.select(lacking, m, s) for m, s in zip(mean, sums)]
        total = dr.select(lacking, number, total)
    found = place.inside & (total >= LEAST_WEIGHT)
    scale = dr.select(found, 1 / dr.select(found, total, 1), 0)
    return [s * scale for s in sums], found
