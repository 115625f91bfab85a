"""Our method, `onespp`: signals apart, each with a history that follows changes of light.

A frame's light is split into what has noise of its own kind (`signals.py`): the visibility of
lights, what glossy lobes reflect, and the rest, all without texture. Each signal is merged with
its history by the filtered innovation and then filtered once more, to be looked at, not to be kept
(`innovation.py`). All signals go through one pass a level, so that geometry is weighed once.

Parameters were found by measurement: see `tune.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import drjit as dr

from render.frame import Frame

from .atrous import BACKGROUND, LARGEST_LEVELS, LOG2E
from .history import RecordState, no_history, pack_records
from .innovation import (
    ENERGY_LEVELS,
    fade_out,
    guided_level,
    look_back,
    merge,
    smooth_level,
)
from .lanes import OnLanes
from .parameters import check_positive, check_range, check_whole
from .reprojection import motion_between, without_images
from .signals import USED, Signals, check_signals, read_signals
from .stencil import Float, Planes, Stencil, Step, Taps, window
from .surface import Surface

_OUTSIDE = -1e15          # 1/z outside the image
_UNSEEN = -3e14           # 1/z of a pixel without history
_BLACK = 2 * BACKGROUND   # 1/z of a surface that reflects nothing: a lamp
_BACKGROUND_SCALE = 1e3   # |k| / sigma_plane of background and lamps, whose like alone count


@dataclass(frozen=True)
class FilteredInnovation(OnLanes):
    """The filtered innovation of visibility, glossy and diffuse light.

    Attributes:
        light_alpha, visibility_alpha: least weight of the current frame in high frequencies.
        follow: least share of the smoothed innovation that diffuse light takes, above 0 to 1;
            all of it where frames have no visibility.
        doubt: how many variances of it count as noise.
        smoothing, levels: of diffuse light, levels of the innovation's smoothing, and of the last
            filter while there is no history; the last of these fades out over `fade` frames.
        sharp_smoothing, sharp_levels: the same of visibility and of glossy light.
        light_sigma, visibility_sigma: of luminance in the last filter, deviations.
        sigma_plane: distance from the tangent plane over depth.
        longest: history length that is not exceeded, frames.
        min_cosine, plane_tolerance: tests of history, see `reprojection.py`.
        demodulate: filter diffuse light without texture, where frames have albedo.
        gloss: glossy light as a signal of its own, where frames have it.
    """

    light_alpha: float = 0.05
    visibility_alpha: float = 0.2
    follow: float = 0.4
    doubt: float = 4.0
    smoothing: int = 6
    levels: int = 4
    sharp_smoothing: int = 3
    sharp_levels: int = 3
    light_sigma: float = 12.0
    visibility_sigma: float = 5.0
    fade: float = 4.0
    sigma_plane: float = 0.006
    longest: float = 64.0
    min_cosine: float = 0.5
    plane_tolerance: float = 0.02
    demodulate: bool = True
    gloss: bool = True

    uses: ClassVar[tuple[str, ...]] = USED

    def __post_init__(self) -> None:
        for name, least in (("smoothing", ENERGY_LEVELS), ("levels", 1)):
            check_whole(self, name, LARGEST_LEVELS, least)
            check_whole(self, f"sharp_{name}", getattr(self, name), least)
        for name in ("light_alpha", "visibility_alpha", "follow"):
            check_range(self, name, 1e-6, 1.0)
        check_range(self, "doubt", 0.0, 1e6)
        check_range(self, "longest", 1.0, 1e6)
        check_range(self, "min_cosine", -1.0, 1.0)
        check_positive(self, "light_sigma", "visibility_sigma", "fade", "sigma_plane",
                       "plane_tolerance")

    @property
    def reach(self) -> int:
        return 1 << (max(self.smoothing, self.levels) - 1)

    def init_on(self, stencil: Stencil) -> RecordState:
        return RecordState(stencil, no_history(stencil))

    def on_lanes(self, frame: Frame, color: list[Float], surface: Surface,
                 state: RecordState) -> tuple[list[Float], RecordState]:
        """`color` is used where the frame has no direct and indirect light."""
        stencil = state.stencil
        table, dual = motion_between(state.previous or frame, frame, stencil)
        signals = read_signals(frame, color, stencil, self.demodulate, self.gloss)
        works = state.works or Works.make(self, stencil, signals.sizes)
        check_signals(frame, works.sizes, signals.sizes)
        signal = [plane for part in signals.parts for plane in part]
        near = [surface.id, *surface.normal, surface.depth]
        inverse_depth, plane = self._guides(surface, signals, stencil)
        dr.eval(signal, near, inverse_depth, plane)
        works.depths.store([inverse_depth])

        limits = [stencil.opaque(x) for x in (self.min_cosine, self.plane_tolerance, self.longest)]
        innovation, energies, carried = works.look_back(signal, near, [table], dual,
                                                        [state.records], limits)
        works.seen.store(works.hide([inverse_depth], carried[:1]))
        smooth, energies = works.smooth(innovation, energies, plane)
        # Without visibility apart, diffuse light has the shadows in it, which are quick.
        follow = self.follow if signals.unshadowed else 1.0
        numbers = [stencil.opaque(x) for x in (
            follow, self.doubt, *_each(works.sizes, self.light_alpha, self.visibility_alpha))]
        histories, noises = works.merge(signal, innovation, smooth, energies, carried,
                                        [inverse_depth, *plane], numbers)
        sigmas = [stencil.opaque(LOG2E / x) for x in _each(works.sizes, self.light_sigma,
                                                           self.visibility_sigma)]
        fade = works.fade(carried[:1], [stencil.opaque(self.fade)])
        values = _interleave(works.sizes, histories, noises)
        parts = works.filter(values, plane, [fade], sigmas)
        records = works.pack(near, carried[:1], values)
        return signals.color(parts), replace(state, works=works, records=records,
                                            previous=without_images(frame))

    def _guides(self, surface: Surface, signals: Signals,
                stencil: Stencil) -> tuple[Float, list[Float]]:
        """1/z, and its slopes (2) and scale; lamps and background are far away."""
        exists = surface.exists
        inverse_depth = dr.select(exists, surface.inverse_depth, stencil.Float(BACKGROUND))
        scale = dr.abs(surface.plane_distance) * stencil.opaque(1 / self.sigma_plane)
        if signals.texture.black is not None:
            inverse_depth = dr.select(exists & signals.texture.black, _BLACK, inverse_depth)
            exists &= ~signals.texture.black
        scale = dr.select(exists, scale, stencil.Float(_BACKGROUND_SCALE))
        return inverse_depth, [*(dr.select(exists, g, 0) for g in surface.plane), scale]


@dataclass(frozen=True)
class Level:
    """A pass over the first planes: taps of values and of 1/z, and the recorded step."""

    taps: tuple[Taps, Taps]
    spacing: Float
    step: Step

    @staticmethod
    def make(i: int, values: Planes, count: int, depths: Planes,
             function: Callable[..., list[Float]]) -> Level:
        offsets = [(dy << i, dx << i) for dy, dx in (*window(1), (0, 0))]
        return Level((values.taps(offsets, count), depths.taps(offsets)),
                     values.stencil.opaque(1 << i), Step(function))


@dataclass(frozen=True)
class Works:
    """Planes and steps for signals of these sizes.

    depths: 1/z of all surfaces. seen: where there is history. values: what is being filtered, in
    the order of leaving: diffuse light goes through all levels, the sharp signals through fewer,
    energies through the first ones.
    """

    sizes: tuple[int, ...]
    depths: Planes
    seen: Planes
    values: Planes
    smoothing: list[Level]
    levels: list[Level]
    look_back: Step
    hide: Step
    merge: Step
    fade: Step
    pack: Step

    @staticmethod
    def make(method: FilteredInnovation, stencil: Stencil, sizes: tuple[int, ...]) -> Works:
        depths, seen = (stencil.planes([_OUTSIDE]) for _ in range(2))
        values = stencil.planes([0.0] * (1 + sum(sizes) + len(sizes)))

        def smoothing(i: int) -> Level:
            count = 1 + sum(sizes if i < method.sharp_smoothing else sizes[:1])
            count += len(sizes) if i < ENERGY_LEVELS else 0
            return Level.make(i, values, count, seen, smooth_level)

        def last(i: int) -> Level:
            some = sizes if i < method.sharp_levels else sizes[:1]
            fading = (i == method.levels - 1, *[i == method.sharp_levels - 1] * (len(some) - 1))
            return Level.make(i, values, sum(some) + len(some), depths,
                              lambda *a: guided_level(some, fading, *a))

        def pack(near: list[Float], length: list[Float], values: list[Float]) -> Float:
            return pack_records(stencil, near, [*length, *values])

        return Works(sizes, depths, seen, values,
                     [smoothing(i) for i in range(method.smoothing)],
                     [last(i) for i in range(method.levels)],
                     Step(lambda *a: look_back(stencil, sizes, *a)), Step(_hide),
                     Step(lambda *a: merge(stencil, sizes, *a)), Step(fade_out), Step(pack))

    def smooth(self, innovation: list[Float], energies: list[Float],
               plane: list[Float]) -> tuple[list[Float], list[Float]]:
        """Q of the first signal and S of the innovation, and W of its energies."""
        values = [energies[0], *innovation, *energies]
        for level in self.smoothing:
            count = len(level.taps[0].at(0))
            self.values.store(values[:count], gutters=True)
            values[:count] = level.step(*level.taps, plane, [level.spacing])
        return values[:1 + len(innovation)], values[1 + len(innovation):]

    def filter(self, values: list[Float], plane: list[Float], fade: list[Float],
               sigmas: list[Float]) -> list[list[Float]]:
        """The last filter of each signal; values: planes of each signal and its variance."""
        values = list(values)
        for level in self.levels:
            count = len(level.taps[0].at(0))
            self.values.store(values[:count], gutters=True)
            values[:count] = level.step(*level.taps, plane, [level.spacing], fade, sigmas)
        starts = [sum(self.sizes[:s]) + s for s in range(len(self.sizes))]
        return [values[start:start + size] for start, size in zip(starts, self.sizes)]


def _each(sizes: tuple[int, ...], light: Any, visibility: Any) -> list[Any]:
    """A parameter of each signal, light or visibility."""
    return [light if size == 3 else visibility for size in sizes]


def _interleave(sizes: tuple[int, ...], planes: list[Float], noises: list[Float]) -> list[Float]:
    """Each signal's planes, followed by its variance."""
    ordered, at = [], 0
    for size, noise in zip(sizes, noises):
        ordered += [*planes[at:at + size], noise]
        at += size
    return ordered


def _hide(inverse_depth: list[Float], length: list[Float]) -> list[Float]:
    """1/z, far away where there is no history."""
    return [dr.select(length[0] > 1.5, inverse_depth[0], _UNSEEN)]
