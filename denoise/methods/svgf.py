"""Spatiotemporal variance-guided filtering (SVGF) as published.

Direct and indirect light without texture are accumulated with the history of the same surface
(`history/records.py`), their variance is estimated over time (`svgf_accumulation.py`), and an
a-trous filter guided by it removes what noise is left (`filters/svgf_level.py`). The first level's
output is the next frame's history.

Source: Schied et al. 2017, "Spatiotemporal variance-guided filtering: real-time reconstruction for
path-traced global illumination", doi:10.1145/3105762.3105770. Defaults are its constants;
`max_history_length` is 32 in NVIDIA's pass.

Departures, beside those that these modules list:
- A frame without direct and indirect light (an import) is one signal, its colour.
- No tone mapping and no temporal anti-aliasing after the filter: scores compare radiance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from onespp.denoise.filters.atrous import (
    LARGEST_LEVELS,
    NoisyColor,
    luminance_scale,
    luminance_weight,
    noisy_color,
)
from onespp.denoise.filters.svgf_level import (
    OUTSIDE,
    Geometry,
    Guides,
    SvgfLevelWeights,
    filter_level,
    guides_of,
    read_geometry,
)
from onespp.denoise.history.records import RecordState, no_history, pack_records
from onespp.denoise.history.reprojection import (
    Motion,
    ReprojectionTests,
    motion_between,
    without_images,
)
from onespp.denoise.inputs.demodulation import Texture, read_texture
from onespp.denoise.inputs.repair import repair
from onespp.denoise.inputs.surface import Surface, SurfaceSample
from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.color import LuminanceColor, with_green, with_luminance
from onespp.denoise.jit.fastmath import LOG2E
from onespp.denoise.jit.grid import Planes, Stencil, single
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.taps import Taps, window
from onespp.render.frame import Frame

from .base import OnLanes
from .parameters import HISTORY_RENAMED, check_positive, check_range, check_whole
from .svgf_accumulation import (
    SHORT,
    Accumulated,
    AccumulationWeights,
    Refine,
    accumulate,
    estimate_variances,
    record_values,
    tabulate_moments,
)

SIGNALS = ("direct", "indirect")
_VARIANCE = 3  # which plane of a `NoisyColor`


@dataclass(frozen=True)
class Svgf(OnLanes["RecordState[Passes]"]):
    """Accumulation over frames, then an a-trous filter guided by the variance (SVGF).

    The switches (true or false) are the method's parts, each of which can be left out.

    Attributes:
        alpha: least weight of the current frame in colour [1, 1e-6 to 1].
        alpha_moments: least weight of the current frame in moments of luminance [1, 1e-6 to 1].
        max_history_length: cap of the history length [frames, 1 to 1e6].
        levels: wavelet levels; taps of the last are 2^(levels - 1) pixels apart [1, 1 to 8].
        sigma_luminance: falloff with difference of luminance [standard deviations, above 0].
        sigma_depth: falloff with depth relative to its screen-space slope [1, above 0].
        normal_power: exponent of the cosine between normals [1, above 0].
        min_cosine: least cosine between a history tap's normal and the expected one, see
            `reprojection.py` [1, -1 to 1].
        plane_tolerance: largest distance of a history tap from the expected tangent plane
            [share of depth, above 0].
        demodulate: filter colour over albedo, where frames have albedo.
        split: filter direct and indirect light separately.
        accumulate: use history.
        fallback: average 3x3 history pixels where no bilinear tap passes the tests.
        temporal_variance: variance from history where there are four frames of it, not always
            from a window.
        feedback: the first level's output becomes the history, not its input.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Svgf(levels=4, feedback=False)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    alpha: float = 0.2
    alpha_moments: float = 0.2
    max_history_length: float = 32.0
    levels: int = 5
    sigma_luminance: float = 4.0
    sigma_depth: float = 1.0
    normal_power: float = 128.0
    min_cosine: float = 0.9
    plane_tolerance: float = 0.02
    demodulate: bool = True
    split: bool = True
    accumulate: bool = True
    fallback: bool = True
    temporal_variance: bool = True
    feedback: bool = True

    uses: ClassVar[tuple[str, ...]] = SIGNALS
    renamed: ClassVar[Mapping[str, str]] = HISTORY_RENAMED
    refine: ClassVar[Refine | None] = None

    def __post_init__(self) -> None:
        check_whole(self, "levels", LARGEST_LEVELS)
        for name in ("alpha", "alpha_moments"):
            check_range(self, name, 1e-6, 1.0)
        check_range(self, "max_history_length", 1.0, 1e6)
        check_range(self, "min_cosine", -1.0, 1.0)
        check_positive(self, "sigma_luminance", "sigma_depth", "normal_power", "plane_tolerance")

    @property
    def reach(self) -> int:
        return 2 << (self.levels - 1)

    def init_on(self, stencil: Stencil) -> RecordState[Passes]:
        return RecordState(stencil, no_history(stencil))

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: RecordState[Passes]) -> tuple[Color, RecordState[Passes]]:
        """`color` is used where the frame is one signal."""
        stencil, sample = state.stencil, surface.sample
        motion = motion_between(state.previous or frame, frame, stencil)
        light = self.demodulate_light(frame, color, stencil)
        changes = self.shading_changes(frame, len(light.signals), state)
        geometry = read_geometry(stencil, surface, self.sigma_depth)
        weights = self._level_weights(stencil)
        passes, records = self._passes(state, len(light.signals), len(changes))
        evaluate(light.signals, sample, geometry)

        passes.guides.store(geometry.guides)
        accumulated, window_table = passes.accumulate(
            light.signals, sample, motion, records, geometry.guides, changes,
            self._accumulation_weights(stencil, len(light.signals)), self._tests(stencil),
            self.known(frame, surface, light, state))
        variances = passes.estimate_variances(accumulated, geometry, window_table,
                                              self._min_temporal_length(stencil),
                                              weights.normal_exponent)
        filtered = passes.filter_levels(accumulated, variances, geometry, weights)
        history = self._history(accumulated, filtered)
        records = passes.pack(sample, history) if self.accumulate else records
        return light.modulate(filtered.last_level), replace(
            state, passes=passes, records=records, previous=without_images(frame))

    def shading_changes(self, frame: Frame, count: int,
                        state: RecordState[Passes]) -> list[Float]:
        """Temporal gradient of each of `count` signals, 0 unchanged to 1 history discarded (see
        `svgf_accumulation.py`); none here, A-SVGF has them."""
        return []

    def alphas(self, count: int) -> list[float]:
        """alpha of each signal."""
        return [self.alpha] * count

    def known(self, frame: Frame, surface: Surface, light: Light,
              state: RecordState[Passes]) -> Any:
        """What `refine` is told of a frame, evaluated; nothing here."""
        return None

    def demodulate_light(self, frame: Frame, color: Color, stencil: Stencil) -> Light:
        """The frame's light without texture, direct and indirect apart where it has them."""
        texture = read_texture(frame, stencil, self.demodulate)
        if not self.split or not all(name in frame for name in SIGNALS):
            return Light([with_luminance(texture.demodulate(color))], texture)
        direct, indirect, emission = (
            Color(*stencil.load(repair(np.asarray(frame[name], np.float32), frame["id"])))
            if name in frame else None for name in (*SIGNALS, "emission"))
        plain = Texture(texture.albedo)
        return Light([with_luminance(plain.demodulate(light))
                      for light in (direct, indirect) if light],
                     Texture(texture.albedo, emission))

    def _passes(self, state: RecordState[Passes], count: int,
                lengths: int) -> tuple[Passes, Float]:
        """Of `count` signals, and records: made for the first frame, and where the number of
        signals changes."""
        if state.passes is None or len(state.passes.filters) != count:
            return (Passes.make(state.stencil, count, self.levels, self.fallback, self.refine),
                    no_history(state.stencil, record_values(count, max(lengths, 1))))
        return state.passes, state.records

    def _accumulation_weights(self, stencil: Stencil, count: int) -> AccumulationWeights:
        return AccumulationWeights([stencil.opaque(a) for a in self.alphas(count)],
                                   stencil.opaque(self.alpha_moments),
                                   stencil.opaque(self.max_history_length))

    def _tests(self, stencil: Stencil) -> ReprojectionTests:
        return ReprojectionTests(stencil.opaque(self.min_cosine),
                                 stencil.opaque(self.plane_tolerance))

    def _level_weights(self, stencil: Stencil) -> SvgfLevelWeights:
        return SvgfLevelWeights(luminance_weight(stencil, self.sigma_luminance),
                            stencil.opaque(LOG2E * self.normal_power / 2))

    def _min_temporal_length(self, stencil: Stencil) -> Float:
        """Length of history from which on its moments give the variance."""
        return stencil.opaque(SHORT if self.temporal_variance
                              else 2 * self.max_history_length + 1)

    def _history(self, accumulated: Accumulated, filtered: FilteredColors) -> Accumulated:
        """What the next frame blends with."""
        if not self.feedback:
            return accumulated
        return accumulated._replace(signals=[
            signal._replace(color=color)
            for signal, color in zip(accumulated.signals, filtered.first_level, strict=True)])


@dataclass(frozen=True)
class Light:
    """A frame's light as signals, traced and not yet evaluated.

    Attributes:
        texture: which they are without. has_specular: the last of them never had any.
    """

    signals: list[LuminanceColor]
    texture: Texture
    has_specular: bool = False

    def modulate(self, signals: Sequence[LuminanceColor]) -> Color:
        """The colour that filtered signals make."""
        lights = [with_green(signal) for signal in signals]
        bare = lights.pop() if self.has_specular else None
        total = self.texture.modulate(_sum(lights))
        return _sum([total, bare]) if bare else total


def _sum(lights: list[Color]) -> Color:
    total, *others = lights
    for light in others:
        total = Color(*[a + b for a, b in zip(total, light)])
    return total


class Blended(NamedTuple):
    """What is accumulated, and `tabulate_moments` of it."""

    accumulated: Accumulated
    window_table: Float


class FilteredColors(NamedTuple):
    """Each signal after the first level and after the last one."""

    first_level: list[LuminanceColor]
    last_level: list[LuminanceColor]


@dataclass(frozen=True)
class Passes:
    """The recorded steps, a filter for each signal, and the planes of `Guides` for all."""

    guides: Planes
    accumulate: Step[..., Blended]
    estimate_variances: Step[..., list[Float]]
    filters: list[Levels]
    pack: Step[..., Float]

    @staticmethod
    def make(stencil: Stencil, count: int, levels: int, fallback: bool,
             refine: Refine | None) -> Passes:
        guides = stencil.planes(OUTSIDE)

        def blend(signals: list[LuminanceColor], surface: SurfaceSample, motion: Motion,
                  records: Float, guides: Guides, changes: list[Float],
                  weights: AccumulationWeights, tests: ReprojectionTests, known: Any) -> Blended:
            accumulated = accumulate(stencil, fallback, refine, signals, surface, motion, records,
                                     changes, weights, tests, known)
            table = tabulate_moments(stencil, accumulated, guides)
            evaluate(accumulated, table)
            return Blended(accumulated, table)

        return Passes(guides, Step(blend), Step(lambda *a: estimate_variances(stencil, *a)),
                      [Levels.make(stencil, guides, levels) for _ in range(count)],
                      Step(lambda *a: pack_records(stencil, *a)))

    def filter_levels(self, accumulated: Accumulated, variances: list[Float], geometry: Geometry,
                      weights: SvgfLevelWeights) -> FilteredColors:
        """The a-trous filter of each signal."""
        first, last = [], []
        for levels, signal, variance in zip(self.filters, accumulated.signals, variances,
                                            strict=True):
            a, b = levels.filter(NoisyColor(signal.color, variance), geometry, weights)
            first.append(a.color)
            last.append(b.color)
        return FilteredColors(first, last)


@dataclass(frozen=True)
class Level:
    """A level's taps, their distance in pixels, and the recorded steps."""

    signal: Taps[NoisyColor]
    guides: Taps[Guides]
    spacing: Float
    scale: Step[..., Float]
    filter: Step[..., NoisyColor]

    @staticmethod
    def make(i: int, signal: Planes, guides: Planes) -> Level:
        """Level i."""
        offsets = [(dy << i, dx << i) for dy, dx in window(2)]
        return Level(signal.taps(offsets).named(noisy_color),
                     guides.taps(offsets).named(guides_of), signal.stencil.opaque(1 << i),
                     Step(luminance_scale), Step(filter_level))


@dataclass(frozen=True)
class Levels:
    """The a-trous filter of one signal: planes of a `NoisyColor`, the variance of the 3x3 pixels
    around, and the levels."""

    signal: Planes
    blur_taps: Taps[Float]
    levels: list[Level]

    @staticmethod
    def make(stencil: Stencil, guides: Planes, levels: int) -> Levels:
        signal = stencil.planes([0.0] * 4)
        return Levels(signal, signal.taps(window(1), [_VARIANCE]).named(single),
                      [Level.make(i, signal, guides) for i in range(levels)])

    def filter(self, noisy: NoisyColor, geometry: Geometry,
               weights: SvgfLevelWeights) -> tuple[NoisyColor, NoisyColor]:
        """What the first level and the last one give."""
        first = noisy
        for i, level in enumerate(self.levels):
            self.signal.store(noisy)
            scale = level.scale(self.blur_taps, noisy.variance, weights.luminance)
            noisy = level.filter(level.signal, level.guides, noisy, geometry, scale,
                                 level.spacing, weights.normal_exponent)
            first = noisy if i == 0 else first
        return first, noisy
