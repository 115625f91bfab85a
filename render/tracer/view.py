"""A scene at one size: what rendering a frame and replaying samples of the last one both need."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from weakref import ref

import drjit as dr

from onespp.render.errors import InputError
from onespp.render.files.manifest import DIRECT, JITTERS, SAMPLERS
from onespp.render.host.recorded import Recorded
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi
from onespp.scenes.description import Scene

from .camera_rays import NO_JITTER, Offset, PixelRays, halton, pixel_rays
from .lights.balls.balls import Balls, find_balls
from .lights.candidates import candidates_for
from .lights.mirrors import Mirrors, find_mirrors
from .lights.panes import Panes, find_panes
from .lights.resampling import Lights
from .lights.scene_lights import find_lights
from .sampler import BlueNoise, Keys, Pcg, Sampler, Sobol, mask_table, z_order

_SAMPLERS: dict[str, Callable[[Keys, Any, int, Any], Sampler]] = {
    "pcg": lambda keys, pixel, width, mask: Pcg(keys, pixel),
    "zsobol": lambda keys, pixel, width, mask: Sobol(keys, mi.UInt32(0),
                                                     z_order(pixel % width, pixel // width)),
    "bluenoise": lambda keys, pixel, width, mask: BlueNoise(keys, pixel % width, pixel // width,
                                                            mask),
}


@dataclass
class Now:
    """What the kernel of a frame reads beside the Mitsuba scene: `tables` of the view, and `turned`
    of the stage; keys of the random numbers; the camera's rays; and `lights_now`, `mirrors`,
    `balls` and `panes` of the view, None where nothing is traced."""

    tables: list[Any]
    turned: tuple[bool, ...]
    keys: Keys
    rays: PixelRays
    lights: Lights | None
    mirrors: Mirrors | None
    balls: Balls | None
    panes: Panes | None


class View:
    """A scene, its live Mitsuba scene, the size of its images and the estimator of its light.

    Attributes:
        scene, stage: the description, and what Mitsuba made of it. height, width: pixels.
        direct: one of `DIRECT`. sampler: one of `SAMPLERS`. candidates: points of the lights that
            a vertex of a frame's path compares, 1 for `--direct mis`. jitter: one of `JITTERS`.

    Raises:
        InputError: a size below 1x1, or an unknown `direct`, `sampler` or `jitter`.
        SceneError: a scene that Mitsuba cannot build.
    """

    def __init__(self, scene: Scene, height: int, width: int, direct: str = "mis",
                 sampler: str = "pcg", jitter: str = "none") -> None:
        for option, value, known in (("direct", direct, DIRECT), ("sampler", sampler, SAMPLERS),
                                     ("jitter", jitter, JITTERS)):
            if value not in known:
                raise InputError(f"unknown --{option} '{value}': use {' or '.join(known)}")
        self.direct, self.sampler, self.jitter = direct, sampler, jitter
        if height < 1 or width < 1:
            raise InputError(f"the size {width}x{height} is empty: use at least 1x1")
        self.scene, self.height, self.width = scene, height, width
        self.stage = MitsubaScene(scene)
        self._told: tuple[float | None, Lights] | None = None
        self._recordings: dict[Callable[..., Any], Recorded] = {}
        self.candidates = 1 if direct == "mis" else candidates_for(self.stage.mi_scene)

    @property
    def splits(self) -> bool:
        """Whether direct light is split: paths of one segment have none."""
        return self.direct == "resampled" and self.scene.max_depth > 1

    @cached_property
    def lights(self) -> Lights | None:
        """Those that direct light is resampled from, None without a split. To find them moves the
        stage."""
        return find_lights(self.stage) if self.splits else None

    @property
    def lights_now(self) -> Lights | None:
        """`lights`, with what they give at the frame that the stage is set to."""
        frame = self.stage.frame if self._lights_change else None
        if self.lights and (not self._told or self._told[0] != frame):
            self._told = frame, self.lights.now(self.stage.mi_scene)
        return self._told and self._told[1]

    def replayed(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """function(view, *arguments), recorded for this view where its scene can be.

        (On a GPU it is called as it is: recordings of rays are untried there.)
        """
        if function not in self._recordings:
            this = ref(self)  # or a recording would keep its view
            self._recordings[function] = Recorded(
                lambda *arguments: function(this(), *arguments),
                enabled=self.stage.recordable and dr.backend_v(mi.Float) == dr.JitBackend.LLVM)
        return self._recordings[function](self.stage.mi_scene, *arguments)

    def now(self, keys: Keys, traced: bool = True) -> Now:
        """At the frame that the stage is set to, with these random numbers.

        Args:
            traced: whether paths are; then `lights` are to be known, as to find them moves the
                stage.
        """
        found = ((self.lights_now, self.mirrors, self.balls, self.panes) if traced
                 else (None, None, None, None))
        return Now(self.tables, self.stage.turned, keys, self.rays(), *found)

    @property
    def mirrors(self) -> Mirrors | None:
        """Those that light is looked for in, at the frame that the stage is set to."""
        return find_mirrors(self.stage)

    @property
    def balls(self) -> Balls | None:
        """The same, of balls."""
        return find_balls(self.stage)

    @property
    def panes(self) -> Panes | None:
        """What light goes through, at the frame that the stage is set to."""
        return find_panes(self.stage)

    @property
    def tables(self) -> list[Any]:
        """What kernels read that is the same at all frames, beside the scene itself."""
        return [*self.stage.tables, self._mask]

    @cached_property
    def _mask(self) -> mi.UInt32 | None:
        return mask_table() if self.sampler == "bluenoise" else None

    @cached_property
    def _lights_change(self) -> bool:
        return any(shape.emission is not None and (shape.moves or callable(shape.emission))
                   for shape in self.scene.shapes)

    def rays(self, jittered: bool = True) -> PixelRays:
        """Rays through points of the image, at the frame that the stage is set to.

        Args:
            jittered: those of a frame; a reference's are not.
        """
        jitter = self.jitter_at(int(self.stage.frame)) if jittered else NO_JITTER
        return pixel_rays(self.stage, self.height, self.width, jitter)

    def jitter_at(self, frame: int) -> Offset:
        """How far a frame's rays are from pixels' centres, pixels."""
        return halton(frame) if self.jitter == "halton" else NO_JITTER

    def new_sampler(self, keys: Keys, pixel: mi.UInt32) -> Sampler:
        """The random numbers of pixels."""
        return _SAMPLERS[self.sampler](keys, pixel, self.width, self._mask)

    def centres(self, pixel: mi.UInt32) -> tuple[mi.Float, mi.Float]:
        """Screen coordinates (x, y) of pixels' centres, by index."""
        row = pixel // self.width
        return mi.Float(pixel - row * self.width) + 0.5, mi.Float(row) + 0.5
