"""How close to a pixel's surface others are: how far its diffuse and glossy light may be filtered.

What is close by keeps light off, as in the slit under a box, and sends light of its own, over about
as many pixels as it is away, x = d f / z, f being the pixels of a unit length at depth 1. A shadow
ray that was stopped tells d, and so does the first segment of a path, if it met something. With c
the mean over the rays around of 1 / ((2 x)^2 + 1), 0 for one that met nothing, a level of the last
filter of `innovation.py` weighs a tap, r pixels away, also by

    exp(-k r^2 / (2 p^2)),   diffuse light   k = (c_s + c_h) n / (n + 3)
                             glossy light    k = c_l n / (n + 3)

of shadow rays and of paths, p as of `penumbra.py`, n the length of the history: the longer it is,
the less noise is there that would want a wider filter. c_l is as c_h is with alpha x for x, alpha
being the roughness: a lobe shows what is d away blurred over as many pixels, and sharp what is
close, as the dark slit between a thing and the glossy floor on which it stands. In scenes that have
layers, behind glass and among leaves, k is 0: what stops a ray there lets light through, by few
bright paths, and a narrow filter would leave their noise.

Slits narrower than a pixel are seen by one frame and missed by the next, so that neither history
nor neighbours know how dark it is there; the pixel's own rays do. With c_s and c_h its own, x the
luminance of the result and y that of the frame, both with emission, the result is

    C (1 - k (1 - min(y / x, 1))),    k = max(3/4 sqrt(min(c_s, c_h)), L / (L + 1/20)).

L tells of slits a pixel wide that no light looks into, as between a lamp and the ceiling above it.
Of c_h, 0 where the frame is not black, it is the least of a pixel and its two neighbours on a line,
on that of the four lines where this is greatest: one black path is chance, three in line are not.

Source: the idea is that of Mehta et al. 2013, "Axis-aligned filtering for interactive
physically-based diffuse indirect lighting", where a filter is as wide as the nearest surface is
away, by bounds over pixels; the mean, which one lone ray hardly moves, is our own.
"""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr

from onespp.denoise.jit.arrays import Bool, Color, Float
from onespp.denoise.jit.color import luminance
from onespp.denoise.jit.taps import Taps

HALF_LENGTH = 3.0              # frames
IN_SLIT = 0.75                 # most that a pixel takes of its own frame, by its rays alone
_LINE = 0.05                   # L of a line that is half taken for a slit


class Contact(NamedTuple):
    """1 / ((2 x)^2 + 1) of each pixel's shadow ray and path, and 1 / ((2 alpha x)^2 + 1) of glossy
    lobes, if there are any; or means of these, c_s, c_h and c_l."""

    of_shadows: Float
    of_paths: Float
    of_lobes: Float | None = None


class ContactFalloff(NamedTuple):
    """log2(e) k / (2 p^2): what a tap's squared distance takes off the log2 of its weight; of
    glossy light None without lobes."""

    diffuse: Float
    glossy: Float | None


def contact_samples(blocked: Bool, blocker_distance: Float, hit_distance: Float,
                    pixels: Float, roughness: Float | None = None) -> Contact:
    """Of each pixel.

    Args:
        blocked: of `shadow_motion.stopped`. blocker_distance, hit_distance: d; the latter is 0
            where a path met nothing. pixels: f / z. roughness: alpha, 1 where there is no lobe.
    """
    def near(there: Bool, distance: Float) -> Float:
        return dr.select(there, 1 / dr.fma(4, dr.square(distance * pixels), 1), 0)

    met, of_lobes = hit_distance > 0, None
    if roughness is not None:
        of_lobes = near(met & (roughness < 1), roughness * hit_distance)
    return Contact(near(blocked, blocker_distance), near(met, hit_distance), of_lobes)


def contact_falloff(around: Contact, length: Float) -> ContactFalloff:
    """Of each pixel.

    Args:
        around: `contact_samples`, smoothed, times log2(e) / (2 p^2). length: n.
    """
    trust = length / (length + HALF_LENGTH)
    diffuse = around.of_shadows + around.of_paths
    lobes = None if around.of_lobes is None else around.of_lobes * trust
    return ContactFalloff(diffuse * trust, lobes)


def black_contact(frame: Color, of_paths: Float) -> Float:
    """c_h of each pixel, 0 where the frame is not black."""
    return dr.select(luminance(frame) > 0, 0, of_paths)


def share_of_line(around: Taps[Float]) -> Float:
    """L / (L + 1/20); around: `black_contact` of the 3x3 pixels, of which the last is the pixel."""
    taps = [around.at(i) for i in range(len(around))]
    lines = [dr.minimum(a, b) for a, b in zip(taps[:4], taps[7:3:-1], strict=True)]
    best = dr.maximum(dr.maximum(lines[0], lines[1]), dr.maximum(lines[2], lines[3]))
    least = dr.minimum(best, taps[-1])
    return least / (least + _LINE)


def dark_in_slits(image: Color, frame: Color, own: Contact, line: Float) -> Color:
    """The result, darker where the pixel's own rays met something at once.

    Args:
        frame: colour of the frame. own: `contact_samples` of its pixels. line: `share_of_line`.
    """
    before, seen = luminance(image), luminance(frame)
    ratio = dr.select(before > 0, seen / dr.select(before > 0, before, 1), 1)
    alone = IN_SLIT * dr.sqrt(dr.minimum(own.of_shadows, own.of_paths))
    left = dr.fma(dr.clip(ratio, 0, 1) - 1, dr.maximum(alone, line), 1)
    return Color(*[c * left for c in image])
