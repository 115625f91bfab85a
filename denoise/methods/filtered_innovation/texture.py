"""Light whose texture is not known: frames without albedo, as another renderer's may be.

Symbols: d, h, e, a, n, s^2, W of `innovation.py`; l luminance; F the last filter.

Without albedo, texture is in the light: it goes where the surface goes, and a filter takes it for
noise.

History of a texture is read between pixels, and what lies between them is not known. With w the
weights of the taps, which add up to 1,

    m = min(kappa W[sum w l(h_i)^2 - l(h)^2 - (1 - sum w^2) s^2]+, W[l(e)^2])

is how far the taps differ by more than their noise: the mean square of what reprojection misses.
What a mirror shows moves otherwise than it does. There a frame is smooth where history is not that
of it: with z the greater of the frame's own spatial variance (`noise.py`) and W of it, which d's
noise is not above,

    m <- max(m, W[l(e)^2] - s^2 - z),   s_0^2 <- min(max(W[l(e)^2] - s^2 - m, W[l(e)^2] / 4), z),

and a history that misses much is worth little:

    a <- max(a, m / (m + s_0^2)),   n <- min(n, 1 / a).

Where an object moves there is a second history, of what was seen of it where it is now: light
belongs to the place, as on a ball that turns, texture to the surface. With e' the innovation from
it, it is taken where

    S[e'^2 - q e^2] < 0,   q = 0.7 + 0.6 min((1 - cos) / (1 - cos 10 degrees), 1),

cos being of the angle by which the surface's normal has turned. Where it has not, the light that it
is in is hardly another, and to read between pixels, which is to smooth, makes a history seem better
than it is: so q < 1. Where it has turned the light is another, and only a texture that shows
through the noise is reason enough to stay with the surface.

Whether what F takes away is noise, the two frames say: noise of d and of h have nothing to do with
each other. With r_d = l(d - F d), r_h = l(h - F h), both by the weights of F of acc, and
r = l(acc - F acc), smoothed over pixels with a history, each by its weight u,

    out = F acc + c (acc - F acc),   c = clamp(S[u r_d r_h] / S[u r^2], 0, 1),
    u = 1 / (2 s^2 + r^2 + |r_d r_h|),

so that a texture too weak to be seen in a pixel is found in many, while a lone edge, u, does not
tell its surroundings to keep their noise. It is the Wiener filter of the residual, with the
spectrum taken from two measurements. They are not quite independent: F compares acc, of which both
are a part, and so r_d r_h is less than the texture's, by up to 0.4 s^2. It errs on the filter's
side, and to set it right loses up to 1 dB where there is little texture.

And the last filter compares luminance more narrowly (`texture_sigma`), the smoothing of the
innovation has a level less. What each is worth: docs/methods.md.

Our own; two buffers that tell noise from detail are from Rousselle et al. 2012, "Adaptive rendering
with non-local means filtering", and the Wiener filter of a residual is that of image restoration.
"""

# pyright: standard
from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import drjit as dr

from onespp.denoise.history.records import LookUp, Scatter
from onespp.denoise.history.reprojection import Motion, motion_between
from onespp.denoise.inputs.signals import Signal
from onespp.denoise.jit.arrays import Bool, Float
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import mapped
from onespp.render.frame import Frame

from .layout import NoisySignal, Pair, PlaneRule, SignalLayout

MISS = 2.5                     # kappa
LEVELS = 4                     # of the smoothings of the innovation and of residuals
RESIDUAL_RULES = (PlaneRule(LEVELS),) * 2
CHOICE_RULES = (PlaneRule(3),)
_BETTER, _TURNED = 0.7, 1.3    # share of e^2 that the place's history must be below
_TURN = 0.015                  # 1 - cos of the angle from which on an object has turned, 10 degrees
_EDGE = 2.0                    # s^2 from which on a residual counts less
_LEAST = 1e-12


class FromHistory(NamedTuple):
    """What a history says: e, and its s^2, n and m / kappa."""

    innovation: Signal
    variance: Float
    length: Float
    misses: Float


class AtRest(NamedTuple):
    """Both histories, of the surface and of the place, and by how much the latter's e^2 is above
    that of the former, less what it must be below."""

    surface: FromHistory
    place: FromHistory
    excess: Float


class Residual(NamedTuple):
    """u r_d r_h and u r^2, or means of these."""

    common: Float
    all: Float


def missed(scatter: Scatter, variance: Float) -> Float:
    """m / kappa of a pixel before W; may be below 0. variance: s^2 of its history."""
    return dr.fma(scatter.concentration - 1, variance, scatter.variance)


def at_rest_between(previous: Frame, current: Frame, stencil: Stencil) -> Motion | None:
    """Motion as if nothing but the camera moved; None where that is so, or motion is given."""
    if "motion" in current or len(previous.world_from_object) != len(current.world_from_object):
        return None
    still = replace(previous, world_from_object=current.world_from_object)
    return motion_between(still, current, stencil)


def found_at_rest(layout: SignalLayout, signal: Signal, other: LookUp, surface: FromHistory,
                  max_history_length: Float, moves: Bool, turn: Float) -> AtRest:
    """The histories to choose from; one where nothing moves.

    Args:
        signal: d. other: records where a pixel's place was, of `look_up`.
        surface: what the history of its surface says. moves: mask where there may be two.
        turn: 1 - cos of the angle by which its normal has turned.
    """
    assert other.scatter is not None
    (length,), (old,) = layout.unpack(other.values)
    moves = moves & other.is_valid
    e = mapped(lambda d, h, e: dr.select(moves, d - h, e), signal, old.signal, surface.innovation)
    place = FromHistory(e, old.variance, dr.minimum(length + 1, max_history_length),
                        missed(other.scatter, old.variance))
    share = dr.fma(dr.clip(turn * (1 / _TURN), 0, 1), _TURNED - _BETTER, _BETTER)
    excess = dr.fma(dr.square(surface.innovation.luminance), -share, dr.square(e.luminance))
    return AtRest(surface, mapped(lambda a, b: dr.select(moves, a, b), place, surface),
                  dr.select(moves, excess, 0))


def choose(found: AtRest, excess: Float) -> FromHistory:
    """The better history; excess: smoothed."""
    return mapped(lambda a, b: dr.select(excess < 0, a, b), found.place, found.surface)


def error_of_history(misses: Float, energy: Float, excess: Float) -> Float:
    """m. misses: of `missed`, smoothed. energy: W[l(e)^2]. excess: W[l(e)^2] - s^2 - z."""
    return dr.maximum(dr.minimum(dr.maximum(misses, 0) * MISS, energy), excess)


def renewal(error: Float, noise: Float) -> Float:
    """m / (m + s_0^2)."""
    return error / (error + dr.maximum(noise, _LEAST))


def parts_of(signal: Signal, innovation: Signal) -> Pair:
    """l(d) and l(h). signal: d. innovation: e."""
    return Pair(signal.luminance, signal.luminance - innovation.luminance)


def residual(before: NoisySignal, after: NoisySignal) -> Residual:
    """Of each pixel, before and after F."""
    assert before.parts is not None
    assert after.parts is not None
    current, history = (b - f for b, f in zip(before.parts, after.parts))
    square, product = dr.square(before.signal.luminance - after.signal.luminance), current * history
    u = 1 / (dr.fma(before.variance, _EDGE, square) + dr.abs(product) + _LEAST)
    return Residual(u * product, u * square)


def restored(before: NoisySignal, after: NoisySignal, around: Residual, length: Float) -> Signal:
    """out. around: residuals, smoothed. length: n before a change, 1 without history."""
    share = dr.clip(around.common / dr.maximum(around.all, _LEAST), 0, 1)
    share = dr.select(length > 1.5, share, 0)
    return mapped(lambda acc, f: dr.fma(share, acc - f, f), before.signal, after.signal)
