"""How close to a pixel's surface others are: how far its diffuse and glossy light may be filtered.

What is close by keeps light off, as in the slit under a box, and sends light of its own, over about
as many pixels as it is away, x = d f / z, f being the pixels of a unit length at depth 1. A shadow
ray that was stopped tells d, and so does the first segment of a path, if it met something. With c
the mean over the rays around of 1 / ((2 x)^2 + 1), 0 for one that met nothing, a level of the last
filter of `innovation.py` weighs a tap, r pixels away, also by

    exp(-k r^2 / (2 p^2)),   glossy light   k = c_s
                             diffuse light  k = (c_s + 2 c_h) n / (n + 3)

of shadow rays and of paths, p as of `penumbra.py`, n the length of the history: the longer it is,
the less noise is there that would want a wider filter.

Source: the idea is that of Mehta et al. 2013, "Axis-aligned filtering for interactive
physically-based diffuse indirect lighting", where a filter is as wide as the nearest surface is
away, by bounds over pixels; the mean, which one lone ray hardly moves, is our own.
"""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr

from onespp.denoise.jit.arrays import Bool, Float

OF_PATHS = 2.0
HALF_LENGTH = 3.0              # frames


class Contact(NamedTuple):
    """1 / ((2 x)^2 + 1) of each pixel's shadow ray and path; or means of these, c_s and c_h."""

    of_shadows: Float
    of_paths: Float


class ContactFalloff(NamedTuple):
    """log2(e) k / (2 p^2): what a tap's squared distance takes off the log2 of its weight."""

    diffuse: Float
    glossy: Float


def contact_samples(blocked: Bool, blocker_distance: Float, hit_distance: Float,
                    pixels: Float) -> Contact:
    """Of each pixel.

    Args:
        blocked: of `shadow_motion.stopped`. blocker_distance, hit_distance: d; the latter is 0
            where a path met nothing. pixels: f / z.
    """
    def near(there: Bool, distance: Float) -> Float:
        return dr.select(there, 1 / dr.fma(4, dr.square(distance * pixels), 1), 0)

    return Contact(near(blocked, blocker_distance), near(hit_distance > 0, hit_distance))


def contact_falloff(around: Contact, length: Float) -> ContactFalloff:
    """Of each pixel.

    Args:
        around: `contact_samples`, smoothed, times log2(e) / (2 p^2). length: n.
    """
    diffuse = dr.fma(OF_PATHS, around.of_paths, around.of_shadows)
    return ContactFalloff(diffuse * length / (length + HALF_LENGTH), around.of_shadows)
