"""Temporal anti-aliasing: the samples that a pixel got in many frames, each at another place in it.

    out = alpha C + (1 - alpha) clip(H, mu, k sigma)

C the current frame's colour, whose rays are moved by an offset j within the pixel (`onespp render
--jitter halton`); H the last output where the pixel's centre was; mu and sigma mean and standard
deviation of C over 3x3 pixels, in YCoCg; clip moves H towards mu until each component is within
k sigma of it. Where there is no history, out = C.

1. Motion. Frames' matrices contain j (`render/tracer/camera_rays.py`), so that a surface's
   motion between the frames is x' - x + j' - j, and j' - j is the change of their centres of
   projection. A pixel takes the motion of the nearest surface among its 3x3: the edge of what
   moves must move with it, on both of its sides.
2. History is looked up by `catmull_rom.py`, with no test of object or normal: at an edge, a pixel
   is to become the mean of both sides. What history shows wrongly, the clip takes away.

Sources: Karis 2014, "High-quality temporal supersampling" (SIGGRAPH course on advances in real-time
rendering); Salvi 2016, "An excursion in temporal supersampling" (GDC): the variance clip; Yang
et al. 2020, "A survey of temporal antialiasing techniques", doi:10.1111/cgf.14018.

Departures: colours are blended as they are, linear, for that is what a box-filtered reference is;
Karis weighs by luminance. alpha is 0.2 and not 0.1 or less: it was chosen after `onespp` on two of
the generated scenes to develop on (generated/3 and 5), where much moves. The current frame is not
filtered before it is blended. A pixel that has no surface within 3x3 has no history. A lens that
shifts by itself would be taken for jitter.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import drjit as dr

from onespp.denoise.filters.color_box import RowMoments, RowPass, window_moments
from onespp.denoise.geometry.cameras import screen_from_camera
from onespp.denoise.history.reprojection import Motion, locate, motion_between, without_images
from onespp.denoise.inputs.surface import Surface, SurfaceSample
from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.grid import Planes, Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.taps import Taps, window
from onespp.render.frame import Frame

from ..base import OnLanes
from ..parameters import check_range
from .catmull_rom import catmull_rom, pack_image

_FAR = 1e30    # depth where there is no motion
_LEAST = 1e-20


@dataclass(frozen=True)
class Taa(OnLanes["TaaState"]):
    """Temporal anti-aliasing of jittered frames, for what is free of noise already.

    Attributes:
        alpha: weight of the current frame [1, 1e-6 to 1].
        color_box: k, half width of the clip [standard deviations, 0 to 1e6].

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Taa(alpha=0.1)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    alpha: float = 0.2
    color_box: float = 1.0

    def __post_init__(self) -> None:
        check_range(self, "alpha", 1e-6, 1.0)
        check_range(self, "color_box", 0.0, 1e6)

    @property
    def reach(self) -> int:
        return 1

    def init_on(self, stencil: Stencil) -> TaaState:
        planes = stencil.planes([0.0, 0.0, _FAR])
        return TaaState(stencil, RowPass.make(stencil, 1), planes,
                        planes.taps([(0, 0), *window(1)]).named(MovingSample),
                        Step(lambda *a: find_motion(stencil, *a)),
                        Step(lambda *a: resolve(stencil, *a)))

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: TaaState) -> tuple[Color, TaaState]:
        stencil, previous, sample = state.stencil, state.previous, surface.sample
        evaluate(color, sample)
        if previous is None or state.history is None:
            history = pack_image(stencil, color)
            evaluate(history)
            return color, state.after(frame, history)
        shift = [stencil.opaque(d) for d in change_of_jitter(previous, frame)]
        state.planes.store(state.find_motion(sample, motion_between(previous, frame, stencil),
                                             shift))
        chroma = ycocg(color)
        evaluate(chroma)
        moments = state.row_moments(chroma)
        result, history = state.resolve(
            state.around, state.row_moments.rows_around(moments), color, state.history,
            stencil.opaque(self.alpha), stencil.opaque(self.color_box))
        return result, state.after(frame, history)


class MovingSample(NamedTuple):
    """Motion of a pixel's surface since the frame before [pixels], and its depth, `_FAR` for none.
    """

    dx: Float
    dy: Float
    depth: Float


class Resolved(NamedTuple):
    """The output, and the same packed for the next frame (`pack_image`)."""

    color: Color
    history: Float


@dataclass(frozen=True)
class TaaState:
    """The recorded steps, planes of a `MovingSample` with the taps of a pixel and those around,
    the last frame's matrices and output."""

    stencil: Stencil
    row_moments: RowPass
    planes: Planes
    around: Taps[MovingSample]
    find_motion: Step[..., MovingSample]
    resolve: Step[..., Resolved]
    previous: Frame | None = None
    history: Float | None = field(default=None, repr=False)

    def after(self, frame: Frame, history: Float) -> TaaState:
        """The state for the frame after `frame`; of that one only the matrices are kept."""
        return replace(self, previous=without_images(frame), history=history)


def change_of_jitter(previous: Frame, frame: Frame) -> tuple[float, float]:
    """(x, y) of j' - j: where the centre of projection is now, less where it was [pixels]."""
    (x, y, depth), (x0, y0, depth0) = (screen_from_camera(f)[:, 2] for f in (frame, previous))
    return x / depth - x0 / depth0, y / depth - y0 / depth0


def ycocg(color: Color) -> Color:
    """Luma, orange and green chroma of a colour, in the places of red, green and blue."""
    r, g, b = color
    both = 0.25 * (r + b)
    return Color(dr.fma(0.5, g, both), 0.5 * (r - b), dr.fma(0.5, g, -both))


def find_motion(stencil: Stencil, surface: SurfaceSample, motion: Motion,
                shift: list[Float]) -> MovingSample:
    """How each pixel's surface moved on the screen, without the frames' jitter; shift: j' - j."""
    at = locate(stencil, surface, motion, stencil.Float(1))
    row, column = stencil.pixel()
    result = MovingSample(at.x - (stencil.Float(column) + 0.5) + shift[0],
                          at.y - (stencil.Float(row) + 0.5) + shift[1],
                          dr.select(at.inside, surface.depth, _FAR))
    evaluate(result)
    return result


def resolve(stencil: Stencil, around: Taps[MovingSample], rows: Taps[RowMoments], color: Color,
            history: Float, alpha: Float, color_box: Float) -> Resolved:
    """Blend with the clipped history.

    Args:
        around: the pixel itself, then its neighbours. rows: of `window_moments`, in YCoCg.
        history: of `pack_image`.
    """
    dx, dy, nearest = around.at(0)
    for t in range(1, len(around)):
        x, y, depth = around.at(t)
        nearer = depth < nearest
        dx, dy = dr.select(nearer, x, dx), dr.select(nearer, y, dy)
        nearest = dr.select(nearer, depth, nearest)
        around.next()
    row, column = stencil.pixel()
    x, y = stencil.Float(column) + 0.5 + dx, stencil.Float(row) + 0.5 + dy
    is_valid = ((nearest < _FAR) & (x >= 0) & (x < stencil.width)
                & (y >= 0) & (y < stencil.height))
    old = catmull_rom(stencil, history, dr.select(is_valid, x, 0.5), dr.select(is_valid, y, 0.5))
    mean, sigma = window_moments(stencil, rows)
    excess = stencil.Float(1)
    for h, m, s in zip(ycocg(old), mean, sigma):
        excess = dr.maximum(excess, dr.abs(h - m) / dr.fma(color_box, s, _LEAST))
    share = 1 / excess
    m_y, m_co, m_cg = mean
    center = (m_y + m_co - m_cg, m_y + m_cg, m_y - m_co - m_cg)
    result = []
    for c, h, m in zip(color, old, center):
        clipped = dr.select(excess > 1, dr.fma(share, h - m, m), h)
        result.append(dr.select(is_valid, dr.fma(alpha, c - clipped, clipped), c))
    output = Color(*result)
    packed = pack_image(stencil, output)
    evaluate(output, packed)
    return Resolved(output, packed)
