"""Clamped temporal accumulation of the GAMES202 assignment.

out = alpha C + (1 - alpha) clamp(H, mu - k sigma, mu + k sigma)

C the current frame's (filtered) colour; H the history where the surface was (`reprojection.py`);
mu and sigma mean and deviation of C in a window, per channel; alpha = 1 where there is no history.

The window mixes objects, as the assignment has it: with k = 1, a pixel at a corner of one colour
among another has its history pulled towards the other. A wider box trades that for lag.

The window counts only pixels inside the image. Sums run over differences d from the pixel itself:
since it is one of the window's n, E[d^2] is at most n times the variance, and E[d^2] - E[d]^2 loses
few digits, whatever the brightness. All n taps are summed at once: by rows and then by columns
takes fewer operations, but what goes through memory between the two costs more than that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import drjit as dr

from render.frame import Frame

from .lanes import OnLanes
from .parameters import check_positive, check_range, check_whole
from .reprojection import Tests, motion_between, pack, reproject, without_images
from .stencil import Float, Stencil, Step, Taps
from .surface import Surface


@dataclass(frozen=True)
class Temporal(OnLanes):
    """Accumulation over frames of what is given, noisy or filtered.

    Attributes:
        alpha: weight of the current frame, above 0 to 1.
        color_box: k, width of the clamp in deviations. clamp_radius: of its window, pixels
            (another one compiles another kernel).
        nearest: the assignment's reprojection, to the nearest pixel by object alone.
        min_cosine, plane_tolerance: see `reprojection.py`; a nearest reprojection ignores them.
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
        color = stencil.planes([0.0] * 3)
        side = range(-self.clamp_radius, self.clamp_radius + 1)
        tests = Tests(self.nearest, self.min_cosine, self.plane_tolerance)

        def blend(taps: Taps, *arguments: Any) -> tuple[list[Float], Float]:
            return clamp_and_blend(stencil, tests, taps, *arguments)

        return TemporalState(stencil, color, color.taps([(dy, dx) for dy in side for dx in side]),
                             Step(blend))

    def on_lanes(self, frame: Frame, color: list[Float], surface: Surface,
                 state: TemporalState) -> tuple[list[Float], TemporalState]:
        stencil, previous = state.stencil, state.previous
        guides = [surface.id, *surface.normal, surface.depth]
        dr.eval(color, guides)
        if previous is None:
            history = pack(stencil, color, guides)
            dr.eval(history)
            return color, state.after(frame, history)
        table, dual = motion_between(previous, frame, stencil)
        state.color.store(color)
        numbers = [stencil.opaque(x) for x in (self.alpha, self.color_box, self.min_cosine,
                                               self.plane_tolerance)]
        result, history = state.blend(state.taps, color, guides, [table], dual, [state.history],
                                      numbers)
        return result, state.after(frame, history)


@dataclass(frozen=True)
class TemporalState:
    """Planes of the colour, the window's taps, the previous frame's matrices and history."""

    stencil: Stencil
    color: Any
    taps: Taps
    blend: Step
    previous: Frame | None = None
    history: Float = field(default=None, repr=False)

    def after(self, frame: Frame, history: Float) -> TemporalState:
        """The state for the frame after `frame`; of that one only the matrices are kept."""
        return replace(self, previous=without_images(frame), history=history)


def clamp_and_blend(stencil: Stencil, tests: Tests, taps: Taps, color: list[Float],
                    guides: list[Float], table: list[Float], dual: list[Float],
                    history: list[Float], numbers: list[Float]) -> tuple[list[Float], Float]:
    """Blend with the clamped history; taps: the colour's planes in the window."""
    alpha, k, *limits = numbers
    old, valid = reproject(stencil, guides, table[0], dual, history[0], tests, limits)
    mean, sigma = window_moments(stencil, taps)
    result = []
    for c in range(3):
        low, high = dr.fma(-k, sigma[c], mean[c]), dr.fma(k, sigma[c], mean[c])
        clamped = dr.select(old[c] < low, low, dr.select(old[c] > high, high, old[c]))
        result.append(dr.select(valid, dr.fma(alpha, color[c] - clamped, clamped), color[c]))
    packed = pack(stencil, result, guides)
    dr.eval(result, packed)
    return result, packed


def window_moments(stencil: Stencil, taps: Taps) -> tuple[list[Float], list[Float]]:
    """Mean and deviation (3 each) of the window's pixels inside the image; taps row by row."""
    side = math.isqrt(len(taps))
    row, column = (stencil.Int(i) for i in stencil.pixel())
    in_row = _inside(stencil, column, side, stencil.width)
    in_column = _inside(stencil, row, side, stencil.height)
    zero, norm = stencil.Float(0), 1 / (sum(in_row[1:], in_row[0])
                                        * sum(in_column[1:], in_column[0]))
    means, sigmas = [], []
    for c in range(3):
        center = taps.at(len(taps) // 2)[c]
        total, squares = zero, zero
        for y, of_row in enumerate(in_column):
            row_total, row_squares = zero, zero
            for x, counts in enumerate(in_row):
                d = taps.at(y * side + x)[c] - center
                counted = d * counts
                row_total, row_squares = row_total + counted, dr.fma(d, counted, row_squares)
                taps.next()
            total, squares = dr.fma(of_row, row_total, total), dr.fma(of_row, row_squares, squares)
        mean = total * norm
        variance = dr.fma(-mean, mean, squares * norm)
        means.append(center + mean)
        sigmas.append(dr.sqrt(dr.select(variance > 0, variance, 0)))
    return means, sigmas


def _inside(stencil: Stencil, position: Any, side: int, size: int) -> list[Float]:
    """1 for each of the `side` pixels around a position that is in [0, size), else 0."""
    offsets = range(-(side // 2), side // 2 + 1)
    return [dr.select((position + i >= 0) & (position + i < size), stencil.Float(1), 0)
            for i in offsets]
