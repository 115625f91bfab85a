"""Texture taken out of the colour before filtering, and put back after.

L = (C - E) / max(a, 0.01), with C colour, E emission, a albedo (SVGF, Schied et al. 2017). What
is left is light alone, smooth where a texture is not, and a filter cannot blur the texture.

Departures: SVGF's floor is 0.001; a higher one keeps what a dark surface reflects specularly from
weighing a thousandfold in its neighbours. A surface darker than the floor in all channels (a
mirror, in renderers that write 0 there) counts as albedo 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import numpy as np

from onespp.denoise.jit.arrays import Bool, Color
from onespp.denoise.jit.grid import Stencil
from onespp.render.frame import Frame

CHANNELS = ("albedo", "emission")  # used where a frame has them
SMALLEST_ALBEDO = 1e-2


@dataclass(frozen=True)
class Texture:
    """What is taken out, None where a frame does not have it.

    zero_albedo: mask of surfaces that reflect (almost) nothing, as lamps; None without albedo.
    """

    albedo: Color | None = None
    emission: Color | None = None
    zero_albedo: Bool | None = None

    def demodulate(self, color: Color) -> Color:
        """The light that makes a colour on this texture."""
        if self.emission:
            color = Color(*[c - e for c, e in zip(color, self.emission)])
        return Color(*[c / a for c, a in zip(color, self.albedo)]) if self.albedo else color

    def modulate(self, light: Color) -> Color:
        """The colour that light makes on this texture."""
        if self.albedo:
            light = Color(*[c * a for c, a in zip(light, self.albedo)])
        return Color(*[c + e for c, e in zip(light, self.emission)]) if self.emission else light


def read_texture(frame: Frame, stencil: Stencil, demodulate: bool) -> Texture:
    """Albedo and emission of a frame, where it has them; nothing if it has no albedo.

    Values that are not finite count as albedo 1 and emission 0.
    """
    if not demodulate or "albedo" not in frame:
        return Texture()
    albedo = stencil.load(np.asarray(frame["albedo"], np.float32))
    albedo = [dr.select(dr.abs(a) < 1e6, a, 1) for a in albedo]
    dark = [a < SMALLEST_ALBEDO for a in albedo]
    zero_albedo = dark[0] & dark[1] & dark[2]
    floor = dr.select(zero_albedo, stencil.Float(1), SMALLEST_ALBEDO)
    albedo = Color(*[dr.select(d, floor, a) for d, a in zip(dark, albedo)])
    if "emission" not in frame:
        return Texture(albedo, None, zero_albedo)
    emission = stencil.load(np.asarray(frame["emission"], np.float32))
    emission = Color(*[dr.select(dr.abs(e) < 1e18, e, 0) for e in emission])
    return Texture(albedo, emission, zero_albedo)
