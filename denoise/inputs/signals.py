"""A frame's light as the signals that are filtered apart, and the frame's colour from them.

Symbols: E emission, D direct and I indirect light, a albedo; U unshadowed light and V the share of
it that arrives (`render/tracer/lights/resampling.py`); G the part of I that a glossy lobe chose.

    colour = E + V U + a L + G        L = (I - G + D - V U) / a

V is a scalar whose texture, shading and highlights are all in U, which has no noise: a filter of V
cannot blur them. V is capped at `LARGEST_VISIBILITY`; what is above, what U lacks altogether (a
mirror's image of a lamp) and the colour that one V for all lights misses are left in L, so that
nothing is lost. G is the image of something else: the surface's albedo is not in it. On a surface
without a diffuse lobe (its albedo is 1, its roughness below 1) all of that is G, and L is 0.

The cap is little above 1: strata of a sky are wide, and where nothing is in the way V is noise of
which point was drawn, by half of itself. Of L it is averaged more widely than of V, whose shadows
are sharp (seven skies of our own: +0.5 dB over a cap of 2; under lamps no difference).

Where several lights meet, V is noise of which of them the shadow ray went to. Frames of such a
scene have groups of lights g, and several signals V_g: each is known where the ray went to its
group. With y, omega and P of `resampling.py`,

    colour = E + sum V_g U_g + a L + G
    L = (I - G + D - y U_g / P) / a                sum over pixels of y = that of omega V_g.

What the BSDF's sample finds of the lights is in L. (As a share of U - sum U_g it loses 0.6 dB on
average: midpoints of a sky's strata say little of what a sample of a lobe finds.)

A frame that lacks the split has D in L; one without direct light, its colour. C, the part of I that
lamps send by way of balls, is as sharp as they are small: where a frame tells it, L is without C/a.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.jit.arrays import Bool, Color, Float
from onespp.denoise.jit.color import LuminanceColor, luminance, with_green
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import arrays_of
from onespp.render.channels import GROUPED, LAYER, UNSHADOWED
from onespp.render.frame import Frame

from .demodulation import Texture, read_texture
from .repair import repair

USED = ("direct", "indirect", "unshadowed", "visibility", "specular", "roughness", "caustic",
        *LAYER, *GROUPED)
LARGEST_VISIBILITY = 1.1


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


class Chosen(NamedTuple):
    """Of the groups of lights, which follow one another as the last signals.

    Attributes:
        group: of each pixel's shadow ray, -1 for none. weight: omega.
    """

    group: Float
    weight: Float


@dataclass(frozen=True)
class Signals:
    """Arrays of lanes, traced and not yet evaluated.

    Attributes:
        kinds: of signals: L, then G and V where they are apart. listed: the signals. That of a
            group's visibility is y, 0 where the ray went to another group.
        unshadowed: what each V is a share of. texture: albedo and emission.
        chosen: None where all lights are one. lit: 1 where U is above 0, else 0: V is not known
            there, and 0; None where lights are in groups, or V is not apart.
        roughness: where G is apart and its lobes are known.
        lobe: the same, but 1 where G is the (diffuse) light of a layer. of_gloss: texture of G,
            where that is known (`layers.py`). is_bare: where L is 0, nothing being diffuse; None
            where that is not known. caustic: C / a, None where there is none; no part of `listed`.
    """

    kinds: tuple[SignalKind, ...]
    listed: list[Signal]
    unshadowed: list[Color]
    texture: Texture
    chosen: Chosen | None = None
    lit: Float | None = None
    roughness: Float | None = None
    lobe: Float | None = None
    of_gloss: Texture = field(default_factory=Texture)
    is_bare: Bool | None = None
    caustic: Signal | None = None

    @property
    def groups(self) -> int:
        """How many groups of lights there are, 0 where all lights are one."""
        return len(self.unshadowed) if self.chosen else 0

    def color(self, signals: Sequence[Signal]) -> Color:
        """The colour that (filtered) signals make, in the order of `listed`."""
        light = color_of(signals[0])
        if self.is_bare is not None:  # what has leaked into it from others is none of its own
            light = _black_where(self.is_bare, light)
        color = self.texture.modulate(light)
        unshadowed = iter(self.unshadowed)
        for kind, signal in zip(self.kinds[1:], signals[1:], strict=True):
            if kind is SignalKind.GLOSSY:
                gloss = self.of_gloss.modulate(color_of(signal))
                color = Color(*[c + g for c, g in zip(color, gloss)])
            else:
                color = _with(color, signal.luminance, next(unshadowed))
        return color

    def by_balls(self, caustic: Signal) -> Color:
        """The colour of a (filtered) caustic."""
        return Texture(self.texture.albedo).modulate(color_of(caustic))


def read_signals(frame: Frame, color: Color, stencil: Stencil, demodulate: bool,
                 gloss: bool, of_gloss: Frame | None = None) -> Signals:
    """The signals of a frame; `color` is used where it has no direct and indirect light.

    Args:
        demodulate: divide by the albedo, where the frame has it.
        gloss: G as a signal of its own, where the frame has it. of_gloss: of `surface_of_gloss`.
    """
    texture = read_texture(frame, stencil, demodulate)
    if "direct" not in frame or "indirect" not in frame:
        return Signals((SignalKind.DIFFUSE,), [_of_light(texture.demodulate(color))], [], texture)

    def load(name: str) -> list[Float]:
        image = np.asarray(frame[name], np.float32)
        image = image if image.ndim == 3 else image[..., None]
        return stencil.load(repair(image, frame["id"]))

    if "emission" in frame and not texture.emission:
        texture = Texture(texture.albedo, Color(*load("emission")), texture.zero_albedo)
    light = Color(*[d + i for d, i in zip(load("direct"), load("indirect"))])
    caustic = None
    if "caustic" in frame:
        sent = Color(*load("caustic"))
        light = Color(*[c - k for c, k in zip(light, sent)])
        caustic = _of_light(Texture(texture.albedo).demodulate(sent))
    kinds, apart, unshadowed, chosen, roughness = [SignalKind.DIFFUSE], [], [], None, None
    texture_of_gloss, lobe, lit, is_bare = Texture(), None, None, None
    if gloss and "specular" in frame:
        specular = Color(*load("specular"))
        light = Color(*[c - g for c, g in zip(light, specular)])
        if "roughness" in frame:
            lobe = roughness = load("roughness")[0]
        if of_gloss is not None:
            is_layer = (of_gloss["roughness"] == 1) & (frame["roughness"] == 0)
            (there,) = stencil.load(is_layer.astype(np.float32))
            lobe = dr.select(there > 0, stencil.Float(1), roughness)
            if demodulate:
                albedo = np.where(is_layer[..., None], of_gloss["albedo"], np.float32(1))
                texture_of_gloss = Texture(Color(*stencil.load(albedo)))
                specular = texture_of_gloss.demodulate(specular)
        kinds.append(SignalKind.GLOSSY)
        apart.append(_of_light(specular))
    if "unshadowed" in frame and "visibility" in frame:
        if "group" in frame and "group_sample" in frame:
            unshadowed = [Color(*load(name)) for name in UNSHADOWED if name in frame]
            group, (y, weight, chance) = *load("group"), load("group_sample")
            y = _capped(y)
            chosen = Chosen(group, dr.select(group >= 0, weight, 0))
            visibility = [dr.select(group == g, y, 0) for g in range(len(unshadowed))]
            scale = dr.select(chance > 0, 1 / dr.select(chance > 0, chance, 1), 0)
            told = [v * scale for v in visibility]
        else:
            unshadowed = [Color(*load("unshadowed"))]
            lit = dr.select(dr.maximum(dr.maximum(*unshadowed[0][:2]), unshadowed[0][2]) > 0,
                            stencil.Float(1), 0)
            told = visibility = [_capped(v) * lit for v in load("visibility")]
        for v, u in zip(told, unshadowed, strict=True):
            light = _with(light, -v, u)
        kinds += [SignalKind.VISIBILITY] * len(visibility)
        apart += [Signal(None, v, None) for v in visibility]
    if lobe is not None and texture.albedo:
        white = [a >= 1 for a in texture.albedo]
        is_bare = (lobe < 1) & white[0] & white[1] & white[2]
        more = _of_light(_black_where(~is_bare, light))
        apart[0] = Signal(*[g + m for g, m in zip(apart[0], more)])
        light = _black_where(is_bare, light)
    diffuse = _of_light(Texture(texture.albedo).demodulate(light))
    return Signals(tuple(kinds), [diffuse, *apart], unshadowed, texture, chosen, lit, roughness,
                   lobe, texture_of_gloss, is_bare, caustic)


def _capped(visibility: Float) -> Float:
    """At most `LARGEST_VISIBILITY`, which what is not a number counts as."""
    return dr.select(visibility < LARGEST_VISIBILITY, visibility, LARGEST_VISIBILITY)


def _with(color: Color, visibility: Float, unshadowed: Color) -> Color:
    """A colour and a share of unshadowed light."""
    return Color(*[dr.fma(visibility, u, c) for u, c in zip(unshadowed, color)])


def _black_where(mask: Bool, color: Color) -> Color:
    return Color(*[dr.select(mask, 0, c) for c in color])


def _of_light(light: Color) -> Signal:
    return Signal(light.red, luminance(light), light.blue)


def color_of(light: Signal) -> Color:
    """Red, green and blue of a signal of light."""
    return with_green(LuminanceColor(*arrays_of(light)))
