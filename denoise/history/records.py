"""Several values a pixel carried from frame to frame, with SVGF's fallback.

A record is a pixel of the previous frame: object ID and sign of n_z, n_x, n_y, depth, then up to
12 values, or 28.
Symbols and tests are those of `reprojection.py`. Bilinear taps that pass are weighed and
renormalised; with less than `LEAST_WEIGHT` of them, the plain mean of those that pass among the
3x3 pixels around (Schied et al. 2017, section 4.2); else there is no history.

Departure from SVGF: it tests the difference of depths, this the distance from the tangent plane.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Generic, NamedTuple, TypeVar

import drjit as dr

from onespp.denoise.inputs.surface import SurfaceSample
from onespp.denoise.jit.arrays import Bool, Float, UInt, Vector3
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.masked import weighted_sums
from onespp.denoise.jit.structure import arrays_of
from onespp.denoise.jit.vector import dot
from onespp.render.frame import Frame

from .reprojection import LEAST_WEIGHT, Place

PassesT = TypeVar("PassesT")

WORDS = 16          # floats in a record, one cache line; or two
_HEAD = 4
MOST_VALUES = 2 * WORDS - _HEAD
_NOBODY = -2.0      # ID of an empty record


def record_words(values: int) -> int:
    """Floats in a record of so many values."""
    return WORDS if _HEAD + values <= WORDS else 2 * WORDS


def no_history(stencil: Stencil, values: int = 0) -> Float:
    """Records of so many values that no pixel finds."""
    return dr.opaque(stencil.Float, _NOBODY, stencil.lanes * record_words(values))


def pack_records(stencil: Stencil, surface: SurfaceSample, values: Any) -> Float:
    """Records of a frame; values: a structure of arrays (`structure.py`), at most `MOST_VALUES`."""
    arrays = arrays_of(values)
    if len(arrays) > MOST_VALUES:
        raise ValueError(f"a record holds {MOST_VALUES} values, not {len(arrays)}")
    n = surface.normal
    words = [stencil.Float(surface.id) + dr.select(n.z < 0, stencil.Float(0.5), 0), n.x, n.y,
             surface.depth, *arrays]
    words += [stencil.Float(0)] * (record_words(len(arrays)) - len(words))
    return stencil.pack(words)


@dataclass(frozen=True)
class RecordState(Generic[PassesT]):
    """A method's records of the previous frame and its matrices, and its passes."""

    stencil: Stencil
    records: Float = field(repr=False)
    previous: Frame | None = None
    passes: PassesT | None = None


class Scatter(NamedTuple):
    """How a value differs among the taps that pass: its variance by their weights w, which add up
    to 1, and sum w^2."""

    variance: Float
    concentration: Float


def surface_at(stencil: Stencil, records: Float, lane: UInt, words: int) -> SurfaceSample:
    """The surface that records of so many words show in a pixel of the previous frame."""
    return _surface_of(stencil.unpack(records, lane, words, _HEAD))


def _surface_of(record: list[Float]) -> SurfaceSample:
    head, nx, ny, depth = record[:_HEAD]
    id_ = dr.floor(head)
    nz = dr.sqrt(dr.maximum(dr.fma(-nx, nx, dr.fma(-ny, ny, 1)), 0))
    return SurfaceSample(id_, Vector3(nx, ny, dr.select(head == id_, nz, -nz)), depth)


class LookUp(NamedTuple):
    """Values of records, depth first as they were packed, the mask of pixels that have some, and
    the scatter of the value that was asked for."""

    values: list[Float]
    is_valid: Bool
    scatter: Scatter | None = None


def look_up(stencil: Stencil, place: Place, records: Float, count: int, min_cosine: Float,
            fallback: bool = False, active: Bool | None = None, words: int = WORDS,
            scattered: int | None = None) -> LookUp:
    """The first `count` values of the previous frame's records where each pixel's surface was.

    Args:
        fallback: take the mean around, see the module's header.
        active: mask of the pixels that ask, if they are few; the others get no history.
        words: of a record, see `record_words`.
        scattered: of which value the scatter is wanted; not with `fallback`.
    Returns:
        values that are 0 where there is no history.
    """
    float_t, int_t = stencil.Float, stencil.Int

    def tap(column: Any, row: Any) -> tuple[list[Float], Any]:
        """Values of a record, and whether it passes."""
        on_screen = ((column >= 0) & (column < stencil.width)
                     & (row >= 0) & (row < stencil.height))
        lane = dr.select(on_screen, row * stencil.stride + column, 0)
        record = stencil.unpack(records, lane, words, _HEAD + count)
        id_, normal, depth = _surface_of(record)
        center = Vector3(float_t(column) + 0.5, float_t(row) + 0.5, float_t(1))
        near = dr.abs(dr.fma(depth, dot(place.plane, center), -place.offset)) < place.nearness
        turned = dot(place.normal, normal) > min_cosine
        passes = on_screen & (id_ == place.id) & (place.rough | (near & turned))
        return record[_HEAD:], passes

    left, top = dr.floor(place.x - 0.5), dr.floor(place.y - 0.5)
    fx, fy = place.x - 0.5 - left, place.y - 0.5 - top

    def corner(dy: Any, dx: Any) -> tuple[Float, list[Float]]:
        values, passes = tap(int_t(left) + dx, int_t(top) + dy)
        weight = dr.abs(fx + (float_t(dx) - 1)) * dr.abs(fy + (float_t(dy) - 1))
        weight = dr.select(passes, weight, 0)
        if scattered is not None:
            values = [*values, dr.square(values[scattered]), weight]
        return weight, values

    wanted = count + 2 * (scattered is not None)
    if active is None:
        sums, total = [float_t(0)] * wanted, float_t(0)
        for dy in (0, 1):
            for dx in (0, 1):
                weight, values = corner(dy, dx)
                sums = [dr.fma(weight, v, s) for v, s in zip(values, sums)]
                total += weight
    else:
        total, sums = weighted_sums(stencil, active & place.inside, 4, wanted,
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
    values = [s * scale for s in sums]
    if scattered is None:
        return LookUp(values, found)
    *values, mean_square, mean_weight = values
    variance = mean_square - dr.square(values[scattered])
    return LookUp(values, found, Scatter(variance, mean_weight * scale))
