"""A frame's light as the signals that are filtered apart, and the frame's colour from them.

Symbols: E emission, D direct and I indirect light, a albedo; U unshadowed light and V the share of
it that arrives (`render/tracer/lights.py`); G the part of I that a glossy lobe chose.

    colour = E + V U + a L + G        L = (I - G + D - V U) / a

V is a scalar whose texture, shading and highlights are all in U, which has no noise: a filter of V
cannot blur them. V is capped at `LARGEST_VISIBILITY`; what is above, what U lacks altogether (a
mirror's image of a lamp) and the colour that one V for all lights misses are left in L, so that
nothing is lost. G is the image of something else: the surface's albedo is not in it.

A frame that lacks the split has D in L; one without direct light, its colour.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.color import LuminanceColor, luminance, with_green
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import arrays_of
from onespp.render.frame import Frame

from .demodulation import Texture, read_texture
from .repair import repair

USED = ("direct", "indirect", "unshadowed", "visibility", "specular")
LARGEST_VISIBILITY = 2.0


class SignalKind(Enum):
    """What a signal is of: L, G and V."""

    DIFFUSE = "diffuse"
    GLOSSY = "glossy"
    VISIBILITY = "visibility"


class Signal(NamedTuple):
    """A signal: of light, red, luminance and blue; of visibility, itself as `luminance` alone."""

    red: Float | None
    luminance: Float
    blue: Float | None


@dataclass(frozen=True)
class Signals:
    """Arrays of lanes, traced and not yet evaluated.

    Attributes:
        by_kind: L, then G and V where they are apart.
        unshadowed: U, where V is apart. texture: albedo and emission.
    """

    by_kind: dict[SignalKind, Signal]
    unshadowed: Color | None
    texture: Texture

    @property
    def kinds(self) -> tuple[SignalKind, ...]:
        return tuple(self.by_kind)

    @property
    def listed(self) -> list[Signal]:
        return list(self.by_kind.values())

    def color(self, signals: Sequence[Signal]) -> Color:
        """The colour that (filtered) signals make, in the order of `listed`."""
        by_kind = dict(zip(self.by_kind, signals, strict=True))
        color = self.texture.modulate(_color(by_kind[SignalKind.DIFFUSE]))
        if SignalKind.GLOSSY in by_kind:
            glossy = _color(by_kind[SignalKind.GLOSSY])
            color = Color(*[c + g for c, g in zip(color, glossy)])
        if self.unshadowed:
            visibility = by_kind[SignalKind.VISIBILITY].luminance
            color = Color(*[dr.fma(visibility, u, c) for u, c in zip(self.unshadowed, color)])
        return color


def read_signals(frame: Frame, color: Color, stencil: Stencil, demodulate: bool,
                 gloss: bool) -> Signals:
    """The signals of a frame; `color` is used where it has no direct and indirect light.

    Args:
        demodulate: divide by the albedo, where the frame has it.
        gloss: G as a signal of its own, where the frame has it.
    """
    texture = read_texture(frame, stencil, demodulate)
    if "direct" not in frame or "indirect" not in frame:
        return Signals({SignalKind.DIFFUSE: _of_light(texture.demodulate(color))}, None, texture)

    def load(name: str) -> list[Float]:
        image = np.asarray(frame[name], np.float32)
        image = image if image.ndim == 3 else image[..., None]
        return stencil.load(repair(image, frame["id"]))

    if "emission" in frame and not texture.emission:
        texture = Texture(texture.albedo, Color(*load("emission")), texture.zero_albedo)
    light = Color(*[d + i for d, i in zip(load("direct"), load("indirect"))])
    apart: dict[SignalKind, Signal] = {}
    unshadowed = None
    if gloss and "specular" in frame:
        specular = Color(*load("specular"))
        light = Color(*[c - g for c, g in zip(light, specular)])
        apart[SignalKind.GLOSSY] = _of_light(specular)
    if "unshadowed" in frame and "visibility" in frame:
        unshadowed = Color(*load("unshadowed"))
        (v,) = load("visibility")
        v = dr.select(v < LARGEST_VISIBILITY, v, LARGEST_VISIBILITY)
        light = Color(*[dr.fma(-v, u, c) for u, c in zip(unshadowed, light)])
        apart[SignalKind.VISIBILITY] = Signal(None, v, None)
    diffuse = _of_light(Texture(texture.albedo).demodulate(light))
    return Signals({SignalKind.DIFFUSE: diffuse, **apart}, unshadowed, texture)


def _of_light(light: Color) -> Signal:
    return Signal(light.red, luminance(light), light.blue)


def _color(light: Signal) -> Color:
    return with_green(LuminanceColor(*arrays_of(light)))
