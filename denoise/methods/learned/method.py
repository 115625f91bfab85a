"""What a frame is to a network, and what becomes of its result: alike for all of them.

Symbols: L light over albedo, n normal in the view, z depth, r roughness, m mean of z over the
frame's surfaces; input and result are planes of

    g(L) = log(1 + 16 L) / log 17  (three),  n_x,  n_y,  z / (z + m)  (1: no surface),  r

Form:
- Depth is a share, so that the unit of length does not matter; m is of each frame.
- The result is held between the least and greatest L of the 15x15 pixels around: a network may
  answer anything where frames are unlike those it has seen, and a constant is not kept by itself.
- Images are mirrored below and on the right to sides that can be halved as often as the network
  halves them.
- Emission is taken out before and put back after, as for all methods here; an albedo below 0.01 in
  all channels counts as 1.
- Frames without roughness have 1 there.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import drjit as dr
import numpy as np

from onespp.denoise.inputs.demodulation import read_texture
from onespp.denoise.inputs.surface import Surface
from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import evaluate
from onespp.render.frame import Frame

from ..base import OnLanes
from .architecture import Memory
from .extremes import Window
from .pyramid import Pyramid
from .weights import shipped_or

RADIUS = 7      # of the window whose extremes hold the result, pixels
SCALE = 16.0    # of light in g
_TOP = float(np.log1p(SCALE))
_LARGEST = 50.0  # of g's logarithm: a result beyond it would overflow


@dataclass(frozen=True)
class Learned(OnLanes["LearnedState"]):
    """A network of a kind.

    Attributes:
        weights: file that `onespp train` wrote for this kind of network, of any width; empty:
            those that come along.
        demodulate: denoise colour over albedo, as trained, where frames have albedo.
    """

    weights: str = ""
    demodulate: bool = True
    kind: ClassVar[str]
    uses = ("roughness",)

    @property
    def reach(self) -> int:
        return RADIUS

    def init_on(self, stencil: Stencil) -> LearnedState:
        return LearnedState(stencil, Pyramid.make(stencil, shipped_or(self.weights, self.kind)),
                            Window.make(stencil, RADIUS))

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: LearnedState) -> tuple[Color, LearnedState]:
        stencil = state.stencil
        texture = read_texture(frame, stencil, self.demodulate)
        light = texture.demodulate(color)
        depth = dr.select(surface.is_valid, surface.depth, 0)
        evaluate(light, depth)
        shown = stencil.rows(depth.numpy())
        mean = float(shown[shown > 0].mean(dtype=np.float64)) if shown.max() > 0 else 1.0
        planes = [*map(compressed, light), *surface.normal[:2],
                  dr.select(depth > 0, depth / (depth + stencil.opaque(mean)), 1),
                  _roughness(frame, stencil)]
        evaluate(planes)
        found, memory = state.network(planes, state.memory)
        least, greatest = state.window(light)
        result = Color(*[dr.minimum(dr.maximum(expanded(x), low), high)
                         for x, low, high in zip(found, least, greatest)])
        return texture.modulate(result), replace(state, memory=memory)


@dataclass(frozen=True)
class LearnedState:
    """The recorded network and window, and what the network remembers."""

    stencil: Stencil
    network: Pyramid
    window: Window
    memory: Memory = field(default_factory=list, repr=False)


def compressed(light: Float) -> Float:
    """g(L), and -g(-L) below 0."""
    return dr.sign(light) * (dr.log(dr.fma(dr.abs(light), SCALE, 1)) / _TOP)


def expanded(value: Float) -> Float:
    """The light of g."""
    power = dr.exp(dr.minimum(dr.abs(value) * _TOP, _LARGEST))
    return dr.sign(value) * ((power - 1) / SCALE)


def _roughness(frame: Frame, stencil: Stencil) -> Float:
    if "roughness" not in frame:
        return stencil.constant(1)
    (roughness,) = stencil.load(np.asarray(frame["roughness"], np.float32))
    return dr.select(roughness < 1, dr.maximum(roughness, 0), 1)  # not finite: 1
