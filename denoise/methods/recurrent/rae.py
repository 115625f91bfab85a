"""The recurrent autoencoder (RAE): a network that was trained to denoise, and remembers.

Light without texture goes through five levels, each half as large, and back; on each of them a
block of three convolutions gets what it gave for the frame before. No motion is known to it: what
moves it has to find again. Its layers and their widths are in `architecture.py`.

Symbols: L light over albedo, n normal in the view, z depth, r roughness, m mean of z over the
frame's surfaces; input and result are planes of

    g(L) = log(1 + 16 L) / log 17  (three),  n_x,  n_y,  z / (z + m)  (1: no surface),  r

Source: Chaitanya et al. 2017, "Interactive Reconstruction of Monte Carlo Image Sequences using a
Recurrent Denoising Autoencoder", doi:10.1145/3072959.3073601. The weights are ours: a network with
a quarter of the published features, trained by `onespp train rae` on two cores, for less than an
hour. What it scores says nothing about the paper's.

Departures:
- Light is compressed by g, in the input, the result and the loss. The paper has a loss on L^0.2,
  whose slope at 0 has no bound.
- Depth is a share, so that the unit of length does not matter; m is of each frame.
- The result is held between the least and greatest L of the 15x15 pixels around: a network may
  answer anything where frames are unlike those it has seen, and a constant is not kept by itself.
- Images are mirrored below and on the right to sides that are multiples of 32.
- Emission is taken out before and put back after, as for all methods here; an albedo below 0.01 in
  all channels counts as 1.
- The input is at the pixels' centres, one sample with light sampling by resampling, and so less
  noisy than the paper's.
- A block stands after the pooling of its level, and what is skipped is its output; the finest level
  has none, and the input is skipped to it. The paper's figures say as much, not its text.
- Frames without roughness have 1 there.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import drjit as dr
import numpy as np

from onespp.denoise.inputs.demodulation import read_texture
from onespp.denoise.inputs.surface import Surface
from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import evaluate
from onespp.render.frame import Frame

from ..base import OnLanes
from .extremes import Window
from .network import Autoencoder, Memory
from .weights import shipped_or

RADIUS = 7      # of the window whose extremes hold the result, pixels
SCALE = 16.0    # of light in g
_TOP = float(np.log1p(SCALE))
_LARGEST = 50.0  # of g's logarithm: a result beyond it would overflow


@dataclass(frozen=True)
class Rae(OnLanes["RaeState"]):
    """rae-quarter (ours): a recurrent autoencoder of a quarter of the published width, at the
    beginning of its training: blotches, fringes and guessed shadows instead of noise.

    Attributes:
        weights: file that `onespp train rae` wrote, of any width; empty: those that come along.
        demodulate: denoise colour over albedo, as trained, where frames have albedo.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Rae()
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    weights: str = ""
    demodulate: bool = True
    uses = ("roughness",)

    @property
    def reach(self) -> int:
        return RADIUS

    def init_on(self, stencil: Stencil) -> RaeState:
        return RaeState(stencil, Autoencoder.make(stencil, shipped_or(self.weights)),
                        Window.make(stencil, RADIUS))

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: RaeState) -> tuple[Color, RaeState]:
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
class RaeState:
    """The recorded network and window, and what the network remembers."""

    stencil: Stencil
    network: Autoencoder
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
