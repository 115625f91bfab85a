"""Our method, `onespp`: signals apart, each with a history that follows changes of light.

A frame's light is split into what has noise of its own kind (`signals.py`): the visibility of
lights, what glossy lobes reflect, and the rest, all without texture. Each signal is merged with
its history by the filtered innovation and then filtered once more, to be looked at, not to be kept
(`innovation.py`). All signals go through one pass a level, so that geometry is weighed once.

Parameters were found by measurement: see `tune.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import drjit as dr

from render.channels import SHADOW
from render.frame import Frame

from .atrous import BACKGROUND, LARGEST_LEVELS, LOG2E
from .history import RecordState, no_history
from .innovation import (
    ENERGY_LEVELS,
    guided_level,
    look_back,
    merge,
    pack_history,
    smooth_level,
)
from .lanes import OnLanes
from .parameters import check_positive, check_range, check_whole
from .reprojection import motion_between, without_images
from .shadow_motion import (
    AROUND,
    CHOICE,
    follow_shadows,
    has_shadow_rays,
    read_shadow_rays,
)
from .signals import USED, Signals, check_signals, read_signals
from .stencil import Float, Planes, Stencil, Step, Taps, window
from .surface import Surface

_OUTSIDE = -1e15          # 1/z outside the image
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
        sharp_follow: least share of it that visibility and glossy light take.
        renewal: weight of the current frame in visibility's high frequencies where the change of
            the low ones is certain.
        smoothing, levels: of diffuse light, levels of the innovation's smoothing, and of the last
            filter while there is no history; the last of these fades out over `fade` frames.
        sharp_smoothing, sharp_levels: the same of visibility and of glossy light.
        light_sigma, visibility_sigma: of luminance in the last filter, deviations.
        sigma_plane: distance from the tangent plane over depth.
        longest: history length that is not exceeded, frames.
        min_cosine, plane_tolerance: tests of history, see `reprojection.py`.
        demodulate: filter diffuse light without texture, where frames have albedo.
        gloss: glossy light as a signal of its own, where frames have it.
        penumbra: reach of the smoothing of visibility, and of its last filter: a level's deviation
            in widths of the penumbra.
        follow_shadows: visibility's history where the shadow was, and `penumbra`; where frames
            have shadow rays.
    """

    light_alpha: float = 0.05
    visibility_alpha: float = 0.15
    follow: float = 0.55
    doubt: float = 4.0
    sharp_follow: float = 0.75
    renewal: float = 0.6
    smoothing: int = 5
    levels: int = 4
    sharp_smoothing: int = 3
    sharp_levels: int = 3
    light_sigma: float = 8.0
    visibility_sigma: float = 6.0
    fade: float = 4.0
    sigma_plane: float = 0.005
    longest: float = 64.0
    min_cosine: float = 0.5
    plane_tolerance: float = 0.02
    demodulate: bool = True
    gloss: bool = True
    penumbra: float = 0.6
    follow_shadows: bool = True

    uses: ClassVar[tuple[str, ...]] = (*USED, *SHADOW)

    def __post_init__(self) -> None:
        for name, least in (("smoothing", ENERGY_LEVELS), ("levels", 1)):
            check_whole(self, name, LARGEST_LEVELS, least)
            check_whole(self, f"sharp_{name}", getattr(self, name), least)
        for name in ("light_alpha", "visibility_alpha", "follow", "sharp_follow"):
            check_range(self, name, 1e-6, 1.0)
        check_range(self, "renewal", 0.0, 1.0)
        check_range(self, "doubt", 0.0, 1e6)
        check_range(self, "longest", 1.0, 1e6)
        check_range(self, "min_cosine", -1.0, 1.0)
        check_positive(self, "light_sigma", "visibility_sigma", "fade", "sigma_plane",
                       "penumbra", "plane_tolerance")

    @property
    def reach(self) -> int:
        return 1 << (max(self.smoothing, self.levels, 1 + max(AROUND)) - 1)

    def init_on(self, stencil: Stencil) -> RecordState:
        return RecordState(stencil, no_history(stencil))

    def on_lanes(self, frame: Frame, color: list[Float], surface: Surface,
                 state: RecordState) -> tuple[list[Float], RecordState]:
        """`color` is used where the frame has no direct and indirect light."""
        stencil = state.stencil
        table, dual = motion_between(state.previous or frame, frame, stencil)
        signals = read_signals(frame, color, stencil, self.demodulate, self.gloss)
        rays = None
        if self.follow_shadows and signals.unshadowed and has_shadow_rays(frame):
            rays = read_shadow_rays(frame, state.previous or frame, stencil)
        works = state.works or Works.make(self, stencil, signals.sizes, rays is not None)
        check_signals(frame, (works.sizes, works.shadows), (signals.sizes, rays is not None))
        signal = [plane for part in signals.parts for plane in part]
        near = [surface.id, *surface.normal, surface.depth]
        inverse_depth, plane = self._guides(surface, signals, stencil)
        guides, id_ = [inverse_depth, *plane], stencil.Float(surface.id)
        dr.eval(signal, near, guides, id_, (rays.hits, surface.position) if rays else [])

        limits = [stencil.opaque(x) for x in (
            self.min_cosine, self.plane_tolerance, self.longest, LOG2E / (2 * self.penumbra**2))]
        works.surfaces.store([inverse_depth, id_])
        shadows = []
        if rays:
            shadows = works.through(works.around, works.follow_shadows(
                rays.hits, near, surface.position, rays.table, rays.sizes, rays.matrices), plane)
        innovation, energies, carried, seen, other, narrow = works.look_back(
            signal, near, guides, [table], dual, [state.records], shadows, limits)
        works.surfaces.store(seen)
        smooth, energies = works.smooth_innovation(innovation, energies, other, plane, narrow)
        # Without visibility apart, diffuse light has the shadows in it, which are quick.
        follow = self.follow if signals.unshadowed else 1.0
        numbers = [stencil.opaque(x) for x in (
            follow, self.doubt, self.sharp_follow, self.renewal, self.fade,
            *_each(works.sizes, self.light_alpha, self.visibility_alpha))]
        values, fade = works.merge(signal, innovation, smooth, energies, carried, other,
                                   guides, numbers)
        sigmas = [stencil.opaque(math.sqrt(LOG2E) / x)
                  for x in _each(works.sizes, self.light_sigma, self.visibility_sigma)]
        works.surfaces.store([inverse_depth])
        parts = works.filter(values, plane, [*fade, *narrow], sigmas)
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
    """A pass over the first planes: taps of values and of surfaces, and the recorded step."""

    taps: tuple[Taps, Taps]
    spacing: Float
    step: Step[..., Any]

    @staticmethod
    def make(i: int, values: Planes, count: int, surfaces: Planes,
             function: Callable[..., list[Float]]) -> Level:
        offsets = [(dy << i, dx << i) for dy, dx in (*window(1), (0, 0))]
        return Level((values.taps(offsets, range(count)), surfaces.taps(offsets)),
                     values.stencil.opaque(1 << i), Step(function))


@dataclass(frozen=True)
class Works:
    """Planes and steps for signals of these sizes, and for shadow rays or without.

    surfaces: 1/z (of what has a history, then of all) and ID. values: what is being filtered, in
    the order of leaving: diffuse light goes through all levels, the sharp signals through fewer,
    energies through the first ones. around: how a shadow's motion spreads.
    """

    sizes: tuple[int, ...]
    shadows: bool
    surfaces: Planes
    values: Planes
    around: list[Level]
    smoothing: list[Level]
    levels: list[Level]
    follow_shadows: Step[..., Any]
    look_back: Step[..., Any]
    merge: Step[..., Any]
    pack: Step[..., Any]

    @staticmethod
    def make(method: FilteredInnovation, stencil: Stencil, sizes: tuple[int, ...],
             shadows: bool) -> Works:
        surfaces = stencil.planes([_OUTSIDE, -1.0])
        leaving = [(1 + sizes[0], method.smoothing),
                   (int(shadows), max(CHOICE, method.sharp_smoothing)),
                   (sum(sizes[1:]) + int(shadows) + 1, method.sharp_smoothing),
                   (len(sizes), ENERGY_LEVELS)]
        spreads = 0, 1 + sizes[0] + int(shadows)
        visibility = spreads[1] + sum(sizes[1:])
        narrowed = (spreads[1], visibility, visibility + 1) if shadows else ()
        values = stencil.planes([0.0] * sum(planes for planes, _ in leaving))

        def smoothing(i: int) -> Level:
            count = sum(planes for planes, levels in leaving if i < levels)
            return Level.make(i, values, count, surfaces,
                              lambda *a: smooth_level(spreads, narrowed, *a))

        def around(i: int) -> Level:
            return Level.make(i, values, 5, surfaces, lambda *a: smooth_level((), (), *a))

        def last(i: int) -> Level:
            some = sizes if i < method.sharp_levels else sizes[:1]
            fading = (i == method.levels - 1, *[i == method.sharp_levels - 1] * (len(some) - 1))
            return Level.make(i, values, sum(some) + len(some), surfaces,
                              lambda *a: guided_level(some, fading, *a))

        return Works(
            sizes, shadows, surfaces, values, [around(i) for i in AROUND],
            [smoothing(i) for i in range(method.smoothing)],
            [last(i) for i in range(method.levels)],
            Step(lambda *a: follow_shadows(stencil, *a)),
            Step(lambda *a: look_back(stencil, sizes, *a)),
            Step(lambda *a: merge(stencil, sizes, *a)),
            Step(lambda *a: pack_history(stencil, sizes, *a)))

    def through(self, levels: list[Level], values: list[Float], plane: list[Float],
                *numbers: list[Float]) -> list[Float]:
        """Values after these levels, of which later ones may be of the first values alone."""
        values = list(values)
        for level in levels:
            count = len(level.taps[0].at(0))
            self.values.store(values[:count], gutters=True)
            values[:count] = level.step(*level.taps, plane, [level.spacing], *numbers)
        return values

    def smooth_innovation(self, innovation: list[Float], energies: list[Float],
                          other: list[Float], plane: list[Float],
                          narrow: list[Float]) -> tuple[list[Float], list[Float]]:
        """Q, S of the innovation and of the other one, as `merge` wants them; W of its energies."""
        parts = ([energies[0]], innovation[:self.sizes[0]], other[2:], [energies[-1]],
                 innovation[self.sizes[0]:], other[:1], energies)
        values, smooth = [x for part in parts for x in part], []
        values = self.through(self.smoothing, values, plane, narrow)
        for part in parts:
            smooth.append(values[:len(part)])
            values = values[len(part):]
        spread, light, excess, last_spread, sharp, e, energies = smooth
        return [*spread, *last_spread, *light, *sharp, *excess, *e], energies

    def filter(self, values: list[Float], plane: list[Float], weaker: list[Float],
               sigmas: list[Float]) -> list[list[Float]]:
        """The last filter of each signal; values: planes of each signal and its variance."""
        values = self.through(self.levels, values, plane, weaker, sigmas)
        starts = [sum(self.sizes[:s]) + s for s in range(len(self.sizes))]
        return [values[start:start + size] for start, size in zip(starts, self.sizes)]


def _each(sizes: tuple[int, ...], light: Any, visibility: Any) -> list[Any]:
    """A parameter of each signal, light or visibility."""
    return [light if size == 3 else visibility for size in sizes]
