"""Clamped temporal accumulation of the GAMES202 assignment.

out = alpha C + (1 - alpha) clamp(H, mu - k sigma, mu + k sigma)

C the current frame's (filtered) colour; H the history where the surface was (`reprojection.py`);
mu and sigma mean and deviation of C in a window, per channel; alpha = 1 where there is no history.

The window mixes objects, as the assignment has it: with k = 1, a pixel at a corner of one colour
among another has its history pulled towards the other. A wider box trades that for lag.

The window counts only pixels inside the image, and the variance is about the mean. It is summed
by rows, then by columns, each row as (count, mean, squares about its own mean), which joined
(Chan et al. 1983) lose no digits on bright pixels, as E[x^2] - E[x]^2 does.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import drjit as dr

from render.frame import Frame

from .lanes import OnLanes
from .parameters import check_positive, check_radius, check_range
from .reprojection import Tests, check_motion, load_table, motion_table, pack, reproject
from .stencil import Float, Stencil, Step, Taps
from .surface import Surface, camera_from_screen


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
        check_radius(self, "clamp_radius", largest=16)

    @property
    def reach(self) -> int:
        return self.clamp_radius

    def init_on(self, stencil: Stencil) -> TemporalState:
        color, rows = stencil.planes([0.0] * 3), stencil.planes([0.0] * 6)
        window = range(-self.clamp_radius, self.clamp_radius + 1)
        tests = Tests(self.nearest, self.min_cosine, self.plane_tolerance)

        def sum_rows(taps: Taps, center: list[Float]) -> list[Float]:
            return row_moments(stencil, taps, center)

        def blend(taps: Taps, *arguments: Any) -> tuple[list[Float], Float]:
            return clamp_and_blend(stencil, tests, taps, *arguments)

        return TemporalState(stencil, color, color.taps([(0, dx) for dx in window]),
                             rows, rows.taps([(dy, 0) for dy in window]),
                             Step(sum_rows), Step(blend))

    def on_lanes(self, frame: Frame, color: list[Float], surface: Surface,
                 state: TemporalState) -> tuple[list[Float], TemporalState]:
        stencil, previous = state.stencil, state.previous
        guides = [surface.id, *surface.normal, surface.depth]
        dr.eval(color, guides)
        if previous is None:
            history = pack(stencil, color, guides)
            dr.eval(history)
            return color, state.after(frame, history)
        check_motion(previous, frame)
        state.color.store(color)
        state.rows.store(state.sum_rows(state.row_taps, color))
        table = load_table(motion_table(previous, frame), stencil)
        dual = [stencil.opaque(x) for x in camera_from_screen(previous).T.ravel()]
        numbers = [stencil.opaque(x) for x in (self.alpha, self.color_box, self.min_cosine,
                                               self.plane_tolerance)]
        result, history = state.blend(state.column_taps, color, guides, [table], dual,
                                      [state.history], numbers)
        return result, state.after(frame, history)


@dataclass(frozen=True)
class TemporalState:
    """Window sums' planes and steps; the previous frame's matrices and packed history."""

    stencil: Stencil
    color: Any
    row_taps: Taps
    rows: Any
    column_taps: Taps
    sum_rows: Step
    blend: Step
    previous: Frame | None = None
    history: Float = field(default=None, repr=False)

    def after(self, frame: Frame, history: Float) -> TemporalState:
        """The state for the frame after `frame`; of that one only the matrices are kept."""
        seen = Frame(frame.index, {"id": frame["id"]}, frame.camera_from_world,
                     frame.screen_from_world, frame.world_from_object)
        return TemporalState(self.stencil, self.color, self.row_taps, self.rows, self.column_taps,
                             self.sum_rows, self.blend, seen, history)


def _inside(position: Any, offset: int, size: int) -> Any:
    """Whether position + offset is in [0, size)."""
    at = position + offset
    return (at >= 0) & (at < size)


def row_moments(stencil: Stencil, taps: Taps, center: list[Float]) -> list[Float]:
    """Mean (3) and sum of squares about it (3) of a row of taps, inside the image."""
    radius = len(taps) // 2
    column = stencil.Int(stencil.pixel()[1])
    inside = [_inside(column, dx, stencil.width) for dx in range(-radius, radius + 1)]
    count = sum((dr.select(i, stencil.Float(1), 0) for i in inside), stencil.Float(0))
    means, squares = [], []
    for c in range(3):
        values = [taps.at(i)[c] for i in range(len(taps))]
        mean = sum(values, stencil.Float(0)) / count  # outside the planes hold 0
        square = stencil.Float(0)
        for i, value in zip(inside, values, strict=True):
            d = dr.select(i, value - mean, 0)
            square = dr.fma(d, d, square)
        means.append(mean)
        squares.append(square)
        taps.next()
    return means + squares


def clamp_and_blend(stencil: Stencil, tests: Tests, taps: Taps, color: list[Float],
                    guides: list[Float], table: list[Float], dual: list[Float],
                    history: list[Float], numbers: list[Float]) -> tuple[list[Float], Float]:
    """Blend with the clamped history; taps: `row_moments` of the rows of the window."""
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
    """Mean and deviation (3 each) of a window from its rows' moments."""
    radius = len(taps) // 2
    row, column = (stencil.Int(i) for i in stencil.pixel())
    columns = (dr.minimum(column + radius, stencil.width - 1) - dr.maximum(column - radius, 0) + 1)
    width = stencil.Float(columns)
    weights = [dr.select(_inside(row, dy, stencil.height), width, 0)
               for dy in range(-radius, radius + 1)]
    count = sum(weights, stencil.Float(0))
    means, sigmas = [], []
    for c in range(3):
        total = stencil.Float(0)
        for i, w in enumerate(weights):
            total = dr.fma(w, taps.at(i)[c], total)
        mean = total / count
        square = stencil.Float(0)
        for i, w in enumerate(weights):
            d = taps.at(i)[c] - mean
            square += dr.fma(w * d, d, taps.at(i)[3 + c])
        means.append(mean)
        sigmas.append(dr.sqrt(square / count))
        taps.next()
    return means, sigmas
