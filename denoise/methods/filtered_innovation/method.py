"""Our method, `onespp`: signals apart, each with a history that follows changes of light.

A frame's light is split into signals that have noise of their own kind (`inputs/signals.py`): the
visibility of lights, what glossy lobes reflect, and the rest, demodulated. The innovation of a
signal is the frame's value minus its reprojected history. Smoothed widely over the surface it says
how the light has changed, with little noise: history takes a share of it, the gain, and alpha of
what is left (`merging.py`); where it is large against the noise, history is cut short
(`change.py`). A last filter is for the eye alone and is not fed back (`output.py`).
All signals go through one pass a level, so that geometry is weighed once; but for glossy light
where a frame tells of layers (`inputs/layers.py`): it has guides, and so passes, of its own; and
for the light that balls of glass and metal send, which has edges that no guide tells: it is
filtered as what has a texture that is not known (`texture.py`).

Parameters were found by measurement: see `studies/tune.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.filters.atrous import BACKGROUND, LARGEST_LEVELS
from onespp.denoise.filters.facing_away import LARGEST_SHARE, colors_facing_away
from onespp.denoise.geometry.cameras import pixel_angle
from onespp.denoise.geometry.motion import at_rest
from onespp.denoise.history.records import RecordState, no_history
from onespp.denoise.history.reflections import lobes_between
from onespp.denoise.history.reprojection import ReprojectionTests, motion_between, without_images
from onespp.denoise.history.shadow_motion import SPREAD_LEVEL
from onespp.denoise.inputs.demodulation import Texture, read_texture
from onespp.denoise.inputs.layers import surface_of_gloss
from onespp.denoise.inputs.light_change import (
    LightChange,
    LightSample,
    change_of_lights,
    sample_light,
)
from onespp.denoise.inputs.path_hits import Hits, read_hits
from onespp.denoise.inputs.shadow_rays import (
    ShadowRays,
    has_shadow_rays,
    read_shadow_rays,
    share_of_moving_lights,
)
from onespp.denoise.inputs.signals import (
    USED,
    Chosen,
    Signal,
    SignalKind,
    Signals,
    read_signals,
)
from onespp.denoise.inputs.surface import Surface, TangentPlane, read_surface
from onespp.denoise.jit.arrays import Bool, Color, Float, Vector3
from onespp.denoise.jit.fastmath import LOG2E
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.methods.base import OnLanes
from onespp.denoise.methods.parameters import (
    INNOVATION_RENAMED,
    check_positive,
    check_range,
    check_whole,
)
from onespp.render.channels import SHADOW
from onespp.render.frame import Frame

from .change import Doubts
from .layout import ENERGY_LEVELS, History, SignalLayout
from .merging import Gains
from .output import narrowed
from .passes import Passes
from .shadows import Surroundings, as_own_rays_say
from .texture import LEVELS, at_rest_between

_LAMP = 2 * BACKGROUND    # 1/z of what is `alone`: far from any plane, and from background
LARGE = 640**2            # pixels of an image whose last filter has a level more
_UNDER_MOVING_LIGHTS = 0.9  # `sharp_min_gain`
_IN_STILL_WORLD = 0.5     # times `min_gain`
_LIGHTS_AT_REST = 4.0     # times `noise_threshold`, of diffuse light
_PATTERN_LEVELS = 2, 2    # of light by way of balls: `innovation_levels`, `output_levels`
_LEAST_SHARE = 1e-4       # that `expected_change` is divided by
_BACKGROUND_SCALE = 1e3   # of 1/z of background and lamps: only their like counts


@dataclass(frozen=True)
class InnovationState(RecordState[Passes]):
    """`RecordState`, that of glossy light where it is of other layers, and what the frame told of
    its lights; image: of `Surroundings`, smoothed. caustic: of light by way of balls."""

    layered: InnovationState | None = None
    caustic: InnovationState | None = None
    lights: LightSample | None = None
    image: Float | None = field(default=None, repr=False)


class _Given(NamedTuple):
    """Signals of one surface, and what is known of them.

    alone: where a surface reflects (almost) nothing, or faces away, and mixes with its like alone.
    roughness, lobe: as of `Signals`, where there is glossy light; its image is the sharper the less
    the former is, its history the longer the more the latter is. bare_lobe: the latter, 1 where
    something is diffuse. change: of the lights.
    """

    frame: Frame
    layout: SignalLayout
    signals: list[Signal]
    surface: Surface
    alone: Bool | None
    change: LightChange = LightChange()
    chosen: Chosen | None = None
    lit: Float | None = None
    rays: ShadowRays | None = None
    hits: Hits | None = None
    roughness: Float | None = None
    lobe: Float | None = None
    bare_lobe: Float | None = None


@dataclass(frozen=True)
class FilteredInnovation(OnLanes["RecordState[Passes]"]):
    """The filtered innovation of visibility, glossy and diffuse light.

    Attributes:
        light_alpha: least weight of the current frame in the high frequencies of diffuse and
            glossy light [1, 1e-6 to 1].
        visibility_alpha: the same of visibility [1, 1e-6 to 1].
        min_gain: least share of the smoothed innovation that the history of diffuse light takes,
            where that is free of noise; half of it where nothing moves and lights are known to be
            as they were, all of it where lights move, and where frames have albedo and no
            visibility [1, 1e-6 to 1].
        expected_change: how much diffuse light is expected to change from frame to frame; where
            the noise of the smoothed innovation is more than that, history takes less of it
            [share of the light, above 0].
        noise_threshold: a smoothed innovation whose square is below this many of its variances
            is taken for noise; fewer where lights move, and four times as many, of diffuse light on
            surfaces at rest, where they are known to be as they were [variances, 0 to 1e6].
        sharp_min_gain: as `min_gain`, of visibility; less where shadows stand still, up to 0.9
            where lights move, see `innovation.py` [1, 1e-6 to 1].
        glossy_gain: share of the smoothed innovation that the history of glossy light takes;
            less where mirror directions stand still, up to all where what they show moves
            [1, 1e-6 to 1].
        change_alpha: weight of the current frame in the high frequencies of visibility where a
            change of the low ones is certain [1, 0 to 1].
        light_change: how soon a change forgets the history of diffuse light: the squared change
            counts so many times against the noise of a frame, see `change.py`; 0: not at all
            [1, 0 to 1e6].
        glossy_change: the same of glossy light [1, 0 to 1e6].
        visibility_change: the same of visibility [1, 0 to 1e6].
        innovation_levels: levels of the innovation's smoothing, of diffuse light [1, 2 to 8].
        output_levels: levels of the last filter of diffuse light while there is no history; the
            last of them fades out over `fade_frames` [1, 1 to 8]. Large images (`LARGE`) have
            one more, and what is noisy still in scenes with glossy surfaces, if it is not farther
            than that of the innovation.
        sharp_innovation_levels: as `innovation_levels`, of visibility and glossy light, and no
            more than those [1, 2 to 8].
        sharp_output_levels: as `output_levels`, of visibility and glossy light, and no more than
            those [1, 1 to 8].
        light_sigma: falloff of the last filter with difference of luminance, of diffuse and
            glossy light [standard deviations, above 0].
        texture_sigma: the same of light whose texture is not known, see `texture.py`
            [standard deviations, above 0].
        visibility_sigma: the same of visibility [standard deviations, above 0].
        mirror_sigma: the same of what mirrors reflect, at most `light_sigma`; between the two
            where lobes are narrow [standard deviations, above 0].
        fade_frames: history length at which the last level has faded out, but for glossy light
            [frames, above 0].
        plane_pixels: falloff with distance from the tangent plane [widths of a pixel there,
            above 0].
        max_history_length: cap of the history length [frames, 1 to 1e6].
        min_cosine: least cosine between a history tap's normal and the expected one, see
            `reprojection.py` [1, -1 to 1].
        plane_tolerance: largest distance of a history tap from the expected tangent plane
            [share of depth, above 0].
        demodulate: filter diffuse light over albedo, where frames have albedo.
        gloss: glossy light as a signal of its own, where frames have it.
        penumbra: standard deviation of a level of visibility's filters, at most
            [widths of the penumbra, above 0].
        follow_shadows: a second history of visibility where the shadow was, and `penumbra`;
            where frames have shadow rays.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = FilteredInnovation(light_alpha=0.1)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    light_alpha: float = 0.05
    visibility_alpha: float = 0.15
    min_gain: float = 0.8
    expected_change: float = 0.15
    noise_threshold: float = 8.0
    sharp_min_gain: float = 0.75
    glossy_gain: float = 0.6
    change_alpha: float = 0.6
    light_change: float = 12.0
    glossy_change: float = 4.0
    visibility_change: float = 8.0
    innovation_levels: int = 5
    output_levels: int = 4
    sharp_innovation_levels: int = 3
    sharp_output_levels: int = 3
    light_sigma: float = 6.0
    texture_sigma: float = 3.5
    visibility_sigma: float = 5.0
    mirror_sigma: float = 1.6
    fade_frames: float = 8.0
    plane_pixels: float = 0.8
    max_history_length: float = 64.0
    min_cosine: float = 0.5
    plane_tolerance: float = 0.02
    demodulate: bool = True
    gloss: bool = True
    penumbra: float = 0.6
    follow_shadows: bool = True

    uses: ClassVar[tuple[str, ...]] = (*USED, *SHADOW, "hit_distance", "hit_id")
    renamed: ClassVar[Mapping[str, str]] = INNOVATION_RENAMED

    def __post_init__(self) -> None:
        for name, least in (("innovation_levels", ENERGY_LEVELS), ("output_levels", 1)):
            check_whole(self, name, LARGEST_LEVELS, least)
            check_whole(self, f"sharp_{name}", getattr(self, name), least)
        for name in ("light_alpha", "visibility_alpha", "min_gain", "sharp_min_gain",
                     "glossy_gain"):
            check_range(self, name, 1e-6, 1.0)
        check_range(self, "change_alpha", 0.0, 1.0)
        for name in ("noise_threshold", "light_change", "glossy_change", "visibility_change"):
            check_range(self, name, 0.0, 1e6)
        check_range(self, "max_history_length", 1.0, 1e6)
        check_range(self, "min_cosine", -1.0, 1.0)
        check_positive(self, "expected_change", "light_sigma", "texture_sigma", "visibility_sigma",
                       "mirror_sigma", "fade_frames", "plane_pixels", "penumbra", "plane_tolerance")

    @property
    def reach(self) -> int:
        return 1 << max(self.innovation_levels - 1, self.output_levels - 1, SPREAD_LEVEL)

    def init_on(self, stencil: Stencil) -> InnovationState:
        return InnovationState(stencil, no_history(stencil))

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: RecordState[Passes]) -> tuple[Color, RecordState[Passes]]:
        """`color` is used where the frame has no direct and indirect light."""
        assert isinstance(state, InnovationState)
        stencil, previous = state.stencil, state.previous or frame
        of_gloss = surface_of_gloss(frame) if self.gloss else None
        light = read_signals(frame, color, stencil, self.demodulate, self.gloss, of_gloss)
        rays, hits = None, None
        if self.follow_shadows and light.unshadowed and has_shadow_rays(frame):
            rays = read_shadow_rays(frame, previous, stencil)
            hits = read_hits(frame, previous, stencil)
        change, lights = LightChange(), None
        if light.unshadowed:
            change = change_of_lights(state.lights, previous, frame)
            lights = sample_light(frame)
        layout = self._layout(light, rays is not None, stencil)
        bare_lobe = None
        if light.lobe is not None and light.is_bare is not None:
            bare_lobe = dr.select(light.is_bare, light.lobe, 1)
        alone, away = light.texture.zero_albedo, None
        if light.unshadowed:  # by Mitsuba, whose silhouettes are so
            away = _facing_away(surface, light.texture, stencil)
        if away is not None:
            alone = away > 0 if alone is None else alone | (away > 0)

        by_balls, of_caustic = None, None
        if light.caustic is not None:
            color = Color(*[c - k for c, k in zip(color, light.by_balls(light.caustic))])
            (filtered,), _, of_caustic = self._filtered(
                _Given(frame, _of_pattern(), [light.caustic], surface, alone),
                state.caustic or self.init_on(stencil))
            by_balls = light.by_balls(filtered)
        state = replace(state, caustic=of_caustic)

        def finished(output: list[Signal], own: Surroundings, after: InnovationState) -> Color:
            if own.contact is None:
                image = light.color(output)
            else:
                assert after.passes is not None
                image = as_own_rays_say(light, output, color, own,
                                        after.passes.black_lines(color, own.contact))
            if by_balls is not None:
                image = Color(*[c + k for c, k in zip(image, by_balls)])
            return _dark_facing_away(image, frame, away, stencil)

        if of_gloss is None or SignalKind.GLOSSY not in layout.kinds:
            output, own, after = self._filtered(_Given(
                frame, layout, light.listed, surface, alone, change, light.chosen, light.lit, rays,
                hits, light.roughness, light.lobe, bare_lobe), state)
            return finished(output, own, after), replace(after, layered=None, lights=lights)
        signals, glossy = list(light.listed), layout.kinds.index(SignalKind.GLOSSY)
        rest, only_gloss = layout.without_gloss()
        (gloss,), _, layered = self._filtered(_Given(
            of_gloss, only_gloss, [signals.pop(glossy)], read_surface(of_gloss, stencil),
            read_texture(of_gloss, stencil, self.demodulate).zero_albedo, change, hits=hits,
            roughness=light.roughness, lobe=light.lobe), state.layered or self.init_on(stencil))
        output, own, after = self._filtered(_Given(
            frame, rest, signals, surface, alone, change, light.chosen, light.lit, rays, hits),
            state)
        output.insert(glossy, gloss)
        return finished(output, own, after), replace(after, layered=layered, lights=lights)

    def _filtered(self, given: _Given, state: InnovationState,
                  ) -> tuple[list[Signal], Surroundings, InnovationState]:
        """Signals that have one surface, filtered, and what each pixel's own rays met."""
        frame, signals, surface, chosen = given.frame, given.signals, given.surface, given.chosen
        stencil, previous, sample = state.stencil, state.previous or frame, surface.sample
        layout, rays = given.layout, given.rays
        moving_lights = 0.0 if rays is None else share_of_moving_lights(previous, frame)
        motion = motion_between(previous, frame, stencil)
        plane = self._tangent_plane(frame, surface, given.alone, stencil)
        passes, records = state.passes, state.records
        if passes is None:
            passes = Passes.make(stencil, layout)
            records = no_history(stencil, layout.record_values)
        passes.layout.check(frame, layout)
        id_ = stencil.Float(sample.id)
        lobes, narrower = None, None
        if given.roughness is not None and given.lobe is not None:
            lobes = lobes_between(previous, frame, given.lobe, surface.position, stencil)
            narrower = narrowed(given.roughness,
                                stencil.opaque(min(self.mirror_sigma / self.light_sigma, 1)))
        roughness = None
        if SignalKind.GLOSSY in layout.kinds:
            roughness = stencil.opaque(1) if given.roughness is None else given.roughness
        evaluate(signals, given.lit, sample, plane, id_,
                 (rays, given.hits, surface.position, roughness) if rays else None, chosen, lobes,
                 narrower, given.bare_lobe)

        plane = passes.store_surface(id_, plane)
        if given.lit is not None:
            signals = passes.with_visibility_of_unlit(signals, given.lit, plane)
        bends = passes.bends(sample.normal, given.bare_lobe)
        own, around = passes.surroundings(rays, given.hits, sample, surface.position, plane,
                                          chosen, roughness)
        before = state.image
        if before is None and around.image is not None:
            before = stencil.constant(0)
        innovations = passes.find_innovations(
            signals, chosen, sample, plane, motion, records, around, before,
            *self._reprojection_parameters(stencil), lobes,
            at_rest_between(previous, frame, stencil) if layout.has_texture else None,
            Vector3(*(stencil.opaque(ratio) for ratio in given.change.ratio)))
        innovations = passes.choose_histories(innovations, plane)
        signals, innovations = passes.without_peaks_of_frame(signals, innovations, given.roughness,
                                                             plane)
        smoothed = passes.smooth_innovations(innovations, plane)
        merged = passes.merge(signals, innovations, chosen, smoothed, plane,
                              self._gains(given, stencil, moving_lights,
                                          bool(at_rest(previous, frame).all())))
        output = passes.filter_output(merged, innovations, plane, self._sigmas(stencil, layout),
                                      narrower, bends)
        records = passes.pack(sample, History(merged.lengths, merged.signals),
                              output if layout.groups else None)
        return output, own, replace(state, passes=passes, records=records, image=around.image,
                                    previous=without_images(frame))

    def _layout(self, light: Signals, has_shadow_rays: bool, stencil: Stencil) -> SignalLayout:
        has_texture = light.texture.albedo is None and len(light.kinds) == 1
        levels = min(self.innovation_levels, LEVELS) if has_texture else self.innovation_levels
        wider = int(stencil.height * stencil.width > LARGE
                    and self.output_levels < self.innovation_levels)
        return SignalLayout(light.kinds, light.groups, has_shadow_rays, levels,
                            min(self.sharp_innovation_levels, levels), self.output_levels + wider,
                            self.sharp_output_levels + wider, has_texture,
                            SignalKind.GLOSSY in light.kinds)  # by whose way lamps are met

    def _tangent_plane(self, frame: Frame, surface: Surface, alone: Bool | None,
                       stencil: Stencil) -> TangentPlane:
        """Tangent planes in 1/z. Where there is none (background, lamps) 1/z is far from any other
        and the scale so large that such pixels blend with their like alone."""
        is_valid = surface.is_valid
        inverse_depth = dr.select(is_valid, surface.inverse_depth, stencil.Float(BACKGROUND))
        scale = dr.abs(surface.plane_distance) * stencil.opaque(
            1 / (self.plane_pixels * pixel_angle(frame)))
        if alone is not None:
            inverse_depth = dr.select(is_valid & alone, _LAMP, inverse_depth)
            is_valid = is_valid & ~alone
        scale = dr.select(is_valid, scale, stencil.Float(_BACKGROUND_SCALE))
        dx, dy = (dr.select(is_valid, slope, 0) for slope in surface.slope)
        return TangentPlane(inverse_depth, dx, dy, scale)

    def _reprojection_parameters(self, stencil: Stencil) -> tuple[ReprojectionTests, Float, Float]:
        """Tests of history, its length, and the scale of `penumbra.footprint_falloff`."""
        tests = ReprojectionTests(stencil.opaque(self.min_cosine),
                                  stencil.opaque(self.plane_tolerance))
        return (tests, stencil.opaque(self.max_history_length),
                stencil.opaque(LOG2E / (2 * self.penumbra**2)))

    def _gains(self, given: _Given, stencil: Stencil, moving_lights: float,
               is_still: bool) -> Gains:
        """is_still: nothing has moved."""
        layout, lights = given.layout, given.change
        alphas = layout.each(self.light_alpha, self.visibility_alpha)
        change = {SignalKind.DIFFUSE: self.light_change, SignalKind.GLOSSY: self.glossy_change,
                  SignalKind.VISIBILITY: self.visibility_change}
        # Without visibility apart, diffuse light has the shadows in it, which are quick: it follows
        # as where all lights move.
        is_quick = (SignalKind.DIFFUSE in layout.kinds and not layout.has_texture
                    and SignalKind.VISIBILITY not in layout.kinds)
        m = 1 if is_quick else min(2 * moving_lights, 1)
        rests, sharp = lights.rests and m == 0, self.sharp_min_gain
        gain = self.min_gain * (_IN_STILL_WORLD if rests and is_still else 1)
        threshold = self.noise_threshold * (1 - m / 2)
        doubts = Doubts(stencil.opaque(threshold * (_LIGHTS_AT_REST if rests else 1)),
                        stencil.opaque(threshold),
                        [stencil.opaque(change[kind]) for kind in layout.kinds],
                        stencil.opaque(lights.renewal))
        return Gains([stencil.opaque(alpha) for alpha in alphas],
                     stencil.opaque(gain + m * (1 - gain)),
                     stencil.opaque(self.expected_change / max(1 - m, _LEAST_SHARE)),
                     stencil.opaque(sharp + m * max(_UNDER_MOVING_LIGHTS - sharp, 0)),
                     stencil.opaque(self.glossy_gain), stencil.opaque(self.change_alpha),
                     stencil.opaque(self.fade_frames), doubts)

    def _sigmas(self, stencil: Stencil, layout: SignalLayout) -> list[Float]:
        """As the exponents of the last filter want them."""
        return [stencil.opaque(math.sqrt(LOG2E) / sigma)
                for sigma in layout.each(self.texture_sigma if layout.has_texture
                                         else self.light_sigma, self.visibility_sigma)]


def _of_pattern() -> SignalLayout:
    """Of light by way of balls: a small pattern that no guide tells, as if it were a texture."""
    innovation, output = _PATTERN_LEVELS
    return SignalLayout((SignalKind.DIFFUSE,), 0, False, innovation, innovation, output, output,
                        has_texture=True)


def _facing_away(surface: Surface, texture: Texture, stencil: Stencil) -> Float | None:
    """1 where what has a diffuse lobe has a normal that faces away from the camera, else 0,
    evaluated; None where none does, or too many do."""
    there = surface.is_valid & (surface.plane_distance > 0)
    if texture.albedo is not None:
        red, green, blue = texture.albedo
        there &= (red < 1) | (green < 1) | (blue < 1)
    away = dr.select(there, stencil.Float(1), 0)
    dr.eval(away)
    share = float(dr.sum(away)[0]) / stencil.lanes
    return away if 0 < share < LARGEST_SHARE else None


def _dark_facing_away(image: Color, frame: Frame, away: Float | None, stencil: Stencil) -> Color:
    """`colors_facing_away` in their places; away: of `_facing_away`."""
    if away is None:
        return image
    mask = stencil.rows(away.numpy()) > 0
    own = colors_facing_away(frame["color"], frame["id"], mask)
    row, column = np.divmod(np.flatnonzero(mask), stencil.width)
    lanes = stencil.UInt((row * stencil.stride + column).astype(np.uint32))
    dr.eval(image)
    for c, values in zip(image, own.T, strict=True):
        dr.scatter(c, stencil.Float(np.ascontiguousarray(values)), lanes)
    return image
