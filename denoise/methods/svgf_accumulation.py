"""SVGF's accumulation of colour and of luminance moments, and the variance that follows from them.

Symbols: h history length in frames; m1, m2 means of luminance and of its square over the history.
A signal is (r, l, b), l its luminance, as in `atrous.py`.

    h = min(h' + 1, max_history_length), 1 without history
    C = C' + max(alpha, 1/h) (c - C'),  the same for m1, m2 with alpha_moments
    v = max(0, m2 - m1^2);  while h < 4, m1 and m2 are means over a 7x7 window with the geometry
        weights of `filters/svgf_level.py`, and v is multiplied by 4 / h.

With a change of shading lambda in [0, 1] (A-SVGF), a = lambda + (1 - lambda) max(alpha, 1/h) is the
weight of the current frame, and h = min(h' (1 - lambda)^10 + 1, max_history_length).

Sources: Schied et al. 2017, sections 4.2 and 4.3; the factor 4 / h is from NVIDIA's published pass.
Schied et al. 2018; the power of 10 from Quake II RTX.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from operator import or_
from typing import Any, NamedTuple

import drjit as dr

from onespp.denoise.filters.svgf_level import Geometry, Guides, geometry_exponent, guides_of
from onespp.denoise.history.records import LookUp, look_up, record_words
from onespp.denoise.history.reprojection import Motion, Place, ReprojectionTests, locate
from onespp.denoise.inputs.surface import SurfaceSample
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.color import LuminanceColor
from onespp.denoise.jit.fastmath import exp2
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.masked import tabulate, weighted_sums, window_taps
from onespp.denoise.jit.structure import arrays_of

FORGETTING = 10      # power of 1 - lambda that a length is multiplied by
SHORT = 4.0          # frames of history from which on its moments give the variance
RADIUS = 3           # pixels, of the window of the spatial estimate
_COLOR, _MOMENTS, _GUIDES = 3, 2, 4


class Moments(NamedTuple):
    """m1 and m2."""

    first: Float
    second: Float


class AccumulatedSignal(NamedTuple):
    """A signal's means over its history."""

    color: LuminanceColor
    moments: Moments


class Accumulated(NamedTuple):
    """What a record holds: lengths, one for all signals or one of each, and the signals."""

    lengths: list[Float]
    signals: list[AccumulatedSignal]


class AccumulationWeights(NamedTuple):
    """Least weights of the current frame, alpha of each signal and of moments; longest history."""

    alphas: list[Float]
    alpha_moments: Float
    max_history_length: Float


class Sought(NamedTuple):
    """What a history was looked up by."""

    surface: SurfaceSample
    motion: Motion
    place: Place
    records: Float
    tests: ReprojectionTests


Refine = Callable[[Stencil, Sought, LookUp, Any], LookUp]
"""What a method makes of a history: what it was looked up by, what was found, and what the method
knows beside it (a structure of arrays)."""


def record_values(signals: int, lengths: int = 1) -> int:
    """Values of a record."""
    return lengths + (_COLOR + _MOMENTS) * signals


def accumulate(stencil: Stencil, fallback: bool, refine: Refine | None,
               signals: list[LuminanceColor],
               surface: SurfaceSample, motion: Motion, records: Float, changes: list[Float],
               weights: AccumulationWeights, tests: ReprojectionTests,
               known: Any = None) -> Accumulated:
    """Blend with the history.

    Args:
        refine: what is made of the history first, with `known`.
        motion: of `reprojection.motion_between`.
        records: `history.pack_records` of what this gave for the frame before, which may have
            got other colours.
        changes: lambda of each signal, which then has a length of its own; or none.
    """
    place = locate(stencil, surface, motion, tests.plane_tolerance)
    count = max(len(changes), 1)
    size = record_values(len(signals), count)
    found = look_up(stencil, place, records, size, tests.min_cosine, fallback,
                    words=record_words(size))
    if refine is not None:
        found = refine(stencil, Sought(surface, motion, place, records, tests), found, known)
    values, is_valid, _ = found
    history = _accumulated(values, count)
    lengths, blended = [], []
    for s, (color, old) in enumerate(zip(signals, history.signals, strict=True)):
        if s < count:
            kept = (1 - changes[s])**FORGETTING if changes else 1
            length = dr.minimum(dr.fma(history.lengths[s], kept, 1), weights.max_history_length)
            lengths.append(dr.select(is_valid, length, 1))
        fresh = 1 / lengths[-1]
        alpha, alpha_moments = (dr.maximum(a, fresh)
                                for a in (weights.alphas[s], weights.alpha_moments))
        if changes:
            alpha, alpha_moments = (dr.fma(changes[s], 1 - a, a) for a in (alpha, alpha_moments))
        now = Moments(color.luminance, color.luminance * color.luminance)
        blended.append(AccumulatedSignal(
            LuminanceColor(*[dr.select(is_valid, dr.fma(alpha, n - o, o), n)
                             for n, o in zip(color, old.color)]),
            Moments(*[dr.select(is_valid, dr.fma(alpha_moments, n - o, o), n)
                      for n, o in zip(now, old.moments)])))
    return Accumulated(lengths, blended)


def _accumulated(values: list[Float], lengths: int) -> Accumulated:
    """Of the values of a record."""
    size = _COLOR + _MOMENTS
    signals = [AccumulatedSignal(LuminanceColor(*values[i:i + _COLOR]),
                                 Moments(*values[i + _COLOR:i + size]))
               for i in range(lengths, len(values), size)]
    return Accumulated(values[:lengths], signals)


def tabulate_moments(stencil: Stencil, accumulated: Accumulated, guides: Guides) -> Float:
    """The window's table: moments of each signal, then guides. Traced, not evaluated."""
    return tabulate(stencil, arrays_of([s.moments for s in accumulated.signals], guides))


def estimate_variances(stencil: Stencil, accumulated: Accumulated, geometry: Geometry,
                       window_table: Float, min_temporal_length: Float,
                       normal_exponent: Float) -> list[Float]:
    """v of each signal.

    Args:
        window_table: of `tabulate_moments`.
        min_temporal_length: from which on history gives the variance, not the window.
        normal_exponent: of `svgf_level.SvgfLevelWeights`.
    """
    lengths, signals = accumulated
    is_short = [h < min_temporal_length for h in lengths]
    active = reduce(or_, is_short)
    count = _MOMENTS * len(signals)
    around = window_taps(stencil, RADIUS, window_table, count + _GUIDES)
    tolerance = geometry.tolerance

    def tap(i: Any) -> tuple[Float, list[Float]]:
        inside, dy, dx, words = around(i)
        gradient = dr.abs(dr.fma(tolerance.dx, dx, tolerance.dy * dy))
        w = exp2(geometry_exponent(geometry, guides_of(*words[count:]), gradient,
                                   normal_exponent))
        return dr.select(inside, w, 0), words[:count]

    total, sums = weighted_sums(stencil, active, (2 * RADIUS + 1)**2, count, tap)
    norm = dr.select(active, 1 / dr.select(active, total, 1), 0)
    variances = []
    for s, signal in enumerate(signals):
        of = min(s, len(lengths) - 1)
        window = Moments(*sums[_MOMENTS * s:_MOMENTS * (s + 1)])
        m1, m2 = (dr.select(is_short[of], w * norm, m) for w, m in zip(window, signal.moments))
        v = dr.fma(-m1, m1, m2)
        variances.append(dr.select(v > 0, v, 0) * dr.maximum(1, SHORT / lengths[of]))
    return variances
