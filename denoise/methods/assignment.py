"""The GAMES202 assignment: filter each frame, then accumulate the filtered frames.

Order: filter, reproject, clamp the history to the filtered frame's statistics, blend.

Source: GAMES202, "Real-time high quality rendering" (Yan 2021), assignment 5.

Departures: those of the two stages (`bilateral.py` or `atrous.py`, and `temporal.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

from onespp.denoise.inputs.surface import Surface
from onespp.denoise.jit.arrays import Color
from onespp.denoise.jit.grid import Stencil
from onespp.render.frame import Frame

from .atrous import Atrous, AtrousState
from .base import OnLanes, OnStencil, State
from .bilateral import Bilateral, BilateralState
from .temporal import Temporal, TemporalState

Second = TypeVar("Second", bound=OnStencil)


@dataclass(frozen=True)
class FilteredState(Generic[State, Second]):
    """State of the filter and of the accumulation, on one stencil."""

    stencil: Stencil
    filter: State
    history: Second


@dataclass(frozen=True)
class Filtered(OnLanes[FilteredState[State, Second]], Generic[State, Second]):
    """Filter, then accumulate: what the variants share."""

    filter: OnLanes[State]
    history: OnLanes[Second]

    @property
    def reach(self) -> int:
        return max(self.filter.reach, self.history.reach)

    def init_on(self, stencil: Stencil) -> FilteredState[State, Second]:
        return FilteredState(stencil, self.filter.init_on(stencil), self.history.init_on(stencil))

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: FilteredState[State, Second]
                 ) -> tuple[Color, FilteredState[State, Second]]:
        filtered, after = self.filter.on_lanes(frame, color, surface, state.filter)
        result, history = self.history.on_lanes(frame, filtered, surface, state.history)
        return result, replace(state, filter=after, history=history)


@dataclass(frozen=True)
class Assignment(Filtered[BilateralState, TemporalState]):
    """Joint bilateral filter, then clamped accumulation: the assignment as set.

    Attributes:
        filter: the first stage, a `Bilateral`.
        history: the second stage, a `Temporal`.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Assignment(filter=Bilateral(radius=4))
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    filter: Bilateral = field(default_factory=Bilateral)
    history: Temporal = field(default_factory=Temporal)


@dataclass(frozen=True)
class AssignmentAtrous(Filtered[AtrousState, TemporalState]):
    """A-trous filter, then clamped accumulation: the assignment's bonus task, done as published.

    Attributes:
        filter: the first stage, an `Atrous`.
        history: the second stage, a `Temporal`.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = AssignmentAtrous(history=Temporal(alpha=0.1))
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    filter: Atrous = field(default_factory=Atrous)
    history: Temporal = field(default_factory=Temporal)
