"""A frame's light as the signals that are filtered apart, and the frame's colour from them.

Symbols: E emission, D direct and I indirect light, a albedo; U unshadowed light and V the share of
it that arrives (`render/lights.py`); G the part of I that a glossy lobe chose.

    colour = E + V U + a L + G        L = (I - G + D - V U) / a

V is a scalar whose texture, shading and highlights are all in U, which has no noise: a filter of V
cannot blur them. V is capped at `LARGEST_VISIBILITY`; what is above, what U lacks altogether (a
mirror's image of a lamp) and the colour that one V for all lights misses are left in L, so that
nothing is lost. G is the image of something else: the surface's albedo is not in it.

A frame that lacks the split has D in L; one without direct light, its colour.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import numpy as np

from render.errors import InputError
from render.frame import Frame

from .atrous import with_green
from .demodulation import Texture, read_texture
from .stencil import Float, Stencil
from .surface import luminance, repair

USED = ("direct", "indirect", "unshadowed", "visibility", "specular")
LARGEST_VISIBILITY = 2.0


@dataclass(frozen=True)
class Signals:
    """Arrays of lanes.

    Attributes:
        parts: planes of L, of G if `gloss`, three each (r, luminance, b), and of V, one, if
            there is unshadowed light.
        unshadowed: U (3), or empty. texture: albedo and emission. gloss: whether G is apart.
    """

    parts: list[list[Float]]
    unshadowed: list[Float]
    texture: Texture
    gloss: bool

    @property
    def sizes(self) -> tuple[int, ...]:
        """Planes of each signal."""
        return tuple(map(len, self.parts))

    def color(self, parts: list[list[Float]]) -> list[Float]:
        """The colour that (filtered) signals make, (r, g, b)."""
        color = self.texture.restore(with_green(parts[0]))
        if self.gloss:
            color = [c + g for c, g in zip(color, with_green(parts[1]))]
        if self.unshadowed:
            color = [dr.fma(parts[-1][0], u, c) for u, c in zip(self.unshadowed, color)]
        return color


def read_signals(frame: Frame, color: list[Float], stencil: Stencil, demodulate: bool,
                 gloss: bool) -> Signals:
    """The signals of a frame; `color` is used where it has no direct and indirect light.

    Args:
        demodulate: divide by the albedo, where the frame has it.
        gloss: G as a signal of its own, where the frame has it.
    """
    texture = read_texture(frame, stencil, demodulate)
    if "direct" not in frame or "indirect" not in frame:
        return Signals([_with_luminance(texture.remove(color))], [], texture, False)

    def load(name: str) -> list[Float]:
        image = np.asarray(frame[name], np.float32)
        image = image if image.ndim == 3 else image[..., None]
        return stencil.load(repair(image, frame["id"]))

    if "emission" in frame and not texture.emission:
        texture = Texture(texture.albedo, load("emission"), texture.black)
    light = [d + i for d, i in zip(load("direct"), load("indirect"))]
    parts: list[list[Float]] = []
    unshadowed: list[Float] = []
    gloss = gloss and "specular" in frame
    if gloss:
        specular = load("specular")
        light = [c - g for c, g in zip(light, specular)]
        parts.append(_with_luminance(specular))
    if "unshadowed" in frame and "visibility" in frame:
        unshadowed = load("unshadowed")
        (v,) = load("visibility")
        v = dr.select(v < LARGEST_VISIBILITY, v, LARGEST_VISIBILITY)
        light = [dr.fma(-v, u, c) for u, c in zip(unshadowed, light)]
        parts.append([v])
    light = Texture(texture.albedo, []).remove(light)
    return Signals([_with_luminance(light), *parts], unshadowed, texture, gloss)


def check_signals(frame: Frame, before: tuple, now: tuple) -> None:
    """InputError where a frame has other signals than the one before it."""
    if before != now:
        raise InputError(f"frame {frame.index} has other channels than the frame before it: "
                         "render the sequence anew with one set of --channels")


def _with_luminance(light: list[Float]) -> list[Float]:
    return [light[0], luminance(light), light[2]]
