"""SVGF's accumulation of colour and of luminance moments, and the variance that follows from them.

Symbols: h history length in frames; m1, m2 means of luminance and of its square over the history.
A signal is (r, l, b), l its luminance, as in `atrous.py`.

    h = min(h' + 1, max_history_length), 1 without history
    C = C' + max(alpha, 1/h) (c - C'),  the same for m1, m2 with alpha_moments
    v = max(0, m2 - m1^2);  while h < 4, m1 and m2 are means over a 7x7 window with the geometry
        weights of `wavelet.py`, and v is multiplied by 4 / h.

With a change of shading lambda in [0, 1] (A-SVGF), a = lambda + (1 - lambda) max(alpha, 1/h) is the
weight of the current frame, and h = min(h' (1 - lambda)^10 + 1, max_history_length).

Sources: Schied et al. 2017, sections 4.2 and 4.3; the factor 4 / h is from NVIDIA's published pass.
Schied et al. 2018; the power of 10 from Quake II RTX.
"""

from __future__ import annotations

from typing import Any

import drjit as dr

from .arrays import Float
from .exponential import exp2
from .history import look_up
from .reprojection import Motion, locate
from .sparse import weighted_sums, window_taps
from .stencil import Stencil
from .surface import SurfaceSample
from .wavelet import geometry_exponent

FORGETTING = 10      # power of 1 - lambda that a length is multiplied by
SHORT = 4.0          # frames of history from which on its moments give the variance
RADIUS = 3           # pixels, of the window of the spatial estimate
VALUES = 5           # a signal's in a record: r, l, b, m1, m2


def accumulate(stencil: Stencil, fallback: bool, signal: list[Float], surface: SurfaceSample,
               motion: Motion, records: Float,
               changes: list[Float], alphas: list[Float],
               numbers: list[Float]) -> tuple[list[Float], list[Float], list[Float]]:
    """Blend with the history.

    Args:
        signal: three arrays a signal. motion: of `reprojection.motion_between`.
        records: `history.pack_records` of the lengths and `VALUES` a signal.
        changes: lambda of each signal, which then has a length of its own; or none.
        alphas: of each signal. numbers: alpha_moments, max_history_length,
            min_cosine, plane_tolerance.
    Returns:
        Colour (3 a signal), moments (2 a signal), lengths (1, or 1 a signal with `changes`).
    """
    alpha_moments, max_history_length, min_cosine, tolerance = numbers
    signals = [signal[i:i + 3] for i in range(0, len(signal), 3)]
    place = locate(stencil, surface, motion, tolerance)
    count = max(len(changes), 1)
    old, found = look_up(stencil, place, records, count + VALUES * len(signals), min_cosine,
                         fallback)
    colors, moments, lengths = [], [], []
    for s, (r, y, b) in enumerate(signals):
        if s < count:
            kept = (1 - changes[s])**FORGETTING if changes else 1
            length = dr.minimum(dr.fma(old[s], kept, 1), max_history_length)
            lengths.append(dr.select(found, length, 1))
        fresh = 1 / lengths[-1]
        weights = [dr.maximum(alphas[s], fresh)] * 3 + [dr.maximum(alpha_moments, fresh)] * 2
        if changes:
            weights = [dr.fma(changes[s], 1 - w, w) for w in weights]
        before = old[count + VALUES * s:count + VALUES * (s + 1)]
        mixed = [dr.select(found, dr.fma(w, n - o, o), n)
                 for w, n, o in zip(weights, [r, y, b, y, y * y], before, strict=True)]
        colors += mixed[:3]
        moments += mixed[3:]
    return colors, moments, lengths


def estimate_variances(stencil: Stencil, moments: list[Float], lengths: list[Float],
                       guides: list[Float], table: list[Float],
                       numbers: list[Float]) -> list[Float]:
    """v of each signal; numbers: half_power, and the length from which on history gives it."""
    half_power, enough = numbers
    wanted = lengths[0] < enough
    for h in lengths[1:]:
        wanted |= h < enough
    count, around = len(moments), window_taps(stencil, RADIUS, table[0])

    def tap(i: Any) -> tuple[Float, list[Float]]:
        inside, dy, dx, words = around(i)
        gradient = dr.abs(dr.fma(guides[4], dx, guides[5] * dy))
        w = exp2(geometry_exponent(guides, words[count:count + 4], gradient, half_power))
        return dr.select(inside, w, 0), words[:count]

    total, sums = weighted_sums(stencil, wanted, (2 * RADIUS + 1)**2, count, tap)
    norm = dr.select(wanted, 1 / dr.select(wanted, total, 1), 0)
    variances = []
    for s in range(0, count, 2):
        h = lengths[min(s // 2, len(lengths) - 1)]
        m1, m2 = (dr.select(h < enough, a * norm, m)
                  for a, m in zip(sums[s:s + 2], moments[s:s + 2]))
        v = dr.fma(-m1, m1, m2)
        variances.append(dr.select(v > 0, v, 0) * dr.maximum(1, SHORT / h))
    return variances
