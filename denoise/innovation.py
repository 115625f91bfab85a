"""The kernels of the filtered innovation: history that follows a change of light.

Symbols: d a signal of the current frame and h its history, reprojected; e = d - h the innovation,
S[.] a wide smoothing over the surface by geometry alone; n length of the history in frames; s^2
variance of h's noise, s_0^2 of d's; l luminance.

    h <- d - (1 - a) (e - S[e]),   a = max(1 / n, alpha)

The current frame owns the low frequencies, where its noise is small, and history only what is left
of the high ones: h + S[e] + a (e - S[e]) is the same sum. Plain accumulation is S = 0: it lags.

S[e] may be noise itself. With Q = sum w^2 l(e)^2 / (sum w)^2 through all its levels, an estimate of
its variance (as White's 1980 of a regression's), a change is certain by c = 1 - k Q / l(S[e])^2,
and a signal takes the share f of it:

    h <- h + f S[e] + a (e - S[e])

    diffuse light, whose changes are slow        f = max(c, g)
    glossy light                                 f = g'
    visibility, whose changes have sharp edges   f = max(c, g'),  a = max(1 / n, alpha, r c)

    s^2 <- (1 - a)^2 s^2 + a^2 s_0^2,   s_0^2 = max(W[l(e)^2] - s^2, W[l(e)^2] / 4)

with W the first `ENERGY_LEVELS` levels of S: unlike the variance of d in a window, that of e has
no shadow's edge in it that stands still. Without history s_0^2 comes from what a small smoothing
takes out of l(d): `spatial_variances`.

Visibility has two histories, where the surface was and where its shadow was: `shadow_motion.py`.
Where the latter is taken, W is less by as much as its e^2 is, smoothed, and at least 0.

A smoothing is a-trous levels of 3x3 taps, h = {1/4, 1/2, 1/4}^2, 2^i pixels apart. The last filter
of h compares luminance too,

    w = h exp(-distance(q, p's plane) / (sigma_plane z(p)) - ((l(p) - l(q)) / (sigma s))^2)

and its last level fades out as the history grows. A pixel of another object counts for two fifths.
Visibility is filtered no farther than shadows are soft, and so are its e and Q: `penumbra.py`.
Normals are not compared: where they differ much the tangent plane is soon left, and at a crease, or
on a leaf, a neighbour turned away is a better guess than one sample (+0.2 to 0.9 dB for
normal_power 0 instead of 4 and 128).

Our own, from a trial; the nearest published relatives are the fast and slow histories of NRD and
the gradients of A-SVGF (Schied et al. 2018).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from itertools import product
from typing import Any

import drjit as dr

from .atrous import EPSILON, LOG2E
from .exponential import exp2
from .history import look_up, pack_records
from .penumbra import narrowness
from .reprojection import locate
from .shadow_motion import FEWEST, look_up_shadow
from .sparse import tabulate, weighted_sums, window_taps
from .stencil import Float, Offset, Stencil, Taps, window

BINOMIAL = {0: 1 / 2, 1: 1 / 4}
ENERGY_LEVELS = 2
LEAST_NOISE = 0.25    # share of the innovation's energy that is at least noise of d
STRANGER = 0.4        # weight of a pixel of another object, beside its distance
RADIUS = 2            # pixels, of the window of the spatial variance
_NEVER = -1e3         # log2 of a weight that is 0
_UNSEEN = -3e14       # 1/z of a pixel without history
_MOST = 1e36          # squares of luminance stay below: sums of them must not overflow
_LEAST = 1e-20        # square of a luminance that is taken for 0


def luma(size: int) -> int:
    """Index of the luminance among the planes of a signal: (v) or (r, l, b)."""
    return 1 if size == 3 else 0


def look_back(stencil: Stencil, sizes: tuple[int, ...], signal: list[Float], surface: list[Float],
              guides: list[Float], motion: list[Float], dual: list[Float], records: list[Float],
              shadows: list[Float], numbers: list[Float]) -> tuple[list[Float], ...]:
    """The innovation.

    Args:
        signal: planes of all signals. surface: ID, normal (3), depth. guides: 1/z, its slopes (2)
            and scale. motion, dual: of `motion_between`. records: of `pack_history`.
            shadows: of `follow_shadows`, smoothed, or empty. numbers: min_cosine,
            plane_tolerance, longest, scale of `narrowness`.
    Returns:
        e, 0 without history; l(e)^2 a signal; n, then s^2 of each signal's history; 1/z, far away
        without history; and, with `shadows`, e and s^2 of visibility's other history, and how much
        greater its e^2 is; and `narrowness`.
    """
    min_cosine, tolerance, longest, scale = numbers
    place = locate(stencil, surface, motion[0], dual, tolerance)
    count, last = 1 + len(signal) + len(sizes), sizes[-1] + 1
    words, found = look_up(stencil, place, records[0], count, min_cosine)
    length, old = words[last], [*words[last + 1:], *words[:last]]
    innovation, energies, variances, at = [], [], [], 0
    for s, size in enumerate(sizes):
        history = old[at + s:at + s + size]
        e = [dr.select(found, a - b, 0) for a, b in zip(signal[at:at + size], history)]
        innovation += e
        energies.append(dr.minimum(dr.square(e[luma(size)]), _MOST))
        variances.append(old[at + s + size])
        at += size
    length = dr.select(found, dr.minimum(length + 1, longest), 1)
    seen, other = [dr.select(found, guides[0], _UNSEEN)], []
    if shadows:
        (v, variance), moves = look_up_shadow(stencil, surface, guides, motion, dual, records[0],
                                              shadows, [min_cosine, tolerance])
        moves &= found
        e = dr.select(moves, signal[-1] - v, innovation[-1])
        other = [e, dr.select(moves, variance, variances[-1]), dr.square(e) - energies[-1]]
    narrow = [narrowness(shadows[3:], scale, FEWEST)] if shadows else []
    return innovation, energies, [length, *variances], seen, other, narrow


def pack_history(stencil: Stencil, sizes: tuple[int, ...], surface: list[Float],
                 length: list[Float], values: list[Float]) -> Float:
    """Records of a frame; values: planes and variance of each signal.

    The last signal comes first: visibility is looked up alone.
    """
    last = sizes[-1] + 1
    return pack_records(stencil, surface, [*values[-last:], *length, *values[:-last]])


def smooth_level(spreads: Collection[int], narrowed: Collection[int], values: Taps,
                 surfaces: Taps, plane: list[Float], spacing: list[Float],
                 narrow: Sequence[Float] = ()) -> list[Float]:
    """One level of S, and of Q. The last tap is the pixel itself.

    Args:
        spreads: indices of what Q is of. narrowed: of what is smoothed no farther than shadows
            are soft, if `narrow` says so. values: what Q and S are of.
        surfaces: 1/z, far away where a pixel has no history, so that it does not count; ID.
        plane: slope of 1/z by column and row, scale of a difference of 1/z.
        spacing: pixels between taps. narrow: `narrowness`, or empty.
    """
    exponent, near = surface_exponent(surfaces, plane, *spacing), narrowing(narrow, *spacing)
    h0 = BINOMIAL[0]**2

    def each(factors: Sequence[Any], terms: Sequence[Any]) -> list[Any]:
        """(factor, term) of each plane; factors: of the plane ones, and of those narrowed."""
        kinds = [factors[c in narrowed] for c in range(len(terms))]
        return [(dr.square(f) if c in spreads else f, t)
                for c, (f, t) in enumerate(zip(kinds, terms))]

    totals = [type(plane[0])(h0)] * 2
    sums = [f * v for f, v in each((h0, h0), values.at(-1))]
    for i, offset in enumerate(window(1)):
        x = exponent(i, offset)
        weights = exp2(x), exp2(near(x, offset))
        sums = [dr.fma(w, v, s) for (w, v), s in zip(each(weights, values.at(i)), sums)]
        totals = [t + w for t, w in zip(totals, weights)]
        values.next()
    return [f * s for f, s in each([1 / total for total in totals], sums)]


def narrowing(narrow: Sequence[Float], spacing: Float) -> Callable[[Float, Offset], Float]:
    """Function of (x, offset): log2 x of a weight, less the more the farther a tap is.

    narrow: `narrowness`, or empty, which takes nothing off.
    """
    limits = [x * dr.square(spacing) for x in narrow]

    def limited(x: Float, offset: Offset) -> Float:
        for limit in limits:
            x = dr.fma(limit, -float(offset[0]**2 + offset[1]**2), x)
        return x

    return limited


def surface_exponent(surfaces: Taps, plane: list[Float],
                     spacing: Float) -> Callable[[int, Offset], Float]:
    """Function of (tap, offset): log2 of h times the weight of the distance from p's plane, and
    of being another object."""
    gx, gy, scale = plane[0] * spacing, plane[1] * spacing, plane[2] * LOG2E
    inverse_depth, id_ = surfaces.at(-1)

    def exponent(i: int, offset: Offset) -> Float:
        dy, dx = offset
        tap_inverse_depth, tap_id = surfaces.at(i)
        expected = dr.fma(gx, float(dx), dr.fma(gy, float(dy), inverse_depth))
        log2_h = math.log2(BINOMIAL[abs(dy)] * BINOMIAL[abs(dx)])
        same = dr.select(tap_id == id_, type(scale)(log2_h), log2_h + math.log2(STRANGER))
        return dr.fma(dr.abs(tap_inverse_depth - expected), -scale, same)

    return exponent


def merge(stencil: Stencil, sizes: tuple[int, ...], signal: list[Float], innovation: list[Float],
          smooth: list[Float], energies: list[Float], carried: list[Float], other: list[Float],
          guides: list[Float], numbers: list[Float]) -> tuple[list[Float], list[Float]]:
    """The new history, a signal's planes and its s^2 each; and how the last filter fades out.

    Args:
        smooth: Q of the first and the last signal, S[e], and S of what is in `other`: how much
            greater e^2 is, and e.
        energies: W[l(e)^2]. carried, other: as from `look_back`.
        guides: 1/z, its slopes (2) and scale, of all pixels. numbers: g, k, g', r,
            frames until the filter has faded, and each signal's alpha.
    """
    length, *variances = carried
    spread, last_spread, *smooth = smooth
    if other:
        *smooth, excess, wide_other = smooth
        better = excess < 0
        innovation = [*innovation[:-1], dr.select(better, other[0], innovation[-1])]
        smooth[-1] = dr.select(better, wide_other, smooth[-1])
        variances[-1] = dr.select(better, other[1], variances[-1])
        energies = [*energies[:-1], dr.maximum(energies[-1] + dr.minimum(excess, 0), 0)]
    least, doubt, sharp, renewal, frames, *alphas = numbers
    new = length < 1.5
    first = spatial_variances(stencil, sizes, signal, new, guides)
    values, at = [], 0
    for s, size in enumerate(sizes):
        a = dr.maximum(1 / length, alphas[s])
        e, wide = innovation[at:at + size], smooth[at:at + size]
        follow = sharp
        if s == 0:
            follow = dr.maximum(_certainty(spread, wide[luma(size)], doubt), least)
        elif size == 1:
            certain = _certainty(last_spread, wide[luma(size)], doubt)
            a, follow = dr.maximum(a, renewal * certain), dr.maximum(certain, sharp)
        follow = dr.maximum(follow, a)
        values += [dr.fma(follow - a, y, dr.fma(a - 1, x, d))
                   for d, x, y in zip(signal[at:at + size], e, wide)]
        noise = dr.select(new, first[s], dr.maximum(energies[s] - variances[s],
                                                    energies[s] * LEAST_NOISE))
        values.append(dr.fma(dr.square(1 - a), variances[s], dr.square(a) * noise))
        at += size
    return values, [_fade_out(length, frames)]


def _certainty(spread: Float, wide: Float, doubt: Float) -> Float:
    """1 - k Q / l(S[e])^2."""
    return 1 - doubt * spread / dr.maximum(dr.square(wide), _LEAST)


def spatial_variances(stencil: Stencil, sizes: tuple[int, ...], signal: list[Float], wanted: Any,
                      guides: list[Float]) -> list[Float]:
    """Variance of each signal's luminance where `wanted`, from one frame.

    Mean square of what a 3x3 smoothing over the surface takes away, around the 3x3 pixels of the
    middle, over the share that it would take of white noise. An edge of light leaves less in it
    than in the variance of the window.
    """
    starts = [sum(sizes[:s]) for s in range(len(sizes))]
    lum = [signal[start + luma(size)] for start, size in zip(starts, sizes)]
    inverse_depth, gx, gy, scale = guides
    table = tabulate(stencil, [inverse_depth, *lum])
    dr.eval(table)
    around = window_taps(stencil, RADIUS, table)

    def mean_square(_: Any) -> tuple[Float, list[Float]]:
        near, values = {}, {}
        for i, at in enumerate(product(range(-RADIUS, RADIUS + 1), repeat=2)):
            inside, dy, dx, (tap_inverse_depth, *luminances) = around(i)
            expected = dr.fma(gx, dx, dr.fma(gy, dy, inverse_depth))
            near[at] = inside & (dr.abs(tap_inverse_depth - expected) * scale < 1)
            values[at] = luminances[:len(lum)]
        count, sums = stencil.Float(0), [stencil.Float(0)] * len(lum)
        for cy, cx in product(range(1 - RADIUS, RADIUS), repeat=2):
            total, squares, *means = [stencil.Float(0)] * (2 + len(lum))
            for dy, dx in product((-1, 0, 1), repeat=2):
                at = cy + dy, cx + dx
                h = dr.select(near[at], stencil.Float(BINOMIAL[abs(dy)] * BINOMIAL[abs(dx)]), 0)
                total, squares = total + h, dr.fma(h, h, squares)
                means = [dr.fma(h, v, m) for v, m in zip(values[at], means)]
            norm = 1 / dr.maximum(total, 1e-6)
            share = 1 - 2 * BINOMIAL[0]**2 * norm + squares * norm * norm
            counts = near[cy, cx] & (share > 0.1)
            scaled = 1 / dr.maximum(share, 0.1)
            count += dr.select(counts, stencil.Float(1), 0)
            sums = [s + dr.select(counts, dr.square(v - m * norm) * scaled, 0)
                    for s, v, m in zip(sums, values[cy, cx], means)]
        norm = 1 / dr.maximum(count, 1)
        return stencil.Float(1), [s * norm for s in sums]

    _, variances = weighted_sums(stencil, wanted, 1, len(lum), mean_square)
    return [dr.minimum(v, _MOST) for v in variances]


def guided_level(sizes: tuple[int, ...], fading: tuple[bool, ...], values: Taps,
                 surfaces: Taps, plane: list[Float], spacing: list[Float], weaker: list[Float],
                 sigmas: list[Float]) -> list[Float]:
    """One level of the last filter over the signals of these sizes, each with its variance.

    Args:
        values: planes, a signal's and its variance each. fading: which signals' taps get weaker
            by the first of `weaker`; the second, if any, is `narrowness` of visibility.
            sigmas: sqrt(log2(e)) / sigma of each signal. Others as of `smooth_level`.
    """
    exponent = surface_exponent(surfaces, plane, *spacing)
    center, h0 = values.at(-1), BINOMIAL[0]**2
    starts = [sum(sizes[:s]) + s for s in range(len(sizes))]
    sums = [v * h0 for v in center]
    for start, size in zip(starts, sizes):
        sums[start + size] = center[start + size] * h0**2
    scales = [sigma / (dr.sqrt(center[start + size]) + EPSILON)
              for start, size, sigma in zip(starts, sizes, sigmas)]
    totals = [type(plane[0])(h0) for _ in sizes]
    fade, *narrow = weaker
    near = narrowing(narrow, *spacing)
    for i, offset in enumerate(window(1)):
        tap, e = values.at(i), exponent(i, offset)
        for s, (start, size) in enumerate(zip(starts, sizes)):
            at = start + luma(size)
            distance = (tap[at] - center[at]) * scales[s]
            x = dr.fma(distance, -distance, e)
            if size == 1:
                x = near(x, offset)
            w = exp2(x + fade if fading[s] else x)
            totals[s] += w
            for c in range(start, start + size):
                sums[c] = dr.fma(w, tap[c], sums[c])
            sums[start + size] = dr.fma(w * w, tap[start + size], sums[start + size])
        values.next()
    for s, (start, size) in enumerate(zip(starts, sizes)):
        norm = 1 / totals[s]
        for c in range(start, start + size):
            sums[c] *= norm
        sums[start + size] *= dr.square(norm)
    return sums


def _fade_out(length: Float, frames: Float) -> Float:
    """log2 of 1 - (n - 1) / frames, which falls from 1 to 0."""
    left = 1 - (length - 1) / frames
    return dr.select(left > 1e-6, dr.log2(dr.maximum(left, 1e-6)), _NEVER)
