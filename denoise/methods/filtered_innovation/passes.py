"""The passes of a frame: their planes, taps and recorded steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import drjit as dr

from onespp.denoise.filters.bent import BESIDE, Bend, bend, bent_share, with_history
from onespp.denoise.filters.contact import Contact, black_contact, share_of_line
from onespp.denoise.filters.peaks import (
    BEFORE_FILTER,
    BEFORE_HISTORY,
    RADIUS,
    Limits,
    Trimmed,
    with_their_light,
    without_peaks,
)
from onespp.denoise.filters.tangent_plane import RING, Roughness, SurfaceTap, loosened, roughness
from onespp.denoise.history.shadow_motion import SPREAD_LEVEL
from onespp.denoise.inputs.path_hits import Hits
from onespp.denoise.inputs.shadow_rays import ShadowRays
from onespp.denoise.inputs.signals import Chosen, Signal, SignalKind
from onespp.denoise.inputs.surface import SurfaceSample, TangentPlane
from onespp.denoise.jit.arrays import Color, Float, Vector3
from onespp.denoise.jit.grid import Planes, Stencil, single
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import arrays_of, build, flatten
from onespp.denoise.jit.taps import Taps, window

from .innovation import (
    Innovations,
    choose_histories,
    find_innovations,
    pack_history,
    renewed,
    seen_twice_by_narrow_lobes,
    to_smooth,
)
from .layout import NoisySignal, PlaneRule, SignalLayout, Smoothed
from .merging import Merged, merge
from .output import FEWEST_SAMPLES, OutputFalloff, output_level
from .shadows import Surroundings, look_around
from .smoothing import fill_level, smooth_level
from .texture import CHOICE_RULES, RESIDUAL_RULES, Residual, residual, restored

_OUTSIDE = -1e15          # 1/z outside the image
_ID, _INVERSE_DEPTH, _VALID_INVERSE_DEPTH, _ROUGH = range(4)  # planes of the surface
_SHADOW_PLANES, _CONTACT_PLANES, _LOBE_PLANES = 6, 2, 2  # of what is seen around
_AROUND, _WINDOW = [*window(1), (0, 0)], [*window(RADIUS), (0, 0)]
T = TypeVar("T")


@dataclass(frozen=True)
class Level:
    """A pass over the first planes: their taps and those of surfaces, and the recorded step, which
    gives these planes."""

    values: Taps
    surfaces: Taps[SurfaceTap]
    spacing: Float
    step: Step[..., list[Float]]
    count: int

    @staticmethod
    def make(i: int, planes: Planes, count: int, surfaces: Planes, inverse_depth: int,
             function: Callable[..., Any], named: Callable[..., Any] | None = None) -> Level:
        """Level i, over `count` planes; inverse_depth: which of the planes of `surfaces`."""
        offsets = [(dy << i, dx << i) for dy, dx in _AROUND]
        values = planes.taps(offsets, range(count))
        return Level(values.named(named) if named else values,
                     surfaces.taps(offsets, [inverse_depth, _ID]).named(SurfaceTap),
                     planes.stencil.opaque(1 << i),
                     Step(lambda *a: arrays_of(function(*a))), count)


@dataclass(frozen=True)
class PeakPasses:
    """What takes peaks out of some signals, and gives their light back (`filters/peaks.py`).

    Attributes:
        signals: which. window: of their luminance and of object ID. trim: `without_peaks` of them.
        wide: levels of the smoothing of what is taken.
    """

    signals: list[int]
    window: tuple[Taps[list[Float]], Taps[Float]]
    trim: Step[..., tuple[list[Signal], Trimmed]]
    wide: list[Level]

    @staticmethod
    def make(limits: Limits, signals: list[int], layout: SignalLayout, buffer: Planes,
             surfaces: Planes, wide: Callable[[int, int], Level]) -> PeakPasses:
        kinds = [layout.kinds[s] for s in signals]
        levels = layout.innovation_levels if signals else 0
        return PeakPasses(
            signals, (buffer.taps(_WINDOW, range(len(signals))),
                      surfaces.taps(_WINDOW, [_ID]).named(single)),
            Step(lambda *a: without_peaks(limits, kinds, *a)),
            [wide(i, 4 * len(signals)) for i in range(levels)])


@dataclass(frozen=True)
class Passes:
    """The planes and recorded steps of a layout, and the passes that they are.

    Attributes:
        surfaces: planes of object ID, 1/z, 1/z of what has a history, and `Roughness.share`.
        buffer: planes of what is being smoothed or filtered, see `layout.py`.
        peaks_of_frame, peaks_of_history: before history, and before the last filter.
        around: surfaces of the 3x3 pixels around. ring: of shares of roughness.
        beside: normals, and object IDs, of the pixels beside.
        fill: of unlit pixels' visibility. line_taps: of `black_contact`.
    """

    stencil: Stencil
    layout: SignalLayout
    surfaces: Planes
    buffer: Planes
    around: Taps[SurfaceTap]
    ring: Taps[Float]
    roughness: Step[..., Roughness]
    beside: tuple[Taps[Vector3], Taps[Float]]
    bend: Step[..., Bend]
    loosen: Step[..., TangentPlane]
    fill: Level
    look_around: Step[..., Surroundings]
    spread: Level
    black: Step[..., Float]
    line: Step[..., Float]
    line_taps: Taps[Float]
    find_innovations: Step[..., Innovations]
    choice: list[Level]
    choose: Step[..., Innovations]
    smoothing: list[Level]
    merge: Step[..., Merged]
    output: list[Level]
    peaks_of_frame: PeakPasses
    peaks_of_history: PeakPasses
    make_whole: Step[..., list[Signal]]
    twice: Step[..., list[Float]]
    renew: Step[..., tuple[list[Signal], list[Float]]]
    residual: Step[..., Residual]
    residual_smoothing: list[Level]
    restore: Step[..., Signal]
    pack: Step[..., Float]

    @staticmethod
    def make(stencil: Stencil, layout: SignalLayout) -> Passes:
        surfaces = stencil.planes([-1.0, _OUTSIDE, _OUTSIDE, 0.0])
        spread = [PlaneRule(SPREAD_LEVEL)] * (
            _SHADOW_PLANES * (layout.groups or 1) + _CONTACT_PLANES * (not layout.has_layers)
            + _LOBE_PLANES * layout.kinds.count(SignalKind.GLOSSY))
        buffer = stencil.planes([0.0] * max(len(layout.smoothing_rules), len(spread),
                                            layout.output_planes(layout.output_level(0)),
                                            4 * len(layout.with_peaks)))

        def smoothing(i: int) -> Level:
            rules = layout.smoothing_level(i)
            return Level.make(i, buffer, len(rules), surfaces, _VALID_INVERSE_DEPTH,
                              lambda *a: smooth_level(rules, *a))

        def wide(i: int, count: int) -> Level:
            rules = [PlaneRule(layout.innovation_levels)] * count
            return Level.make(i, buffer, len(rules), surfaces, _INVERSE_DEPTH,
                              lambda *a: smooth_level(rules, *a))

        def output(i: int) -> Level:
            left = layout.output_level(i)
            return Level.make(i, buffer, layout.output_planes(left), surfaces, _INVERSE_DEPTH,
                              lambda *a: output_level(layout, i, *a), layout.noisy_signals(left))

        choice: list[Level] = []
        if layout.groups and layout.has_shadow_rays:
            choice = [Level.make(SPREAD_LEVEL, buffer, layout.groups, surfaces,
                                 _VALID_INVERSE_DEPTH,
                                 lambda *a: smooth_level(spread[:layout.groups], *a))]
        elif layout.has_texture:
            choice = [Level.make(i, buffer, len(CHOICE_RULES), surfaces, _VALID_INVERSE_DEPTH,
                                 lambda *a: smooth_level(CHOICE_RULES, *a))
                      for i in range(min(CHOICE_RULES[0].levels, layout.innovation_levels))]
        return Passes(
            stencil, layout, surfaces, buffer,
            surfaces.taps(_AROUND, [_INVERSE_DEPTH, _ID]).named(SurfaceTap),
            surfaces.taps(RING, [_ROUGH]).named(single),
            Step(roughness),
            (buffer.taps(BESIDE, range(3)).named(Vector3),
             surfaces.taps(BESIDE, [_ID]).named(single)),
            Step(bend),
            Step(loosened),
            Level.make(0, buffer, 2, surfaces, _INVERSE_DEPTH, fill_level),
            Step(lambda rays, hits, chosen, *a: look_around(
                stencil, rays, hits, chosen, layout.groups, *a)),
            Level.make(SPREAD_LEVEL, buffer, len(spread), surfaces, _INVERSE_DEPTH,
                       lambda *a: smooth_level(spread, *a)),
            Step(black_contact), Step(share_of_line), buffer.taps(_AROUND, [0]).named(single),
            Step(lambda *a: find_innovations(stencil, layout, *a)),
            choice,
            Step(lambda *a: choose_histories(layout, *a)),
            [smoothing(i) for i in range(layout.innovation_levels)],
            Step(lambda *a: merge(stencil, layout, *a)),
            [output(i) for i in range(layout.deepest_output)],
            PeakPasses.make(BEFORE_HISTORY, layout.with_peaks_of_frame, layout, buffer, surfaces,
                            wide),
            PeakPasses.make(BEFORE_FILTER, layout.with_peaks, layout, buffer, surfaces, wide),
            Step(with_their_light),
            Step(seen_twice_by_narrow_lobes), Step(renewed),
            Step(residual),
            [Level.make(i, buffer, len(RESIDUAL_RULES), surfaces, _VALID_INVERSE_DEPTH,
                        lambda *a: smooth_level(RESIDUAL_RULES, *a))
             for i in range(layout.innovation_levels)]
            if layout.has_texture else [],
            Step(restored),
            Step(lambda *a: pack_history(stencil, layout, *a)))

    def store_surface(self, id_: Float, plane: TangentPlane) -> TangentPlane:
        """The tangent planes as they count from here on."""
        self.surfaces.store([id_, plane.inverse_depth])
        rough = self.roughness(self.around, plane)
        self.surfaces.store(rough.share, first=_ROUGH)
        return self.loosen(self.ring, rough, plane)

    def bends(self, normal: Vector3, bare_lobe: Float | None) -> Bend | None:
        """How surfaces are bent, after `store_surface`; bare_lobe: of `_Given`."""
        if bare_lobe is None:
            return None
        self.buffer.store(list(normal), gutters=True)
        return self.bend(*self.beside, bare_lobe)

    def with_visibility_of_unlit(self, signals: list[Signal], lit: Float,
                                 plane: TangentPlane) -> list[Signal]:
        """Signals whose last is visibility: where a pixel has no unshadowed light, `lit` is 0 and
        nothing is known of it, such as on the back of a leaf, it gets what its neighbours have, of
        which it would else take some away."""
        *others, visibility = signals
        filled, _ = self._through([self.fill], [visibility.luminance, lit], plane)
        return [*others, visibility._replace(luminance=filled)]

    def surroundings(self, rays: ShadowRays | None, hits: Hits | None, surface: SurfaceSample,
                     position: Vector3, plane: TangentPlane, chosen: Chosen | None,
                     roughness: Float | None) -> tuple[Surroundings, Surroundings]:
        """`look_around`, and means of it over a few pixels around; in scenes that have layers no
        filter asks for those of contacts."""
        if rays is None or hits is None:
            return Surroundings([], None), Surroundings([], None)
        own = self.look_around(rays, hits, chosen, surface, position, roughness)
        asked = own._replace(contact=None) if self.layout.has_layers else own
        return own, self._through([self.spread], asked, plane)

    def black_lines(self, frame: Color, own: Contact) -> Float:
        """`share_of_line` of a frame's colour."""
        self.buffer.store([self.black(frame, own.of_paths)], gutters=True)
        return self.line(self.line_taps)

    def choose_histories(self, innovations: Innovations, plane: TangentPlane) -> Innovations:
        """With the better one of the two histories of each sparse signal, or of light with texture;
        first of what follows."""
        self.surfaces.store(innovations.valid_inverse_depth, first=_VALID_INVERSE_DEPTH)
        excess = [shadow.excess for shadow in innovations.shadows]
        if innovations.at_rest is not None:
            excess = [innovations.at_rest.excess]
        if not (self.choice and excess):
            return innovations
        return self.choose(innovations, self._through(self.choice, excess, plane))

    def without_peaks_of_frame(self, signals: list[Signal], innovations: Innovations,
                               roughness: Float | None, plane: TangentPlane,
                               ) -> tuple[list[Signal], Innovations]:
        """Signals of the frame whose peaks have given their light to all around, and innovations
        of these."""
        which = self.peaks_of_frame.signals
        if not which or roughness is None:
            return signals, innovations
        before, changes = ([of_all[s] for s in which]
                           for of_all in (signals, innovations.signals))
        length = innovations.lengths[0]
        trimmed, taken = self._trimmed(self.peaks_of_frame, signals,
                                       self.twice(before, changes, length, roughness),
                                       None, plane)
        whole = self.make_whole([trimmed[s] for s in which], taken)
        news = self.renew(before, whole, changes, length)
        signals, changes = list(signals), list(innovations.signals)
        powers = list(innovations.energies)
        for s, light, e, power in zip(which, whole, *news, strict=True):
            signals[s], changes[s], powers[s] = light, e, power
        return signals, innovations._replace(signals=changes, energies=powers)

    def smooth_innovations(self, innovations: Innovations, plane: TangentPlane) -> Smoothed:
        """Q, S and W of the innovation, over pixels that have a history."""
        return self._through(self.smoothing, to_smooth(self.layout, innovations), plane,
                             innovations.footprint_falloffs)

    def filter_output(self, merged: Merged, innovations: Innovations, plane: TangentPlane,
                      sigmas: list[Float], narrower: Float | None,
                      bends: Bend | None) -> list[Signal]:
        """The last filter of each signal; narrower: of `narrowed`. bends: of this class."""
        falloff = OutputFalloff(merged.fades, merged.sparse_fades, merged.footprints,
                                merged.contact, narrower,
                                bends and with_history(bends, merged.lengths[0]))
        before = [_counted(noisy) for noisy in merged.signals]
        if merged.parts is not None:
            before = [before[0]._replace(parts=merged.parts)]
        lights, taken = self._trimmed(self.peaks_of_history, [noisy.signal for noisy in before],
                                         list(merged.seen_twice), bends and bent_share(bends),
                                         plane)
        before = [noisy._replace(signal=light) for noisy, light in zip(before, lights)]
        filtered = self._through(self.output, before, plane, falloff, sigmas)
        if merged.parts is None:
            output = [noisy.signal for noisy in filtered]
            if taken is not None:
                lights = self.make_whole([output[s] for s in self.layout.with_peaks], taken)
                for s, light in zip(self.layout.with_peaks, lights, strict=True):
                    output[s] = light
            return output
        around = self._through(self.residual_smoothing, self.residual(before[0], filtered[0]),
                               plane)
        return [self.restore(before[0], filtered[0], around, innovations.lengths[0])]

    def _trimmed(self, peaks: PeakPasses, signals: list[Signal], seen_twice: list[Float],
                 bent: Float | None, plane: TangentPlane,
                 ) -> tuple[list[Signal], Trimmed | None]:
        """Signals without peaks, and what was taken of those that may have some, smoothed."""
        if not peaks.signals:
            return signals, None
        lights = [signals[s] for s in peaks.signals]
        self.buffer.store([dr.maximum(light.luminance, 0) for light in lights], gutters=True)
        lights, taken = peaks.trim(lights, seen_twice, bent, *peaks.window)
        trimmed = dict(zip(peaks.signals, lights, strict=True))
        return ([trimmed.get(s, signal) for s, signal in enumerate(signals)],
                self._through(peaks.wide, taken, plane))

    def _through(self, levels: list[Level], values: T, plane: TangentPlane,
                 *arguments: Any) -> T:
        """Values after these levels, of which later ones may be of the first planes alone."""
        form, planes, _ = flatten(values)
        for level in levels:
            self.buffer.store(planes[:level.count], gutters=True)
            planes[:level.count] = level.step(level.values, level.surfaces, plane, level.spacing,
                                              *arguments)
        return build(form, planes)


def _counted(noisy: NoisySignal) -> NoisySignal:
    """With how much a sparse signal's pixel counts in the place of its samples."""
    if noisy.samples is None:
        return noisy
    return noisy._replace(samples=dr.clip(noisy.samples, FEWEST_SAMPLES, 1))
