"""Blockwise multi-order feature regression (BMFR): no window and no weights, but one fit a block.

Light without texture is accumulated with the history of the same surface; in each block of 32x32
pixels the nearest sum of a constant, normals, positions and their squares is found (`fit.py`), and
what that sum says is accumulated again. Blocks do not overlap; from frame to frame their tiling is
shifted, and the second accumulation blurs the borders that a single frame shows.

Symbols: h history length in frames, ' the previous frame, L light.

    h = h' + 1, 1 without history
    A = A' + max(alpha, 1/h) (L - A')                      what is fitted
    B = B' + max(alpha_fitted, 1/h) (fit of A - B')        the result

Source: Koskela et al. 2019, "Blockwise multi-order feature regression for real-time path-tracing
reconstruction", doi:10.1145/3269978; the alphas and the noise on features are the published code's.

Departures:
- The paper adds noise to the features, uniform within +-0.01, and finds the fit by a Householder
  QR, so that features which depend on one another do no harm. What that noise adds to the normal
  equations on average, its variance sigma^2 = feature_noise^2 / 3, is added to them instead
  (`fit.py`): the same damping, without a random number. Its switch is `feature_noise`.
- Squares are of positions from the middle of the block, not of the world's origin: the same sums,
  but for the damping, and they keep their digits far away from it. Positions are scaled by their
  extent in the block, as in the paper, or by a thousandth of their distance if that is more.
- The fit is held between the least and greatest A of its block: outliers of a fit, negative light
  among them, are none of the light that came.
- A pixel without a surface, and a lamp that reflects nothing, is not fitted and keeps A. Others of
  a block are fitted together, whatever object they are of: at an edge that neither normals nor
  positions tell, light leaks.
- Shifts are the 16 points of a lattice, not the published table.
- Taps of the history are tested by object too, and against the tangent plane (`reprojection.py`).
- The paper's temporal anti-aliasing at the end is left out: scores compare radiance at the pixels'
  centres. `taa` is that step on its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.history.records import look_up, no_history, pack_records
from onespp.denoise.history.reprojection import (
    Motion,
    ReprojectionTests,
    locate,
    motion_between,
    without_images,
)
from onespp.denoise.inputs.demodulation import Texture, read_texture
from onespp.denoise.inputs.surface import Surface, SurfaceSample
from onespp.denoise.jit.arrays import Bool, Color, Float, Vector3
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.vector import opaque_matrix, transform
from onespp.render.frame import Frame

from ..base import OnLanes
from ..parameters import check_positive, check_range, check_whole
from .blocks import Blocks, Shift
from .fit import Sample, fitted_light

SHIFTS = 16
_STEP = (7, 3)    # from one shift to the next, sixteenths of a block: rows, columns
_LONGEST = 255.0  # frames: a history's length is a byte in the paper
_VALUES = 1 + 3 + 3


@dataclass(frozen=True)
class Bmfr(OnLanes["BmfrState"]):
    """Accumulation over frames, then a fit of feature buffers in each block (BMFR).

    Attributes:
        alpha: least weight of the current frame in what is fitted [1, 1e-6 to 1].
        alpha_fitted: least weight of the current frame's fit in the result [1, 1e-6 to 1].
        block_size: side of a block [pixels, 4 to 64]; each value compiles a kernel.
        feature_noise: largest noise on features that the fit is damped for [1, 0.003 to 1].
        min_cosine: least cosine between a history tap's normal and the expected one, see
            `reprojection.py` [1, -1 to 1].
        plane_tolerance: largest distance of a history tap from the expected tangent plane
            [share of depth, above 0].
        demodulate: filter colour over albedo, where frames have albedo.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Bmfr(block_size=16)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    alpha: float = 0.2
    alpha_fitted: float = 0.1
    block_size: int = 32
    feature_noise: float = 0.01
    min_cosine: float = 0.9
    plane_tolerance: float = 0.02
    demodulate: bool = True

    def __post_init__(self) -> None:
        for name in ("alpha", "alpha_fitted"):
            check_range(self, name, 1e-6, 1.0)
        check_whole(self, "block_size", 64, 4)
        check_range(self, "feature_noise", 0.003, 1.0)
        check_range(self, "min_cosine", -1.0, 1.0)
        check_positive(self, "plane_tolerance")

    @property
    def reach(self) -> int:
        return 0

    def init_on(self, stencil: Stencil) -> BmfrState:
        blocks = Blocks(stencil, self.block_size)
        return BmfrState(stencil, Step(lambda *a: accumulate(stencil, *a)),
                         Step(lambda *a: regress(blocks, *a)), no_history(stencil))

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: BmfrState) -> tuple[Color, BmfrState]:
        stencil, sample = state.stencil, surface.sample
        texture = read_texture(frame, stencil, self.demodulate)
        light, is_fitted = texture.demodulate(color), surface.is_valid & ~is_lamp(texture, stencil)
        to_world = opaque_matrix(stencil, np.linalg.inv(frame.camera_from_world[:3, :3]))
        position = transform(to_world, surface.position)
        evaluate(light, is_fitted, sample, position)

        motion = motion_between(state.previous or frame, frame, stencil)
        accumulated = state.accumulate(light, sample, motion, state.records,
                                       stencil.opaque(self.alpha), self._tests(stencil))
        result, records = state.regress(
            accumulated, sample, position, is_fitted, shift_of(state.frames, self.block_size,
                                                               stencil),
            FitWeights(stencil.opaque(self.alpha_fitted),
                       stencil.opaque(self.feature_noise**2 / 3)))
        return texture.modulate(result), replace(state, records=records, frames=state.frames + 1,
                                                 previous=without_images(frame))

    def _tests(self, stencil: Stencil) -> ReprojectionTests:
        return ReprojectionTests(stencil.opaque(self.min_cosine),
                                 stencil.opaque(self.plane_tolerance))


class Accumulated(NamedTuple):
    """h and A; B' where h is above 1."""

    length: Float
    light: Color
    old_result: Color


class FitWeights(NamedTuple):
    """alpha_fitted and sigma^2."""

    alpha: Float
    sigma2: Float


class Regressed(NamedTuple):
    """B, and the records for the next frame."""

    light: Color
    records: Float


@dataclass(frozen=True)
class BmfrState:
    """The recorded steps; records and matrices of the frame before; how many frames there were."""

    stencil: Stencil
    accumulate: Step[..., Accumulated]
    regress: Step[..., Regressed]
    records: Float = field(repr=False)
    previous: Frame | None = None
    frames: int = 0


def shift_of(frame: int, size: int, stencil: Stencil) -> Shift:
    """Of the tiling of a frame, counted from the sequence's first: 16 in turns, no two in one row
    or column."""
    return Shift(*[dr.opaque(stencil.Int, step * frame % SHIFTS * size // SHIFTS)
                   for step in _STEP])


def is_lamp(texture: Texture, stencil: Stencil) -> Bool:
    """Mask of the pixels that shine and reflect nothing."""
    if texture.zero_albedo is None or texture.emission is None:
        return dr.full(dr.mask_t(stencil.Float), False, stencil.lanes)
    red, green, blue = texture.emission
    return texture.zero_albedo & ((red > 0) | (green > 0) | (blue > 0))


def accumulate(stencil: Stencil, light: Color, surface: SurfaceSample, motion: Motion,
               records: Float, alpha: Float, tests: ReprojectionTests) -> Accumulated:
    """Blend the frame's light with its history."""
    place = locate(stencil, surface, motion, tests.plane_tolerance)
    values, is_valid, _ = look_up(stencil, place, records, _VALUES, tests.min_cosine)
    length = dr.select(is_valid, dr.minimum(values[0] + 1, _LONGEST), 1)
    mixed = _blended(light, values[1:4], length, alpha)
    result = Accumulated(length, mixed, Color(*values[4:]))
    evaluate(result)
    return result


def regress(blocks: Blocks, accumulated: Accumulated, surface: SurfaceSample, position: Vector3,
            is_fitted: Bool, shift: Shift, weights: FitWeights) -> Regressed:
    """Fit in each block, and blend with the earlier results."""
    length, light, old = accumulated
    fit = fitted_light(blocks, shift, Sample(surface.normal, position, light), is_fitted,
                       weights.sigma2)
    now = Color(*[dr.select(is_fitted, f, c) for f, c in zip(fit, light)])
    result = _blended(now, old, length, weights.alpha)
    records = pack_records(blocks.stencil, surface, [length, light, result])
    evaluate(result, records)
    return Regressed(result, records)


def _blended(now: Color, old: list[Float] | Color, length: Float, alpha: Float) -> Color:
    """A mean over a history, which becomes exponential; `now` where there is none."""
    weight = dr.maximum(alpha, 1 / length)
    return Color(*[dr.select(length > 1, dr.fma(weight, n - o, o), n) for n, o in zip(now, old)])
