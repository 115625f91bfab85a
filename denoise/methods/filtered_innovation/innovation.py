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

    diffuse light, whose changes are slow        f = max(c, g L / (L + Q)),  L = (b l(h + S[e]))^2
    glossy light                                 f = g'' + u (1 - g''),
                                                 a = max(1 / n, alpha, t, u / 2)
    visibility, whose changes have sharp edges   f = max(c, g'),  a = max(1 / n, alpha, r c)

Light that changes by b of itself, seen with the variance Q, is followed best by L / (L + Q) of
that (Wiener 1949): where few rays bring much of it, as by way of glass, S[e] is mostly noise. g''
is two thirds of that where mirror directions stand still; u is above 0 where what they show moves
itself (t, and four times the mean of u, of `reflections.py`). g' is two fifths where neither the
shadow, by `shadow_motion.py`, nor the surface moves: near a contact S is narrow, and would bring
its noise into a shadow that stands still. Where lights move, light changes everywhere: with m twice
the share of shadow rays that went to such, at most 1, g becomes g + m (1 - g), b / (1 - m) and
k (1 - m / 2), and g' grows to 9/10. Where nothing moves, but the camera, and lights are known to be
as they were (`inputs/light_change.py`), g is half of that. Where lights are known to have changed,
all alike, h of diffuse and glossy light has changed with them before it is compared; by what else
they have changed at once, n is less (`change.py`).

    s^2 <- (1 - a)^2 s^2 + a^2 s_0^2,   s_0^2 = max(W[l(e)^2] - s^2, W[l(e)^2] / 4)

with W the first `ENERGY_LEVELS` levels of S: unlike the variance of d in a window, that of e has
no shadow's edge in it that stands still. Without history s_0^2 comes from what a small smoothing
takes out of l(d): `spatial_variances`; so it does, if that is less than W, where a change leaves
little of n (`change.py`), and of glossy light where a mirror direction has turned by more than half
a lobe (t, `reflections.py`).

Visibility has two histories, where the surface was and where its shadow was: `shadow_motion.py`.
Where the latter is taken, W is less by as much as its e^2 is, smoothed, and at least 0.

Of groups of lights a pixel's ray tells of one, y with the weight omega (`resampling.py`): signals
are *sparse*. Their innovation is e = y - omega h, 0 where the ray went elsewhere; a smoothing is
a ratio of sums, S[e] / S[omega], without noise of which light was picked. History takes

    h <- h + f S[e] / S[omega] + a (e - omega S[e] / S[omega]),   a = max(1 / (N + 1/2), ...),

N being the sum of omega over its frames, this one included; f is at least 1 less N without it. The
noise of a sample is that of a coin, s_0^2 = v (1 - v), v = h + S[e] / S[omega], and which history
is the right one is told before the smoothing by excess over fewer pixels (`passes.py`). In the last
filter a pixel counts by what its history holds, min(N, 1), and one that has had no ray yet keeps
what the filter found.

A smoothing is a-trous levels of 3x3 taps, h = {1/4, 1/2, 1/4}^2, 2^i pixels apart. The last filter
of h compares luminance too,

    w = h exp(-distance(q, p's plane) / (plane_pixels width(p)) - ((l(p) - l(q)) / (sigma s))^2)

sigma being less for glossy light the narrower its lobe is, down to a mirror's at roughness 0, and
the last level of other light fades out as the history grows. A pixel of another object counts for
two fifths. In scenes with glossy surfaces light has no rare bright pixels before it, nor glossy
light of the surface itself before it is compared with history: `peaks.py`.
Visibility is filtered no farther than shadows are soft, and so are its e and Q: `penumbra.py`. The
last filter of other light is narrower where other surfaces are close: `contact.py`, that of glossy
light on bent surfaces: `bent.py`.
Where neither history nor neighbours can know, a pixel's own rays decide: in slits and hard shadows
(the same two), and at silhouettes whose normal faces away: `facing_away.py`.
Normals are not compared: where they differ much the tangent plane is soon left, and at a crease, or
on a leaf, a neighbour turned away is a better guess than one sample (+0.2 to 0.9 dB for
normal_power 0 instead of 4 and 128).

Our own, from a trial; the nearest published relatives are the fast and slow histories of NRD and
the gradients of A-SVGF (Schied et al. 2018).
"""

# pyright: standard
from __future__ import annotations

from typing import NamedTuple

import drjit as dr

from onespp.denoise.filters.contact import Contact
from onespp.denoise.filters.penumbra import footprint_falloffs
from onespp.denoise.history.records import look_up, pack_records, record_words
from onespp.denoise.history.reflections import Lobes, image_turned, turned
from onespp.denoise.history.reprojection import Motion, Place, ReprojectionTests, locate
from onespp.denoise.history.shadow_motion import (
    MIN_MOTION,
    MIN_SHARE,
    look_up_shadow,
    shadow_unrest,
)
from onespp.denoise.inputs.signals import Chosen, Signal
from onespp.denoise.inputs.surface import SurfaceSample, TangentPlane
from onespp.denoise.jit.arrays import Float, Vector3
from onespp.denoise.jit.color import LUMINANCE
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import mapped
from onespp.denoise.jit.vector import dot

from .layout import LUMINANCE_PLACE, History, NoisySignal, SignalLayout, Smoothed
from .noise import MAX_ENERGY, spatial_variances
from .output import FEWEST_SAMPLES
from .shadows import Shadows, Surroundings
from .texture import AtRest, FromHistory, choose, found_at_rest, missed

_TIE = 1e-6                    # excess of a history that is no better nor worse
_NO_HISTORY = -3e14            # 1/z of a pixel without history
_NEW = 1.5                     # n below which there is none
NARROW_LOBE = 0.2              # roughness below which lobes meet lamps by rare chance


class ShadowInnovation(NamedTuple):
    """Visibility's innovation from its shadow history, that history and its variance, and how much
    greater the square of the innovation is than that of the other one."""

    innovation: Float
    history: Float
    variance: Float
    excess: Float


class SparseHistory(NamedTuple):
    """Of a sparse signal: omega, 0 without history; h, and N without this frame."""

    weight: Float
    history: Float
    samples: Float


class Innovations(NamedTuple):
    """What a frame's signals say that their history does not.

    Attributes:
        signals: e of each signal, 0 without history. energies: l(e)^2 of each.
        lengths: n, see `SignalLayout.length`, 1 without history.
        variances: s^2 of each signal's history.
        valid_inverse_depth: 1/z, far away without history.
        shadows: of the other history of each visibility that has one. footprint_falloffs: of
            `penumbra.py`, of each of those. sparse: of each sparse signal. turned: t of
            `reflections.py`, None where the lobes of glossy light are not known.
        image_turned: how much of what lobes reflect has moved itself, of that module; None without
            shadow rays, too.
        unrest: how much each visibility that shadow rays tell of may have changed by motion, 0
            where its shadow and its surface stand still on the screen, to 1.
        rests: 1 where the surface is at rest in the world, else 0.
        contact: of `contact.contact_falloff`, None where there are no shadow rays.
        misses: what reprojection may miss of texture, see `texture.py`; at_rest: of that module;
            spatial: of `noise.py`, of such light.
    """

    signals: list[Signal]
    energies: list[Float]
    lengths: list[Float]
    variances: list[Float]
    valid_inverse_depth: Float
    shadows: list[ShadowInnovation]
    footprint_falloffs: list[Float]
    sparse: list[SparseHistory]
    turned: Float | None
    image_turned: Float | None
    unrest: list[Float]
    rests: Float
    misses: Float | None = None
    at_rest: AtRest | None = None
    spatial: Float | None = None
    contact: Contact | None = None


def find_innovations(stencil: Stencil, layout: SignalLayout, signals: list[Signal],
                     chosen: Chosen | None, surface: SurfaceSample, plane: TangentPlane,
                     motion: Motion, records: Float, around: Surroundings, image: Float | None,
                     tests: ReprojectionTests, max_history_length: Float,
                     falloff_scale: Float, lobes: Lobes | None,
                     rest: Motion | None, ratio: Vector3) -> Innovations:
    """The innovation of each signal.

    Args:
        motion: of `motion_between`. records: of `pack_history`.
        around: of `look_around`, smoothed. image: of that, of the previous frame.
        falloff_scale: of `penumbra.footprint_falloff`.
        lobes: of `reflections.lobes_between`. rest: of `texture.at_rest_between`.
        ratio: of `inputs/light_change.py`, red, green and blue.
    """
    place = locate(stencil, surface, motion, tests.plane_tolerance)
    record_words_ = record_words(layout.record_values)
    words, is_valid, scatter = look_up(
        stencil, place, records, layout.record_values, tests.min_cosine, words=record_words_,
        scattered=LUMINANCE_PLACE if layout.has_texture else None)
    lengths, history = layout.unpack(words)
    history = [_brought_up_to_date(old, ratio) for old in history]
    omegas = weights_of(layout, chosen)
    e, sparse = [], []
    for signal, old, omega in zip(signals, history, omegas, strict=True):
        if omega is None:
            e.append(mapped(lambda d, h: dr.select(is_valid, d - h, 0), signal, old.signal))
            continue
        assert old.samples is not None
        h = old.signal.luminance
        e.append(Signal(None, dr.select(is_valid, dr.fma(-omega, h, signal.luminance), 0), None))
        sparse.append(SparseHistory(dr.select(is_valid, omega, 0), h,
                                    dr.select(is_valid, old.samples, 0)))
    energies = [dr.minimum(dr.square(s.luminance), MAX_ENERGY) for s in e]
    variances = [old.variance for old in history]
    lengths = [dr.select(is_valid, dr.minimum(n + 1, max_history_length), 1) for n in lengths]
    valid_inverse_depth = dr.select(is_valid, plane.inverse_depth, _NO_HISTORY)
    misses, at_rest, spatial = None, None, None
    if scatter is not None:
        misses = missed(scatter, variances[0])
        (spatial,) = spatial_variances(stencil, signals, is_valid | ~is_valid, plane, [])
    if misses is not None and rest is not None:
        there = locate(stencil, surface, rest, tests.plane_tolerance)
        moves = is_valid & (dr.abs(there.x - place.x) + dr.abs(there.y - place.y) > MIN_MOTION)
        other = look_up(stencil, there, records, layout.record_values, tests.min_cosine,
                        active=moves, words=record_words_, scattered=LUMINANCE_PLACE)
        found = FromHistory(e[0], variances[0], lengths[0], misses)
        at_rest = found_at_rest(layout, signals[0], other, found, max_history_length, moves,
                                1 - dot(place.normal, there.normal))
    others, shadows = [], around.shadows
    for f, shadow in enumerate(shadows):
        s = len(signals) - len(shadows) + f
        visibility, variance, moves = look_up_shadow(
            stencil, surface, plane, motion, records, shadow.motion, tests,
            layout.record_place(s), record_words_)
        moves &= is_valid
        omega = omegas[s]
        there = visibility if omega is None else omega * visibility
        other = dr.select(moves, signals[s].luminance - there, e[s].luminance)
        others.append(ShadowInnovation(
            other, dr.select(moves, visibility, history[s].signal.luminance),
            dr.select(moves, variance, variances[s]), dr.square(other) - energies[s]))
    penumbras = [shadow.penumbra for shadow in shadows]
    return Innovations(e, energies, lengths, variances, valid_inverse_depth, others,
                       footprint_falloffs(penumbras, falloff_scale, MIN_SHARE), sparse,
                       None if lobes is None else turned(lobes, surface.normal, place),
                       None if around.image is None or image is None
                       else image_turned(stencil, around.image, image, place),
                       _unrest(stencil, shadows, place), place.rests, misses, at_rest, spatial,
                       mapped(lambda near: falloff_scale * near, around.contact))


def seen_twice(signals: list[Signal], innovations: list[Signal], length: Float) -> list[Float]:
    """The lesser luminance of frame and history of each, 0 without one; length: n before a change.
    """
    return [dr.select(length < _NEW, 0, dr.minimum(d.luminance, d.luminance - e.luminance))
            for d, e in zip(signals, innovations, strict=True)]


def seen_twice_by_narrow_lobes(signals: list[Signal], innovations: list[Signal], length: Float,
                               roughness: Float) -> list[Float]:
    """`seen_twice`; of lobes that are not narrow more than can be."""
    return [dr.select(roughness < NARROW_LOBE, both, MAX_ENERGY)
            for both in seen_twice(signals, innovations, length)]


def renewed(before: list[Signal], after: list[Signal], innovations: list[Signal],
            length: Float) -> tuple[list[Signal], list[Float]]:
    """Innovations of signals that were changed, and l(e)^2; length: as of `seen_twice`."""
    news = [mapped(lambda b, a, e: dr.select(length < _NEW, e, e + (a - b)), *one)
            for one in zip(before, after, innovations, strict=True)]
    return news, [dr.minimum(dr.square(e.luminance), MAX_ENERGY) for e in news]


def _brought_up_to_date(old: NoisySignal, ratio: Vector3) -> NoisySignal:
    """History in the light of today: that of visibility is as it was."""
    red, luminance_, blue = old.signal
    if red is None or blue is None:
        return old
    r, g, b = LUMINANCE
    more = dr.fma((ratio.x - ratio.y) * r, red, (ratio.z - ratio.y) * b * blue)
    whole = dr.fma(ratio.x, r, dr.fma(ratio.y, g, ratio.z * b))
    signal = Signal(ratio.x * red, dr.fma(ratio.y, luminance_, more), ratio.z * blue)
    return old._replace(signal=signal, variance=old.variance * dr.square(whole))


def _unrest(stencil: Stencil, shadows: list[Shadows], place: Place) -> list[Float]:
    """Of each visibility; a surface that moves by less than a pixel is between rest and motion."""
    row, column = stencil.pixel()
    shift = (dr.abs(place.x - (stencil.Float(column) + 0.5))
             + dr.abs(place.y - (stencil.Float(row) + 0.5)))
    shift = dr.select(shift > MIN_MOTION, dr.minimum(shift, 1), 0)
    return [dr.maximum(shift, shadow_unrest(shadow.rests, shadow.penumbra.blocked))
            for shadow in shadows]


def choose_histories(layout: SignalLayout, innovations: Innovations,
                     excess: list[Float]) -> Innovations:
    """With its shadow history in the place of the other one where that of a sparse signal is
    better, or that of the place where that of light with texture is; excess: of each, smoothed."""
    if innovations.at_rest is not None:
        e, variance, length, misses = choose(innovations.at_rest, excess[0])
        energy = dr.minimum(dr.square(e.luminance), MAX_ENERGY)
        return innovations._replace(signals=[e], energies=[energy], lengths=[length],
                                    variances=[variance], misses=misses, at_rest=None)
    signals, energies = list(innovations.signals), list(innovations.energies)
    variances, sparse = list(innovations.variances), list(innovations.sparse)
    for g, (shadow, more) in enumerate(zip(innovations.shadows, excess, strict=True)):
        s, better = len(layout.kinds) - layout.groups + g, more < -_TIE
        e = dr.select(better, shadow.innovation, signals[s].luminance)
        signals[s], energies[s] = Signal(None, e, None), dr.minimum(dr.square(e), MAX_ENERGY)
        variances[s] = dr.select(better, shadow.variance, variances[s])
        sparse[g] = sparse[g]._replace(
            history=dr.select(better, shadow.history, sparse[g].history))
    return innovations._replace(signals=signals, energies=energies, variances=variances,
                                sparse=sparse, shadows=[])


def weights_of(layout: SignalLayout, chosen: Chosen | None) -> list[Float | None]:
    """omega of each signal that is sparse."""
    weights: list[Float | None] = []
    for s in range(len(layout.kinds)):
        g = layout.group(s)
        weights.append(None if g is None or chosen is None
                       else dr.select(chosen.group == g, chosen.weight, 0))
    return weights


def to_smooth(layout: SignalLayout, innovations: Innovations) -> Smoothed:
    """What is smoothed of the innovation."""
    diffuse, *sharp = innovations.signals
    dense = len(layout.kinds) - layout.groups
    return Smoothed(
        diffuse_spread=innovations.energies[0], diffuse=diffuse,
        excess=[shadow.excess for shadow in innovations.shadows],
        visibility_spread=[innovations.energies[s] for s in layout.visibilities], sharp=sharp,
        shadow_innovation=[shadow.innovation for shadow in innovations.shadows],
        weights=[sparse.weight for sparse in innovations.sparse],
        energies=innovations.energies[:dense], misses=innovations.misses,
        spatial=innovations.spatial)


def pack_history(stencil: Stencil, layout: SignalLayout, surface: SurfaceSample, history: History,
                 filtered: list[Signal] | None) -> Float:
    """Records of a frame. A sparse signal that had no sample yet is what was filtered."""
    signals = list(history.signals)
    for s, noisy in enumerate(signals):
        if noisy.samples is not None and filtered is not None:
            signals[s] = noisy._replace(signal=Signal(None, dr.select(
                noisy.samples > FEWEST_SAMPLES, noisy.signal.luminance, filtered[s].luminance),
                None))
    return pack_records(stencil, surface, layout.pack(history._replace(signals=signals)))
