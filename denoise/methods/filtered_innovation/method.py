"""Our method, `onespp`: signals apart, each with a history that follows changes of light.

A frame's light is split into what has noise of its own kind (`signals.py`): the visibility of
lights, what glossy lobes reflect, and the rest, all without texture. Each signal is merged with
its history by the filtered innovation and then filtered once more, to be looked at, not to be kept
(`innovation.py`). All signals go through one pass a level, so that geometry is weighed once.

Parameters were found by measurement: see `tune.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import drjit as dr

from onespp.denoise.history.records import RecordState, no_history
from onespp.denoise.history.reprojection import ReprojectionTests, motion_between, without_images
from onespp.denoise.history.shadow_motion import SPREAD_LEVEL
from onespp.denoise.inputs.shadow_rays import has_shadow_rays, read_shadow_rays
from onespp.denoise.inputs.signals import USED, SignalKind, read_signals
from onespp.denoise.inputs.surface import Surface, TangentPlane
from onespp.denoise.jit.arrays import Bool, Color, Float
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.methods.atrous import BACKGROUND, LARGEST_LEVELS, LOG2E
from onespp.denoise.methods.base import OnLanes
from onespp.denoise.methods.parameters import (
    INNOVATION_RENAMED,
    check_positive,
    check_range,
    check_whole,
)
from onespp.render.channels import SHADOW
from onespp.render.frame import Frame

from .layout import ENERGY_LEVELS, History, SignalLayout
from .merging import Gains
from .passes import Passes

_BLACK = 2 * BACKGROUND   # 1/z of a surface that reflects nothing: a lamp
_BACKGROUND_SCALE = 1e3   # |k| / sigma_plane of background and lamps, whose like alone count


@dataclass(frozen=True)
class FilteredInnovation(OnLanes["RecordState[Passes]"]):
    """The filtered innovation of visibility, glossy and diffuse light.

    Attributes:
        light_alpha, visibility_alpha: least weight of the current frame in high frequencies.
        min_gain: least share of the smoothed innovation that diffuse light takes, above 0 to 1;
            all of it where frames have no visibility.
        noise_threshold: how many variances of it count as noise.
        sharp_min_gain: least share of it that visibility and glossy light take.
        change_alpha: weight of the current frame in visibility's high frequencies where the change
            of the low ones is certain.
        innovation_levels, output_levels: of diffuse light, levels of the innovation's smoothing,
            and of the last filter while there is no history; the last of these fades out over
            `fade_frames` frames.
        sharp_innovation_levels, sharp_output_levels: the same of visibility and of glossy light.
        light_sigma, visibility_sigma: of luminance in the last filter, standard deviations.
        sigma_plane: distance from the tangent plane over depth.
        max_history_length: frames.
        min_cosine, plane_tolerance: tests of history, see `reprojection.py`.
        demodulate: filter diffuse light without texture, where frames have albedo.
        gloss: glossy light as a signal of its own, where frames have it.
        penumbra: reach of the smoothing of visibility, and of its last filter: a level's standard
            deviation in widths of the penumbra.
        follow_shadows: visibility's history where the shadow was, and `penumbra`; where frames
            have shadow rays.
    """

    light_alpha: float = 0.05
    visibility_alpha: float = 0.15
    min_gain: float = 0.55
    noise_threshold: float = 4.0
    sharp_min_gain: float = 0.75
    change_alpha: float = 0.6
    innovation_levels: int = 5
    output_levels: int = 4
    sharp_innovation_levels: int = 3
    sharp_output_levels: int = 3
    light_sigma: float = 8.0
    visibility_sigma: float = 6.0
    fade_frames: float = 4.0
    sigma_plane: float = 0.005
    max_history_length: float = 64.0
    min_cosine: float = 0.5
    plane_tolerance: float = 0.02
    demodulate: bool = True
    gloss: bool = True
    penumbra: float = 0.6
    follow_shadows: bool = True

    uses: ClassVar[tuple[str, ...]] = (*USED, *SHADOW)
    renamed: ClassVar[Mapping[str, str]] = INNOVATION_RENAMED

    def __post_init__(self) -> None:
        for name, least in (("innovation_levels", ENERGY_LEVELS), ("output_levels", 1)):
            check_whole(self, name, LARGEST_LEVELS, least)
            check_whole(self, f"sharp_{name}", getattr(self, name), least)
        for name in ("light_alpha", "visibility_alpha", "min_gain", "sharp_min_gain"):
            check_range(self, name, 1e-6, 1.0)
        check_range(self, "change_alpha", 0.0, 1.0)
        check_range(self, "noise_threshold", 0.0, 1e6)
        check_range(self, "max_history_length", 1.0, 1e6)
        check_range(self, "min_cosine", -1.0, 1.0)
        check_positive(self, "light_sigma", "visibility_sigma", "fade_frames", "sigma_plane",
                       "penumbra", "plane_tolerance")

    @property
    def reach(self) -> int:
        return 1 << max(self.innovation_levels - 1, self.output_levels - 1, SPREAD_LEVEL)

    def init_on(self, stencil: Stencil) -> RecordState[Passes]:
        return RecordState(stencil, no_history(stencil))

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: RecordState[Passes]) -> tuple[Color, RecordState[Passes]]:
        """`color` is used where the frame has no direct and indirect light."""
        stencil, previous, sample = state.stencil, state.previous or frame, surface.sample
        motion = motion_between(previous, frame, stencil)
        light = read_signals(frame, color, stencil, self.demodulate, self.gloss)
        signals, plane = light.listed, self._tangent_plane(surface, light.texture.black, stencil)
        rays = None
        if self.follow_shadows and light.unshadowed and has_shadow_rays(frame):
            rays = read_shadow_rays(frame, previous, stencil)
        layout = self._layout(light.kinds, rays is not None)
        passes = state.passes or Passes.make(stencil, layout)
        passes.layout.check(frame, layout)
        id_ = stencil.Float(sample.id)
        evaluate(signals, sample, plane, id_, (rays, surface.position) if rays else None)

        passes.store_surface(id_, plane)
        shadows = passes.spread_shadows(rays, sample, surface.position, plane)
        found = passes.innovations(signals, sample, plane, motion, state.records, shadows,
                                   *self._limits(stencil))
        smoothed = passes.smooth_innovations(found, plane)
        merged = passes.merge(signals, found, smoothed, plane, self._gains(stencil, layout))
        output = passes.filter_output(merged, found, plane, self._sigmas(stencil, layout))
        records = passes.pack(sample, History(found.length, merged.signals))
        return light.color(output), replace(state, passes=passes, records=records,
                                            previous=without_images(frame))

    def _layout(self, kinds: tuple[SignalKind, ...], has_shadow_rays: bool) -> SignalLayout:
        return SignalLayout(kinds, has_shadow_rays, self.innovation_levels,
                            self.sharp_innovation_levels, self.output_levels,
                            self.sharp_output_levels)

    def _tangent_plane(self, surface: Surface, black: Bool | None,
                       stencil: Stencil) -> TangentPlane:
        """Of each pixel; lamps, which are black, and background are far away."""
        is_valid = surface.is_valid
        inverse_depth = dr.select(is_valid, surface.inverse_depth, stencil.Float(BACKGROUND))
        scale = dr.abs(surface.plane_distance) * stencil.opaque(1 / self.sigma_plane)
        if black is not None:
            inverse_depth = dr.select(is_valid & black, _BLACK, inverse_depth)
            is_valid &= ~black
        scale = dr.select(is_valid, scale, stencil.Float(_BACKGROUND_SCALE))
        dx, dy = (dr.select(is_valid, slope, 0) for slope in surface.slope)
        return TangentPlane(inverse_depth, dx, dy, scale)

    def _limits(self, stencil: Stencil) -> tuple[ReprojectionTests, Float, Float]:
        """Tests of history, its length, and the scale of `penumbra.footprint_falloff`."""
        tests = ReprojectionTests(stencil.opaque(self.min_cosine),
                                  stencil.opaque(self.plane_tolerance))
        return (tests, stencil.opaque(self.max_history_length),
                stencil.opaque(LOG2E / (2 * self.penumbra**2)))

    def _gains(self, stencil: Stencil, layout: SignalLayout) -> Gains:
        alphas = layout.each(self.light_alpha, self.visibility_alpha)
        # Without visibility apart, diffuse light has the shadows in it, which are quick.
        min_gain = self.min_gain if SignalKind.VISIBILITY in layout.kinds else 1.0
        return Gains([stencil.opaque(alpha) for alpha in alphas], stencil.opaque(min_gain),
                     stencil.opaque(self.noise_threshold), stencil.opaque(self.sharp_min_gain),
                     stencil.opaque(self.change_alpha), stencil.opaque(self.fade_frames))

    def _sigmas(self, stencil: Stencil, layout: SignalLayout) -> list[Float]:
        """As the exponents of the last filter want them."""
        return [stencil.opaque(math.sqrt(LOG2E) / sigma)
                for sigma in layout.each(self.light_sigma, self.visibility_sigma)]


_ID, _INVERSE_DEPTH, _VALID_INVERSE_DEPTH = range(3)  # planes of the surface
