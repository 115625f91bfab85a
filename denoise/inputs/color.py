"""A frame's colour on the lanes of a grid."""

from __future__ import annotations

import numpy as np

from onespp.denoise.jit.arrays import Color
from onespp.denoise.jit.grid import Stencil
from onespp.render.frame import Frame

from .repair import repair
from .surface import check_size


def read_color(frame: Frame, stencil: Stencil) -> Color:
    """The frame's colour, repaired (see `repair`)."""
    check_size(frame, stencil)
    return Color(*stencil.load(repair(np.asarray(frame["color"], np.float32), frame["id"])))
