"""The GAMES202 assignment: filter each frame, then accumulate the filtered frames.

Order: filter, reproject, clamp the history to the filtered frame's statistics, blend.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from render.frame import Frame

from .atrous import Atrous
from .bilateral import Bilateral
from .stencil import Stencil
from .surface import GUIDES, read_color, read_surface
from .temporal import Temporal, TemporalState


@dataclass(frozen=True)
class FilteredState:
    """State of the filter and of the accumulation, on one stencil."""

    filter: Any
    history: TemporalState


class _Filtered:
    """Filter, then accumulate: what both variants share."""

    needs: ClassVar[tuple[str, ...]] = ("color", *GUIDES)

    filter: Bilateral | Atrous
    history: Temporal

    def init(self, height: int, width: int) -> FilteredState:
        stencil = Stencil(height, width, max(self.filter.reach, self.history.reach))
        return FilteredState(self.filter.init_on(stencil), self.history.init_on(stencil))

    def __call__(self, frame: Frame, state: FilteredState) -> tuple[np.ndarray, FilteredState]:
        """(h, w, 3) denoised colour, and the state for the next frame.

        Raises:
            InputError: a channel is missing, the size is not the state's, or the frame has
                other objects than the one before it.
        """
        stencil = state.history.stencil
        color, surface = read_color(frame, stencil), read_surface(frame, stencil)
        filtered = self.filter.filter(frame, color, surface, state.filter)
        result, history = self.history.accumulate(frame, filtered, surface, state.history)
        return stencil.image(result), replace(state, history=history)


@dataclass(frozen=True)
class Assignment(_Filtered):
    """Joint bilateral filter, then clamped accumulation: the assignment as set."""

    filter: Bilateral = field(default_factory=Bilateral)
    history: Temporal = field(default_factory=Temporal)


@dataclass(frozen=True)
class AssignmentAtrous(_Filtered):
    """A-trous filter, then clamped accumulation: the assignment's bonus task, done as published."""

    filter: Atrous = field(default_factory=Atrous)
    history: Temporal = field(default_factory=Temporal)
