"""Clamped temporal accumulation of the GAMES202 assignment.

    out = alpha C + (1 - alpha) clamp(H, mu - k sigma, mu + k sigma)

C the current frame's (filtered) colour; H the history where the surface was (`reprojection.py`);
mu and sigma mean and standard deviation of C in a window (`filters/color_box.py`), per channel;
alpha = 1 where there is no history.

Sources: GAMES202, assignment 5; Yang et al. 2020, "A survey of temporal antialiasing techniques",
section 4.2 (history rectification), doi:10.1111/cgf.14018.

Departures: reprojection is bilinear and tested by object, normal and plane (`nearest` gives the
assignment's). As in the assignment, the window mixes objects: with k = 1, the history of a pixel at
the corner of one colour in another is pulled towards the other. A wider box trades that for lag.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import drjit as dr

from onespp.denoise.filters.color_box import RowMoments, RowPass, window_moments
from onespp.denoise.history.reprojection import (
    Motion,
    ReprojectionTests,
    motion_between,
    pack,
    reproject,
    without_images,
)
from onespp.denoise.inputs.surface import Surface, SurfaceSample
from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.taps import Taps
from onespp.render.frame import Frame

from .base import OnLanes
from .parameters import check_positive, check_range, check_whole


@dataclass(frozen=True)
class Temporal(OnLanes["TemporalState"]):
    """Accumulation over frames, noisy or filtered, with the history clamped to a window.

    Attributes:
        alpha: weight of the current frame [1, 1e-6 to 1].
        color_box: k, half width of the clamp [standard deviations, 0 to 1e6].
        clamp_radius: half width of the window [pixels, 1 to 16]; each value compiles a kernel.
        nearest: the assignment's reprojection, to the nearest pixel, tested by object alone.
        min_cosine: least cosine between a history tap's normal and the expected one, see
            `reprojection.py`; not used with `nearest` [1, -1 to 1].
        plane_tolerance: largest distance of a history tap from the expected tangent plane; not
            used with `nearest` [share of depth, above 0].

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Temporal(alpha=0.1)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    alpha: float = 0.2
    color_box: float = 1.0
    clamp_radius: int = 3
    nearest: bool = False
    min_cosine: float = 0.9
    plane_tolerance: float = 0.02

    def __post_init__(self) -> None:
        check_range(self, "alpha", 1e-6, 1.0)
        check_range(self, "color_box", 0.0, 1e6)
        check_range(self, "min_cosine", -1.0, 1.0)
        check_positive(self, "plane_tolerance")
        check_whole(self, "clamp_radius", 16)

    @property
    def reach(self) -> int:
        return self.clamp_radius

    def init_on(self, stencil: Stencil) -> TemporalState:
        nearest = self.nearest
        return TemporalState(stencil, RowPass.make(stencil, self.clamp_radius),
                             Step(lambda *a: clamp_and_blend(stencil, nearest, *a)))

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: TemporalState) -> tuple[Color, TemporalState]:
        stencil, previous, sample = state.stencil, state.previous, surface.sample
        evaluate(color, sample)
        if previous is None or state.history is None:
            history = pack(stencil, color, sample)
            evaluate(history)
            return color, state.after(frame, history)
        moments = state.row_moments(color)
        motion = motion_between(previous, frame, stencil)  # while rows are being summed
        rows = state.row_moments.rows_around(moments)
        blended, history = state.clamp_and_blend(rows, color, sample, motion, state.history,
                                                 self._tests(stencil), self._weights(stencil))
        return blended, state.after(frame, history)

    def _tests(self, stencil: Stencil) -> ReprojectionTests:
        return ReprojectionTests(stencil.opaque(self.min_cosine),
                                 stencil.opaque(self.plane_tolerance))

    def _weights(self, stencil: Stencil) -> BlendWeights:
        return BlendWeights(stencil.opaque(self.alpha), stencil.opaque(self.color_box))


class BlendWeights(NamedTuple):
    """alpha, and k, the width of the clamp in standard deviations."""

    alpha: Float
    color_box: Float


class Blended(NamedTuple):
    """The accumulated colour, and its records for the next frame (`reprojection.pack`)."""

    color: Color
    history: Float


@dataclass(frozen=True)
class TemporalState:
    """The recorded steps, the previous frame's matrices and history."""

    stencil: Stencil
    row_moments: RowPass
    clamp_and_blend: Step[..., Blended]
    previous: Frame | None = None
    history: Float | None = field(default=None, repr=False)

    def after(self, frame: Frame, history: Float) -> TemporalState:
        """The state for the frame after `frame`; of that one only the matrices are kept."""
        return replace(self, previous=without_images(frame), history=history)


def clamp_and_blend(stencil: Stencil, nearest: bool, rows: Taps[RowMoments], color: Color,
                    surface: SurfaceSample, motion: Motion, history: Float,
                    tests: ReprojectionTests, weights: BlendWeights) -> Blended:
    """Blend with the clamped history; rows: of `window_moments`."""
    alpha, k = weights
    old, is_valid = reproject(stencil, surface, motion, history, tests, nearest)
    rows.next()
    mean, sigma = window_moments(stencil, rows)
    result = []
    for c in range(3):
        low, high = dr.fma(-k, sigma[c], mean[c]), dr.fma(k, sigma[c], mean[c])
        clamped = dr.select(old[c] < low, low, dr.select(old[c] > high, high, old[c]))
        result.append(dr.select(is_valid, dr.fma(alpha, color[c] - clamped, clamped), color[c]))
    blended = Color(*result)
    packed = pack(stencil, blended, surface)
    evaluate(blended, packed)
    return Blended(blended, packed)
