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

# pyright: standard
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any, NamedTuple

import drjit as dr

from onespp.denoise.filters.penumbra import footprint_falloff
from onespp.denoise.history.records import look_up, pack_records
from onespp.denoise.history.reprojection import Motion, ReprojectionTests, locate
from onespp.denoise.history.shadow_motion import MIN_SHARE, Shadows, look_up_shadow
from onespp.denoise.inputs.signals import Signal, SignalKind
from onespp.denoise.inputs.surface import SurfaceSample, TangentPlane
from onespp.denoise.jit.arrays import Bool, Float
from onespp.denoise.jit.fastmath import exp2
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.masked import tabulate, weighted_sums, window_taps
from onespp.denoise.jit.structure import mapped
from onespp.denoise.jit.taps import Offset, Taps, window
from onespp.denoise.methods.atrous import EPSILON, LOG2E

from .layout import History, NoisySignal, PlaneRule, SignalLayout, Smoothed

BINOMIAL = {0: 1 / 2, 1: 1 / 4}
MIN_NOISE = 0.25               # share of the innovation's energy that is at least noise of d
OTHER_OBJECT_WEIGHT = 0.4      # of a pixel of another object, beside its distance
RADIUS = 2                     # pixels, of the window of the spatial variance
_NEVER = -1e3                  # log2 of a weight that is 0
_NO_HISTORY = -3e14            # 1/z of a pixel without history
_MAX_ENERGY = 1e36             # squares of luminance stay below: sums of them must not overflow
_MIN_ENERGY = 1e-20            # square of a luminance that is taken for 0


class ShadowInnovation(NamedTuple):
    """Visibility's innovation from its shadow history, that history's variance, and how much
    greater the square of the innovation is than that of the other one."""

    innovation: Float
    variance: Float
    excess: Float


class Innovations(NamedTuple):
    """What a frame's signals say that their history does not.

    Attributes:
        signals: e of each signal, 0 without history. energies: l(e)^2 of each.
        length: n, 1 without history. variances: s^2 of each signal's history.
        valid_inverse_depth: 1/z, far away without history.
        shadow: of visibility's other history. footprint_falloff: of `penumbra.py`.
            None without shadow rays, both.
    """

    signals: list[Signal]
    energies: list[Float]
    length: Float
    variances: list[Float]
    valid_inverse_depth: Float
    shadow: ShadowInnovation | None
    footprint_falloff: Float | None


class Gains(NamedTuple):
    """How history follows.

    Attributes:
        alphas: of each signal. min_gain: g. noise_threshold: k. sharp_min_gain: g'.
        change_alpha: r. fade_frames: until the last filter has faded.
    """

    alphas: list[Float]
    min_gain: Float
    noise_threshold: Float
    sharp_min_gain: Float
    change_alpha: Float
    fade_frames: Float


class Merged(NamedTuple):
    """The new history of each signal, and `fade_out`."""

    signals: list[NoisySignal]
    fade: Float


class SurfaceTap(NamedTuple):
    """What a tap is weighed by: 1/z, far away where the pixel does not count, and object ID."""

    inverse_depth: Float
    id: Float


def innovations(stencil: Stencil, layout: SignalLayout, signals: list[Signal],
                surface: SurfaceSample, plane: TangentPlane, motion: Motion, records: Float,
                shadows: Shadows | None, tests: ReprojectionTests, max_history_length: Float,
                falloff_scale: Float) -> Innovations:
    """The innovation of each signal.

    Args:
        motion: of `motion_between`. records: of `pack_history`.
        shadows: of `follow_shadows`, smoothed. falloff_scale: of `penumbra.footprint_falloff`.
    """
    place = locate(stencil, surface, motion, tests.plane_tolerance)
    words, is_valid = look_up(stencil, place, records, layout.record_values, tests.min_cosine)
    length, history = layout.unpack(words)
    e = [mapped(lambda d, h: dr.select(is_valid, d - h, 0), signal, old.signal)
         for signal, old in zip(signals, history, strict=True)]
    energies = [dr.minimum(dr.square(s.luminance), _MAX_ENERGY) for s in e]
    variances = [old.variance for old in history]
    length = dr.select(is_valid, dr.minimum(length + 1, max_history_length), 1)
    valid_inverse_depth = dr.select(is_valid, plane.inverse_depth, _NO_HISTORY)
    if shadows is None:
        return Innovations(e, energies, length, variances, valid_inverse_depth, None, None)
    visibility, variance, moves = look_up_shadow(stencil, surface, plane, motion, records,
                                                 shadows.motion, tests)
    moves &= is_valid
    other = dr.select(moves, signals[-1].luminance - visibility, e[-1].luminance)
    shadow = ShadowInnovation(other, dr.select(moves, variance, variances[-1]),
                              dr.square(other) - energies[-1])
    return Innovations(e, energies, length, variances, valid_inverse_depth, shadow,
                       footprint_falloff(shadows.penumbra, falloff_scale, MIN_SHARE))


def to_smooth(layout: SignalLayout, found: Innovations) -> Smoothed:
    """What is smoothed of the innovation."""
    has_visibility = SignalKind.VISIBILITY in layout.kinds
    diffuse, *sharp = found.signals
    return Smoothed(
        diffuse_spread=found.energies[0], diffuse=diffuse,
        excess=found.shadow.excess if found.shadow else None,
        visibility_spread=found.energies[-1] if has_visibility else None, sharp=sharp,
        shadow_innovation=found.shadow.innovation if found.shadow else None,
        energies=found.energies)


def pack_history(stencil: Stencil, layout: SignalLayout, surface: SurfaceSample,
                 history: History) -> Float:
    """Records of a frame."""
    return pack_records(stencil, surface, layout.pack(history))


def smooth_level(rules: Sequence[PlaneRule], values: Taps[list[Float]], surfaces: Taps[SurfaceTap],
                 plane: TangentPlane, spacing: Float,
                 falloff: Float | None = None) -> list[Float]:
    """One level of S, and of Q. The last tap is the pixel itself.

    Args:
        rules: of each plane in `values`. spacing: pixels between taps.
        falloff: `penumbra.footprint_falloff`, for planes that are `within_penumbra`.
    """
    exponent, nearer = surface_exponent(surfaces, plane, spacing), footprint(falloff, spacing)
    h0 = BINOMIAL[0]**2

    def each(wide: Any, within_penumbra: Any) -> list[Any]:
        """The factor of each plane, of the plane ones and of those within the penumbra."""
        factors = [within_penumbra if rule.within_penumbra else wide for rule in rules]
        return [dr.square(f) if rule.squared else f for f, rule in zip(factors, rules)]

    totals = [type(plane.dx)(h0)] * 2
    sums = [f * v for f, v in zip(each(h0, h0), values.at(-1), strict=True)]
    for i, offset in enumerate(window(1)):
        x = exponent(i, offset)
        weights = exp2(x), exp2(nearer(x, offset))
        sums = [dr.fma(w, v, s) for w, v, s in zip(each(*weights), values.at(i), sums)]
        totals = [t + w for t, w in zip(totals, weights)]
        values.next()
    return [f * s for f, s in zip(each(*[1 / total for total in totals]), sums)]


def footprint(falloff: Float | None, spacing: Float) -> Callable[[Float, Offset], Float]:
    """Function of (x, offset): log2 x of a weight, less the more the farther a tap is.

    falloff: `penumbra.footprint_falloff`, or None, which takes nothing off.
    """
    if falloff is None:
        return lambda x, _: x
    rate = falloff * dr.square(spacing)
    return lambda x, offset: dr.fma(rate, -float(offset[0]**2 + offset[1]**2), x)


def surface_exponent(surfaces: Taps[SurfaceTap], plane: TangentPlane,
                     spacing: Float) -> Callable[[int, Offset], Float]:
    """Function of (tap, offset): log2 of h times the weight of the distance from p's plane, and
    of being another object."""
    dx_, dy_, scale = plane.dx * spacing, plane.dy * spacing, plane.scale * LOG2E
    center = surfaces.at(-1)

    def exponent(i: int, offset: Offset) -> Float:
        dy, dx = offset
        tap = surfaces.at(i)
        expected = dr.fma(dx_, float(dx), dr.fma(dy_, float(dy), center.inverse_depth))
        log2_h = math.log2(BINOMIAL[abs(dy)] * BINOMIAL[abs(dx)])
        same = dr.select(tap.id == center.id, type(scale)(log2_h),
                         log2_h + math.log2(OTHER_OBJECT_WEIGHT))
        return dr.fma(dr.abs(tap.inverse_depth - expected), -scale, same)

    return exponent


def merge(stencil: Stencil, layout: SignalLayout, signals: list[Signal], found: Innovations,
          smoothed: Smoothed, plane: TangentPlane, gains: Gains) -> Merged:
    """The new history, and how the last filter fades out with it."""
    if found.shadow is not None:
        found, smoothed = _choose_history(found, found.shadow, smoothed)
    is_new = found.length < 1.5
    spatial = spatial_variances(stencil, signals, is_new, plane)
    merged = []
    for s, (kind, signal) in enumerate(zip(layout.kinds, signals, strict=True)):
        e, wide = found.signals[s], [smoothed.diffuse, *smoothed.sharp][s]
        a, gain = dr.maximum(1 / found.length, gains.alphas[s]), gains.sharp_min_gain
        if kind is SignalKind.DIFFUSE:
            gain = dr.maximum(_certainty(smoothed.diffuse_spread, wide, gains), gains.min_gain)
        elif kind is SignalKind.VISIBILITY:
            assert smoothed.visibility_spread is not None
            certain = _certainty(smoothed.visibility_spread, wide, gains)
            a = dr.maximum(a, gains.change_alpha * certain)
            gain = dr.maximum(certain, gains.sharp_min_gain)
        gain = dr.maximum(gain, a)
        merged_signal = mapped(_merged(gain, a), signal, e, wide)
        energy, variance = smoothed.energies[s], found.variances[s]
        noise = dr.select(is_new, spatial[s], dr.maximum(energy - variance, energy * MIN_NOISE))
        merged.append(NoisySignal(merged_signal, dr.fma(dr.square(1 - a), variance,
                                                        dr.square(a) * noise)))
    return Merged(merged, fade_out(found.length, gains.fade_frames))


def _merged(gain: Float, a: Float) -> Callable[[Float, Float, Float], Float]:
    """Function of (d, e, S[e])."""
    return lambda d, e, wide: dr.fma(gain - a, wide, dr.fma(a - 1, e, d))


def _choose_history(found: Innovations, shadow: ShadowInnovation,
                    smoothed: Smoothed) -> tuple[Innovations, Smoothed]:
    """With the shadow history of visibility in the place of the other one, where it is better."""
    excess, energy, shadow_wide = smoothed.excess, smoothed.energies[-1], smoothed.shadow_innovation
    assert excess is not None
    assert shadow_wide is not None
    better = excess < 0
    e, wide = found.signals[-1], smoothed.sharp[-1]
    e = e._replace(luminance=dr.select(better, shadow.innovation, e.luminance))
    wide = wide._replace(luminance=dr.select(better, shadow_wide, wide.luminance))
    variance = dr.select(better, shadow.variance, found.variances[-1])
    energy = dr.maximum(energy + dr.minimum(excess, 0), 0)
    return (found._replace(signals=[*found.signals[:-1], e],
                           variances=[*found.variances[:-1], variance]),
            smoothed._replace(sharp=[*smoothed.sharp[:-1], wide],
                              energies=[*smoothed.energies[:-1], energy]))


def _certainty(spread: Float, wide: Signal, gains: Gains) -> Float:
    """c = 1 - k Q / l(S[e])^2."""
    return 1 - gains.noise_threshold * spread / dr.maximum(dr.square(wide.luminance), _MIN_ENERGY)


def spatial_variances(stencil: Stencil, signals: list[Signal], active: Bool,
                      plane: TangentPlane) -> list[Float]:
    """Variance of each signal's luminance where `active`, from one frame.

    Mean square of what a 3x3 smoothing over the surface takes away, around the 3x3 pixels of the
    middle, over the share that it would take of white noise. An edge of light leaves less in it
    than in the variance of the window.
    """
    lum = [signal.luminance for signal in signals]
    table = tabulate(stencil, [plane.inverse_depth, *lum])
    dr.eval(table)
    around = window_taps(stencil, RADIUS, table)

    def mean_square(_: Any) -> tuple[Float, list[Float]]:
        near, values = {}, {}
        for i, at in enumerate(product(range(-RADIUS, RADIUS + 1), repeat=2)):
            inside, dy, dx, (tap_inverse_depth, *luminances) = around(i)
            expected = dr.fma(plane.dx, dx, dr.fma(plane.dy, dy, plane.inverse_depth))
            near[at] = inside & (dr.abs(tap_inverse_depth - expected) * plane.scale < 1)
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

    _, variances = weighted_sums(stencil, active, 1, len(lum), mean_square)
    return [dr.minimum(v, _MAX_ENERGY) for v in variances]


class OutputFalloff(NamedTuple):
    """What weakens the taps of the last filter: `fade_out` of its last level, and visibility's
    `penumbra.footprint_falloff`, None without shadow rays."""

    fade: Float
    footprint: Float | None


def output_level(layout: SignalLayout, level: int, values: Taps[list[NoisySignal]],
                 surfaces: Taps[SurfaceTap], plane: TangentPlane, spacing: Float,
                 falloff: OutputFalloff, sigmas: list[Float]) -> list[NoisySignal]:
    """One level of the last filter. The last tap is the pixel itself.

    Args:
        values: the signals that are left at this level.
        sigmas: sqrt(log2(e)) / sigma of each signal. Others as of `smooth_level`.
    """
    exponent = surface_exponent(surfaces, plane, spacing)
    nearer, h0 = footprint(falloff.footprint, spacing), BINOMIAL[0]**2
    kinds, center = layout.output_level(level), values.at(-1)
    sums = [NoisySignal(mapped(lambda v: v * h0, c.signal), c.variance * h0**2) for c in center]
    scales = [sigma / (dr.sqrt(c.variance) + EPSILON) for c, sigma in zip(center, sigmas)]
    totals = [type(plane.dx)(h0) for _ in kinds]
    for i, offset in enumerate(window(1)):
        taps, surface_x = values.at(i), exponent(i, offset)
        for s, (kind, tap) in enumerate(zip(kinds, taps, strict=True)):
            distance = (tap.signal.luminance - center[s].signal.luminance) * scales[s]
            x = dr.fma(distance, -distance, surface_x)
            if kind is SignalKind.VISIBILITY:
                x = nearer(x, offset)
            w = exp2(x + falloff.fade if layout.is_last_level(kind, level) else x)
            totals[s] += w
            sums[s] = NoisySignal(mapped(_weighted(w), tap.signal, sums[s].signal),
                                  dr.fma(w * w, tap.variance, sums[s].variance))
        values.next()
    norms = [1 / total for total in totals]
    return [NoisySignal(mapped(_times(norm), noisy.signal), noisy.variance * dr.square(norm))
            for noisy, norm in zip(sums, norms)]


def _weighted(w: Float) -> Callable[[Float, Float], Float]:
    """Function of (tap, sum)."""
    return lambda tap, total: dr.fma(w, tap, total)


def _times(factor: Float) -> Callable[[Float], Float]:
    return lambda value: value * factor


def fade_out(length: Float, frames: Float) -> Float:
    """log2 of 1 - (n - 1) / frames, which falls from 1 to 0."""
    left = 1 - (length - 1) / frames
    return dr.select(left > 1e-6, dr.log2(dr.maximum(left, 1e-6)), _NEVER)
