"""What our methods share: a frame becomes Dr.Jit arrays, is denoised, and becomes an image again.

A lane is an element of a Dr.Jit array: one pixel, or padding at the end of a row (`jit/grid.py`).
"""

from __future__ import annotations

from typing import ClassVar, Generic, Protocol, TypeVar, cast

import numpy as np

from onespp.denoise.filters.debts import repay
from onespp.denoise.inputs.color import read_color
from onespp.denoise.inputs.surface import GUIDES, Surface, read_surface
from onespp.denoise.jit.arrays import Color
from onespp.denoise.jit.grid import Stencil
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from onespp.render.host.turns import turn


class OnStencil(Protocol):
    """State of a method."""

    @property
    def stencil(self) -> Stencil: ...


State = TypeVar("State", bound=OnStencil)


class OnLanes(Generic[State]):
    """A method whose kernels run over the lanes of a stencil, which its state holds.

    Attributes:
        reach: largest |dx|, |dy| of a tap.
    """

    needs: ClassVar[tuple[str, ...]] = ("color", *GUIDES)

    @property
    def reach(self) -> int:
        raise NotImplementedError

    def init(self, height: int, width: int) -> State:
        """State before the first frame; InputError for an empty image."""
        return self.init_on(Stencil(height, width, self.reach))

    def init_on(self, stencil: Stencil) -> State:
        """State on a stencil that reaches at least `reach` pixels."""
        raise NotImplementedError

    def __call__(self, frame: Frame, state: State | None) -> tuple[np.ndarray, State]:
        """(h, w, 3) denoised colour, and the state for the next frame; None begins a sequence.

        Where the input is nowhere negative, neither is the result (`filters/debts.py`).

        Raises:
            InputError: a channel is missing, the size is not the state's, the frame has other
                objects than the one before it, or the state is not one that `init` made.
        """
        with turn():
            if state is None and isinstance(frame, Frame):
                state = self.init(frame.height, frame.width)
            stencil = check_call(frame, state, self.reach)
            color, surface = read_color(frame, stencil), read_surface(frame, stencil)
            result, after = self.on_lanes(frame, color, surface, cast("State", state))
            image = stencil.image(result)
        if not image.min() >= 0 and not (frame["color"] < 0).any():
            repay(image, frame["id"])  # where light is negative, so may a mean of it be
        return image, after

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: State) -> tuple[Color, State]:
        """Denoise one frame on Dr.Jit arrays.

        Args:
            color: the frame's colour, or what an earlier stage made of it; linear radiance.
            surface: the frame's guides, camera space. state: of the frame before.
        Returns:
            linear radiance, which rounding may leave below 0, and the state for the next frame.
        """
        raise NotImplementedError


def check_call(frame: Frame, state: OnStencil | None, reach: int) -> Stencil:
    """The state's stencil; InputError where a call is given something else, or too small a state,
    which taps leave."""
    if not isinstance(frame, Frame):
        raise InputError(f"a method was called with a {type(frame).__name__}: give it a Frame")
    stencil = getattr(state, "stencil", None)
    if not isinstance(stencil, Stencil) or stencil.reach < reach:
        raise InputError("a method was called with a state that is not its own: begin with None "
                         "or that of its init(height, width), and go on with the one that its call "
                         "returns")
    return stencil
