"""Texture taken out of the colour before filtering, and put back after.

L = (C - E) / max(a, 0.01), with C colour, E emission, a albedo (SVGF, Schied et al. 2017). What
is left is light alone, smooth where a texture is not, and a filter cannot blur the texture.

Departures: SVGF's floor is 0.001; a higher one keeps what a dark surface reflects specularly from
weighing a thousandfold in its neighbours. A surface darker than the floor in all channels (a
mirror, in renderers that write 0 there) counts as albedo 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from render.frame import Frame

from .stencil import Float, Stencil

CHANNELS = ("albedo", "emission")  # used where a frame has them
SMALLEST_ALBEDO = 1e-2


@dataclass(frozen=True)
class Texture:
    """What was taken out, as arrays of lanes; empty lists: nothing.

    black: mask of surfaces darker than the floor, None where there is no albedo.
    """

    albedo: list[Float]
    emission: list[Float]
    black: Any = None

    def remove(self, color: list[Float]) -> list[Float]:
        light = [c - e for c, e in zip(color, self.emission)] if self.emission else color
        return [c / a for c, a in zip(light, self.albedo)] if self.albedo else light

    def restore(self, light: list[Float]) -> list[Float]:
        color = [c * a for c, a in zip(light, self.albedo)] if self.albedo else light
        return [c + e for c, e in zip(color, self.emission)] if self.emission else color


def read_texture(frame: Frame, stencil: Stencil, wanted: bool) -> Texture:
    """Albedo and emission of a frame, where it has them; nothing if it has no albedo.

    Values that are not finite count as albedo 1 and emission 0.
    """
    if not wanted or "albedo" not in frame:
        return Texture([], [])
    albedo = stencil.load(np.asarray(frame["albedo"], np.float32))
    albedo = [dr.select(dr.abs(a) < 1e6, a, 1) for a in albedo]
    dark = [a < SMALLEST_ALBEDO for a in albedo]
    black = dark[0] & dark[1] & dark[2]
    floor = dr.select(black, stencil.Float(1), SMALLEST_ALBEDO)
    albedo = [dr.select(d, floor, a) for d, a in zip(dark, albedo)]
    if "emission" not in frame:
        return Texture(albedo, [], black)
    emission = stencil.load(np.asarray(frame["emission"], np.float32))
    return Texture(albedo, [dr.select(dr.abs(e) < 1e18, e, 0) for e in emission], black)
