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
from dataclasses import dataclass
from typing import Any

import drjit as dr

from .reprojection import LEAST_WEIGHT
from .sparse import weighted_sums
from .stencil import Float, Stencil
from .surface import dot, transform

WORDS = 16          # floats in a record, one cache line
MOST_VALUES = 12
_HEAD = WORDS - MOST_VALUES
_CHUNK = 8          # floats that one gather brings, at most
_ROW = 32           # floats an object in the motion table
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
    packed = dr.empty(stencil.Float, stencil.lanes * WORDS)
    dr.scatter(packed, stencil.ArrayXf(words), dr.arange(stencil.UInt, stencil.lanes))
    return packed


@dataclass(frozen=True)
class Place:
    """Where each pixel's surface was: what a record must agree with.

    Attributes:
        x, y: screen position in the previous frame. inside: whether it is on that screen.
        id: object ID. normal: expected there. smooth: whether there is a normal.
        plane, offset, nearness: a record at u' with depth z' is near the expected tangent plane
            if |z' plane . u' - offset| < nearness.
    """

    x: Float
    y: Float
    inside: Any
    id: Float
    normal: list[Float]
    smooth: Any
    plane: list[Float]
    offset: Float
    nearness: Float


def locate(stencil: Stencil, surface: list[Float], table: Float, dual: list[Float],
           plane_tolerance: Float) -> Place:
    """Args as for `reprojection.reproject`."""
    float_t = stencil.Float
    id_, *normal, depth = surface
    known = (id_ >= 0) & (id_ < dr.width(table) // _ROW)
    quad = stencil.UInt(dr.select(known, id_, 0)) * (_ROW // 4)
    rows = [dr.gather(stencil.Array4f, table, quad + r) for r in range(6)]
    row, column = stencil.pixel()
    u = [float_t(column) + 0.5, float_t(row) + 0.5, float_t(1)]
    d = [dr.fma(e.w, 1 / depth, dot([e.x, e.y, e.z], u)) for e in rows[:3]]
    scale = 1 + d[2]
    x = u[0] + (d[0] - u[0] * d[2]) / scale
    y = u[1] + (d[1] - u[1] * d[2]) / scale
    inside = (known & (scale > 1e-6) & (x >= 0) & (x < stencil.width)
              & (y >= 0) & (y < stencil.height))
    x, y = dr.select(inside, x, 0.5), dr.select(inside, y, 0.5)
    expected = transform([[r.x, r.y, r.z] for r in rows[3:]], normal)
    plane = transform([dual[:3], dual[3:6], dual[6:]], expected)
    depth = depth * scale
    return Place(x, y, inside, float_t(id_), expected, dot(normal, normal) > 0.25, plane,
                 depth * dot(plane, [x, y, float_t(1)]), plane_tolerance * depth)


def look_up(stencil: Stencil, place: Place, records: Float, count: int, min_cosine: Float,
            fallback: bool) -> tuple[list[Float], Any]:
    """The first `count` values of the previous frame's records where each pixel's surface was.

    Returns:
        `count` arrays, 0 where there is no history, and the mask of where there is.
    """
    float_t, int_t = stencil.Float, stencil.Int

    def tap(column: Any, row: Any) -> tuple[list[Float], Any]:
        """Values of a record, and whether it passes."""
        on_screen = ((column >= 0) & (column < stencil.width)
                     & (row >= 0) & (row < stencil.height))
        words = _record(stencil, records, dr.select(on_screen, row * stencil.stride + column, 0),
                        _HEAD + count)
        head, nx, ny, depth = words[:_HEAD]
        id_ = dr.floor(head)
        nz = dr.sqrt(dr.maximum(dr.fma(-nx, nx, dr.fma(-ny, ny, 1)), 0))
        normal = [nx, ny, dr.select(head == id_, nz, -nz)]
        center = [float_t(column) + 0.5, float_t(row) + 0.5, float_t(1)]
        near = dr.abs(dr.fma(depth, dot(place.plane, center), -place.offset)) < place.nearness
        turned = dot(place.normal, normal) > min_cosine
        passes = on_screen & (id_ == place.id) & (~place.smooth | (near & turned))
        return words[_HEAD:], passes

    left, top = dr.floor(place.x - 0.5), dr.floor(place.y - 0.5)
    fx, fy = place.x - 0.5 - left, place.y - 0.5 - top
    sums, total = [float_t(0)] * count, float_t(0)
    for dy in (0, 1):
        for dx in (0, 1):
            values, passes = tap(int_t(left) + dx, int_t(top) + dy)
            weight = dr.select(passes, (fx if dx else 1 - fx) * (fy if dy else 1 - fy), 0)
            sums = [dr.fma(weight, v, s) for v, s in zip(values, sums)]
            total += weight
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


def _record(stencil: Stencil, records: Float, lane: Any, count: int) -> list[Float]:
    words: list[Float] = []
    for chunk in range(-(-count // _CHUNK)):
        index = stencil.UInt(lane) * (WORDS // _CHUNK) + chunk
        words += list(dr.gather(stencil.ArrayXf, records, index, shape=(_CHUNK, stencil.lanes)))
    return words[:count]
