"""Spatiotemporal variance-guided filtering (SVGF) as published.

Direct and indirect light without texture are accumulated with the history of the same surface
(`history.py`), their variance is estimated over time (`moments.py`), and an a-trous filter guided
by it removes what noise is left (`wavelet.py`). The first level's output is the next frame's
history.

Source: Schied et al. 2017, "Spatiotemporal variance-guided filtering: real-time reconstruction for
path-traced global illumination", doi:10.1145/3105762.3105770. Defaults are its constants;
`max_history_length` is 32 in NVIDIA's pass.

Departures, beside those that the three modules list:
- A frame without direct and indirect light (an import) is one signal, its colour.
- No tone mapping and no temporal anti-aliasing after the filter: scores compare radiance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from render.frame import Frame

from .arrays import Color, Float
from .atrous import EPSILON, LARGEST_LEVELS, LOG2E, luminance_scale, with_green
from .demodulation import Texture, read_texture
from .history import RecordState, no_history, pack_records
from .lanes import OnLanes
from .moments import SHORT, accumulate, estimate_variances
from .parameters import HISTORY_RENAMED, check_positive, check_range, check_whole
from .reprojection import Motion, motion_between, without_images
from .sparse import tabulate
from .stencil import Planes, Stencil, Step, Taps, window
from .structure import evaluate
from .surface import Surface, SurfaceSample, luminance, repair
from .wavelet import OUTSIDE, filter_level, read_guides

SIGNALS = ("direct", "indirect")


@dataclass(frozen=True)
class Svgf(OnLanes):
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

    def init_on(self, stencil: Stencil) -> RecordState:
        return RecordState(stencil, no_history(stencil))

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: Any) -> tuple[Color, Any]:
        """`color` is used where the frame is one signal."""
        lights, texture = self.read_lights(frame, color, state.stencil)
        filtered, state = self.filter_lights(frame, lights, surface, state, [])
        return texture.modulate(added_up(filtered)), state

    def read_lights(self, frame: Frame, color: Color,
                    stencil: Stencil) -> tuple[list[Color], Texture]:
        """The signals, (r, g, b) each, and what was taken out of their sum."""
        texture = read_texture(frame, stencil, self.demodulate)
        if not self.split or not all(name in frame for name in SIGNALS):
            return [texture.demodulate(color)], texture
        direct, indirect, emission = (
            Color(*stencil.load(repair(np.asarray(frame[name], np.float32), frame["id"])))
            if name in frame else None for name in (*SIGNALS, "emission"))
        plain = Texture(texture.albedo)
        return ([plain.demodulate(light) for light in (direct, indirect) if light],
                Texture(texture.albedo, emission))

    def alphas(self, count: int) -> list[float]:
        """alpha of each signal."""
        return [self.alpha] * count

    def filter_lights(self, frame: Frame, lights: Sequence[Color], surface: Surface,
                      state: Any, changes: list[Float]) -> tuple[list[Color], Any]:
        """Each signal (r, g, b) filtered, and the state for the next frame.

        changes: lambda of each signal (see `moments.py`), or none.
        """
        stencil = state.stencil
        motion = motion_between(state.previous or frame, frame, stencil)
        passes = state.passes
        if passes is None or len(passes.filters) != len(lights):
            passes = Passes.make(self, stencil, len(lights))
        signal = [c for r, g, b in lights for c in (r, luminance([r, g, b]), b)]
        near = surface.sample
        guides = read_guides(stencil, surface, self.sigma_depth)
        evaluate(signal, near, guides)
        passes.guides.store(guides[:4])
        numbers = [stencil.opaque(x) for x in (self.alpha_moments, self.max_history_length,
                                               self.min_cosine, self.plane_tolerance)]
        colors, moments, lengths, window = passes.accumulate(
            signal, near, motion, state.records, guides, changes,
            [stencil.opaque(a) for a in self.alphas(len(lights))], numbers)
        half_power = stencil.opaque(LOG2E * self.normal_power / 2)
        enough = stencil.opaque(SHORT if self.temporal_variance
                                else 2 * self.max_history_length + 1)
        variances = passes.estimate(moments, lengths, guides, [window], [half_power, enough])
        numbers = [stencil.opaque(EPSILON), stencil.opaque(self.sigma_luminance / LOG2E),
                   half_power]
        lights, kept = [], []
        for s, part in enumerate(passes.filters):
            given = [*colors[3 * s:3 * s + 3], variances[s]]
            first, last = part.apply(given, guides, numbers)
            lights.append(with_green(last))
            kept += (first if self.feedback else given)[:3]
        records = state.records
        if self.accumulate:
            records = passes.pack(near, kept, moments, lengths)
        return lights, replace(state, passes=passes, records=records,
                               previous=without_images(frame))


def added_up(lights: Sequence[Color]) -> Color:
    """The sum of signals, (r, g, b) each."""
    total = lights[0]
    for light in lights[1:]:
        total = Color(*[a + b for a, b in zip(total, light)])
    return total


@dataclass(frozen=True)
class Passes:
    """Planes of the guides (n, z), the recorded steps, and a filter for each signal."""

    guides: Planes
    accumulate: Step[..., Any]
    estimate: Step[..., Any]
    filters: list[Levels]
    pack: Step[..., Any]

    @staticmethod
    def make(method: Svgf, stencil: Stencil, count: int) -> Passes:
        guides = stencil.planes(OUTSIDE)

        def blend(signal: list[Float], surface: SurfaceSample, motion: Motion,
                  records: Float, guides: list[Float], *rest: list[Float]) -> Any:
            colors, moments, lengths = accumulate(stencil, method.fallback, signal, surface,
                                                  motion, records, *rest)
            window = tabulate(stencil, [*moments, *guides[:4]])
            evaluate(colors, moments, lengths, window)
            return colors, moments, lengths, window

        def estimate(*arguments: Any) -> list[Float]:
            return estimate_variances(stencil, *arguments)

        def pack(surface: SurfaceSample, colors: list[Float], moments: list[Float],
                 lengths: list[Float]) -> Float:
            values = [c for s in range(count)
                      for c in (*colors[3 * s:3 * s + 3], *moments[2 * s:2 * s + 2])]
            return pack_records(stencil, surface, [*lengths, *values])

        return Passes(guides, Step(blend), Step(estimate),
                     [Levels.make(stencil, guides, method.levels) for _ in range(count)],
                     Step(pack))


@dataclass(frozen=True)
class Levels:
    """The a-trous filter of one signal: its planes (r, l, b, v), their taps and the steps."""

    signal: Planes
    blur_taps: Taps
    level_taps: list[tuple[Taps, Taps]]
    spacings: list[Float]
    scale_steps: list[Step[..., Any]]
    level_steps: list[Step[..., Any]]

    @staticmethod
    def make(stencil: Stencil, guides: Planes, levels: int) -> Levels:
        signal = stencil.planes([0.0] * 4)
        taps = []
        for i in range(levels):
            offsets = [(dy << i, dx << i) for dy, dx in window(2)]
            taps.append((signal.taps(offsets), guides.taps(offsets)))
        return Levels(signal, signal.taps(window(1), [3]), taps,
                      [stencil.opaque(1 << i) for i in range(levels)],
                      [Step(luminance_scale) for _ in taps], [Step(filter_level) for _ in taps])

    def apply(self, signal: list[Float], guides: list[Float],
              numbers: list[Float]) -> tuple[list[Float], list[Float]]:
        """What the first and the last level give; numbers: eps, sigma_luminance, half_power."""
        first = signal
        for i, taps in enumerate(self.level_taps):
            self.signal.store(signal)
            scale = self.scale_steps[i](self.blur_taps, signal[3:], numbers)
            signal = self.level_steps[i](*taps, signal, guides, [scale],
                                         [self.spacings[i], numbers[2]])
            first = signal if i == 0 else first
        return first, signal
