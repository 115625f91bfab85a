"""Renders frames of a scene: radiance and G-buffer from one primary hit, in one kernel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import drjit as dr
import numpy as np

from onespp.render.channels import (
    CAUSTIC,
    FRAME,
    GLOSS,
    GROUPED,
    LAYER,
    PATH,
    RADIANCE,
    REPLAY,
    SHADOW,
    SPLIT,
    SUN,
    UNSHADOWED,
)
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from onespp.render.host.turns import turn
from onespp.render.mitsuba.variant import check_variant, mi

from .camera_rays import camera_matrices
from .gbuffer import GBUFFER, PrimaryHit
from .lights.candidates import candidates_for
from .lights.resampling import NARROW
from .path import Radiance, sum_of_samples, trace
from .replacement import Replaced, replaced
from .replay import replay
from .sampler import FRAME_STREAM, REFERENCE_STREAM, Sampler, Sobol, keys_from_seed
from .view import Now, View

_TRACED = {*RADIANCE, *SPLIT, *SHADOW, *GROUPED, *GLOSS, *CAUSTIC, *PATH}
"""Channels that take more than the first hit."""


class Renderer(View):
    """A view of a scene, ready to render any of its frames in any order."""

    @property
    def channels(self) -> tuple[str, ...]:
        """All channels of its frames that are not the same in any scene of this kind."""
        return (FRAME + (SPLIT + SHADOW if self.splits else ()) + self._grouped
                + (GLOSS if self.stage.glossy else ()) + (CAUSTIC if self.balls else ())
                + (LAYER if self.stage.images.layered else ()))

    @property
    def _grouped(self) -> tuple[str, ...]:
        """The channels of groups that its frames have."""
        count = len(self.lights.sizes) if self.lights else 0
        return ("group", "group_sample", *UNSHADOWED[:count]) if count else ()

    @turn()
    def frame(self, index: int, seed: int = 0, channels: Sequence[str] = FRAME) -> Frame:
        """One frame at 1 spp: one kernel, only the channels asked for; then a small one, which lays
        the planes of colours side by side. (Before it a small one of what lights give, where they
        have changed: `lights/middles.py`.)

        The result depends on (scene, index, seed, size) alone, and never on which other frames
        are rendered: the channels of `replay.py` replay frame `index` - 1, whether or not it is
        asked for, and frame 0 has nothing to replay.
        """
        check_variant()
        if not self.splits and set(channels) & {*SPLIT, *SHADOW}:
            raise InputError(f"the channels {', '.join(SPLIT + SHADOW)} need --direct resampled "
                             "and a scene of max_depth 2 or more")
        if lacking := [c for c in channels if c in GROUPED and c not in self._grouped]:
            raise InputError(f"the channels {', '.join(lacking)} need --direct resampled and a "
                             f"scene of more lights than '{self.scene.name}' has")
        if set(channels) & {*LAYER} and not self.stage.images.layered:
            raise InputError(f"the channels {', '.join(c for c in LAYER if c in channels)} need a "
                             "scene with clear glass or masks, which "
                             f"'{self.scene.name}' is not: leave them out")
        if set(channels) & {*CAUSTIC} and self.balls is None:
            raise InputError("the channel caustic needs a scene with smooth balls of glass or "
                             "metal, and without masks and panes, which "
                             f"'{self.scene.name}' is not: leave it out")
        before = index - 1 if index > 0 else None
        replayed = replay(self, index, before, seed) if set(channels) & set(REPLAY) else {}
        if traced := bool(set(channels) & _TRACED):
            _ = self.lights  # before the stage is set: to find them moves it
        self.stage.set_frame(index)
        keys = keys_from_seed(seed, FRAME_STREAM, index)
        planes = self.replayed(Renderer._planes, tuple(c for c in channels if c not in REPLAY),
                               self.now(keys, traced))
        matrices = camera_matrices(self.scene.camera, index, self.height, self.width,
                                   self.jitter_at(index))
        images = {name: self._image(value) for name, value in planes.items()}
        images |= {name: image for name, image in replayed.items() if name in channels}
        return Frame(index, images, matrices.camera_from_world, matrices.screen_from_world,
                     self.stage.world_from_image())

    @turn()
    def sample_sum(self, index: int, seed: int, part: int, count: int, antialias: bool = False,
                   start: int = 0) -> np.ndarray:
        """Sum of `count` samples of every pixel of a frame, independent between parts.

        The samples of a part are a sequence that is stratified at every power of two.

        Args:
            start: how many samples of the part come before these.
            antialias: samples spread over the pixel (box filter) instead of its centre.
        Returns:
            (h, w, 3) float32, linear radiance times `count`.
        """
        self.stage.set_frame(index)
        with dr.suspend_grad():
            color = self._trace_samples(index, seed, part, start, count, antialias)
        dr.eval(color)
        return self._image(dr.ravel(color))

    def _planes(self, channels: Sequence[str], now: Now) -> dict[str, Any]:
        """`_trace_frame`, evaluated, the planes of a colour side by side."""
        planes = self._trace_frame(channels, now)
        dr.eval(planes)
        return {name: dr.ravel(plane) if dr.depth_v(plane) > 1 else plane
                for name, plane in planes.items()}

    def _trace_frame(self, channels: Sequence[str], now: Now) -> dict[str, Any]:
        with dr.suspend_grad():
            scene = self.stage.mi_scene
            pixel = dr.arange(mi.UInt32, self.height * self.width)
            ray, depth_per_length = now.rays.at(*self.centres(pixel))
            pi = scene.ray_intersect_preliminary(ray, coherent=True)
            sampler = self.new_sampler(now.keys, pixel)
            seen, row, behind = ray, None, None
            if self.stage.images.any:
                behind = replaced(self.stage, ray, pi, sampler)
                seen, pi, row = behind.ray, behind.pi, behind.row(self.stage)
            planes = {}
            if set(channels) & _TRACED:
                radiance = trace(scene, seen, pi, sampler, self.scene.max_depth,
                                 self.candidates, now.lights, behind, narrow=self._narrow,
                                 panes=now.panes, mirrors=now.mirrors, balls=now.balls)
                if behind and behind.other:
                    radiance = self._with_layers(radiance, behind, sampler, now)
                unit = dr.opaque(mi.Float, self.stage.unit)
                planes = {
                    "color": radiance.emission + radiance.direct + radiance.indirect,
                    "emission": radiance.emission,
                    "direct": radiance.direct,
                    "indirect": radiance.indirect,
                    "unshadowed": radiance.unshadowed,
                    "visibility": radiance.visibility,
                    "specular": radiance.specular,
                    "caustic": radiance.caustic,
                    "hit_distance": radiance.hit_distance * unit,
                    "hit_id": self.stage.image_id(radiance.hit_shape, radiance.hit_face, row),
                }
                if radiance.shadow_ray is not None:
                    light = radiance.shadow_ray.light
                    planes |= {
                        "light": (behind.unfolded(light) if behind else light) * unit,
                        "light_id": dr.select(
                            radiance.shadow_ray.to_sun, SUN,
                            self.stage.image_id(radiance.shadow_ray.light_shape, 0, row)),
                        "blocker_distance": radiance.shadow_ray.blocker_distance * unit,
                        "blocker_id": self.stage.image_id(radiance.shadow_ray.blocker_shape,
                                                          radiance.shadow_ray.blocker_face, row),
                    }
                    if told := radiance.shadow_ray.groups:
                        planes |= {
                            "group": told.group,
                            "group_sample": mi.Vector3f(told.visibility, told.weight, told.chance),
                            **dict(zip(UNSHADOWED, told.unshadowed)),
                        }
            if set(channels) & set(GBUFFER):
                hit = PrimaryHit(self.stage, ray, pi.compute_surface_interaction(seen),
                                 depth_per_length, behind)
                planes |= {name: GBUFFER[name](hit) for name in channels if name in GBUFFER}
            return {name: planes[name] for name in channels}

    @cached_property
    def _narrow(self) -> Callable[[mi.SurfaceInteraction3f], mi.Bool] | None:
        """Which surfaces see too little of the sky's strata; None where none does."""
        appearance = self.stage.appearance
        if not self.splits or self.stage.mi_scene.environment() is None or (
                not appearance.may_be_narrow(NARROW)):
            return None
        return lambda si: appearance.is_narrow(si, NARROW)

    def _with_layers(self, radiance: Radiance, behind: Replaced, sampler: Sampler,
                     now: Now) -> Radiance:
        """Light with that of other layers: their lamps, and of one of them the rest, specular."""
        scene, layer, aside = self.stage.mi_scene, behind.other, behind.aside
        assert layer is not None
        assert aside is not None
        pi = scene.ray_intersect_preliminary(layer.ray, coherent=False,
                                             active=dr.max(layer.throughput) > 0)
        other = trace(scene, layer.ray, pi, sampler, self.scene.max_depth, self.candidates,
                      behind=layer, tell_straight=True, panes=now.panes,
                      mirrors=now.mirrors, balls=now.balls, bent=self.stage.bent_glass)
        assert other.straight is not None
        light = other.emission + other.direct + other.indirect - other.straight
        light = dr.maximum(light, 0)  # (rounding)
        return replace(radiance, emission=radiance.emission + aside.lamps,
                       indirect=radiance.indirect + light, specular=radiance.specular + light)

    @dr.syntax
    def _trace_samples(self, index: int, seed: int, part: int, start: int, count: int,
                       antialias: bool):
        scene = self.stage.mi_scene
        pixel = dr.arange(mi.UInt32, self.height * self.width)
        rays = self.rays(jittered=False)
        keys = keys_from_seed(seed, REFERENCE_STREAM, index, part)
        x, y = self.centres(pixel)
        centre_ray, _ = rays.at(x, y)
        centre_pi = scene.ray_intersect_preliminary(centre_ray, coherent=True)
        sample, end = dr.opaque(mi.UInt32, start), dr.opaque(mi.UInt32, start + count)
        candidates, panes = candidates_for(scene), self.panes
        mirrors, balls = self.mirrors, self.balls
        if dr.hint(not antialias, mode="scalar"):
            return sum_of_samples(scene, centre_ray, centre_pi, Sobol(keys, pixel, sample), sample,
                                  end, self.scene.max_depth, candidates, panes, mirrors, balls)
        color = mi.Color3f(0)
        while dr.hint(sample < end, exclude=[scene, rays, panes, mirrors, balls]):
            sampler = Sobol(keys, pixel, sample)
            jitter = sampler.next_2d()
            ray, _ = rays.at(x + jitter.x - 0.5, y + jitter.y - 0.5)
            pi = scene.ray_intersect_preliminary(ray, coherent=True)
            radiance = trace(scene, ray, pi, sampler, self.scene.max_depth, candidates=candidates,
                             panes=panes, mirrors=mirrors, balls=balls)
            color += radiance.emission + radiance.direct + radiance.indirect
            sample += 1
        return color

    def _image(self, value: object) -> np.ndarray:
        """(h, w) or (h, w, 3) NumPy copy of evaluated planes, side by side."""
        values: Any = value
        size, count = (self.height, self.width), self.height * self.width
        if dr.width(values) == 3 * count:
            return values.numpy().reshape(*size, 3)
        return np.broadcast_to(values.numpy(), count).reshape(size).copy()
