"""SVGF whose history follows shadows, mirror images and what uncovers a surface (TRMV).

SVGF looks up history where the surface was. That is where its light was too, unless the surface was
hidden, or the light itself moves over it. Three more motions, each a switch:

- **shadow** (`history/shadow_motion.py`, `shadow_window.py`): direct light where a shadow moves.
- **glossy** (`mirror_images.py`): specular light where the image that is reflected was seen; it is
  then a signal of its own, over which no albedo is. Frames of scenes with glossy surfaces have
  what it needs: `specular`, `hit_distance` and `hit_id`.
- **dual** (`uncovered.py`): a surface that was hidden takes history from beside the occluder.

With all three off it is `svgf`, bit by bit.

Source: Zeng et al. 2021, "Temporally reliable motion vectors for real-time ray tracing",
doi:10.1111/cgf.142616. All else is that of SVGF, as there.

Departures, beside those of SVGF and of these modules:
- A history along one of the motions is one of the same surface: its pixels pass the tests of
  `reprojection.py`, and where none does, what was found where the surface was is kept. Only that of
  shadows is clamped.
- Shadows and images replace the history of a pixel, but not its length. That from beside an
  occluder is of another place: it counts as one frame, however long it is.
- A shadow moves where more than a quarter of the rays around were stopped by what moves it; the
  paper takes pixels one by one.
- A scene's lights are one signal, and a shadow takes the light of all of them along.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.history.records import LookUp, RecordState, look_up, no_history, record_words
from onespp.denoise.history.reprojection import Motion, motion_between
from onespp.denoise.history.shadow_motion import shadow_place
from onespp.denoise.inputs.demodulation import Texture
from onespp.denoise.inputs.repair import repair
from onespp.denoise.inputs.shadow_rays import has_shadow_rays, read_shadow_rays
from onespp.denoise.inputs.surface import Surface, TangentPlane
from onespp.denoise.jit.arrays import Bool, Color, Float
from onespp.denoise.jit.color import LuminanceColor, with_luminance
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.render.channels import SHADOW
from onespp.render.frame import Frame

from ..svgf import SIGNALS, Light, Passes, Svgf
from ..svgf_accumulation import Refine, Sought
from .mirror_images import NEEDED, Reflection, image_place, read_reflection
from .shadow_window import clamped, surroundings, tabulate_shadows
from .uncovered import beside_occluder

LEAST_SHARE = 0.25  # of the pixels of 7x7, below which no shadow moves; on two generated scenes
_DIRECT, _SPECULAR = slice(1, 6), slice(11, 16)  # of a record's values


@dataclass(frozen=True)
class Trmv(Svgf):
    """SVGF with the motion of shadows, of mirror images and of what uncovers surfaces (TRMV).

    Attributes: those of `Svgf`, and
        shadow_motion: history of direct light where a moving shadow was; where frames have shadow
            rays.
        glossy_motion: history of specular light where the reflected image was; where frames have
            `hit_distance` and `hit_id`.
        dual_motion: history from beside the occluder for what was hidden; where motion is told by
            matrices.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Trmv(glossy_motion=False)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    shadow_motion: bool = True
    glossy_motion: bool = True
    dual_motion: bool = True

    uses: ClassVar[tuple[str, ...]] = (*SIGNALS, *SHADOW, *NEEDED)
    renamed: ClassVar[Mapping[str, str]] = {}
    refine: ClassVar[Refine | None] = staticmethod(
        lambda stencil, sought, found, known: follow_light(stencil, sought, found, known))

    def init_on(self, stencil: Stencil) -> TrmvState:
        return TrmvState(stencil, no_history(stencil),
                         tabulate=Step(lambda *a: tabulate_shadows(stencil, *a)))

    def demodulate_light(self, frame: Frame, color: Color, stencil: Stencil) -> Light:
        """With specular light apart, where it has a motion of its own."""
        light = super().demodulate_light(frame, color, stencil)
        if (not self.glossy_motion or len(light.signals) != len(SIGNALS)
                or not all(name in frame for name in NEEDED)):
            return light
        direct, indirect = light.signals
        specular = Color(*stencil.load(repair(np.asarray(frame["specular"], np.float32),
                                              frame["id"])))
        over = with_luminance(Texture(light.texture.albedo).demodulate(specular))
        rest = LuminanceColor(*[a - b for a, b in zip(indirect, over)])
        return Light([direct, rest, with_luminance(specular)], light.texture, True)

    def known(self, frame: Frame, surface: Surface, light: Light,
              state: RecordState[Passes]) -> Known:
        assert isinstance(state, TrmvState)
        stencil, previous = state.stencil, state.previous or frame
        shadows = dual = reflection = None
        if self.shadow_motion and len(light.signals) > 1 and has_shadow_rays(frame):
            rays, position = read_shadow_rays(frame, previous, stencil), surface.position
            plane = TangentPlane(surface.inverse_depth, *surface.slope, surface.inverse_depth)
            evaluate(rays, position, plane)
            shadows = Shadows(state.tabulate(rays, surface.sample, position, light.signals[0]),
                              plane)
        if light.has_specular:
            reflection = read_reflection(frame, previous, surface.position, stencil)
        if self.dual_motion and "motion" not in frame:
            dual = motion_between(frame, previous, stencil)
        evaluate(reflection)
        return Known(dual, shadows, reflection)


class Shadows(NamedTuple):
    """`tabulate_shadows`; tangent planes."""

    table: Float
    plane: TangentPlane


class Known(NamedTuple):
    """What is followed: None for what is not.

    Attributes:
        dual: motion from the current frame to the one before it.
    """

    dual: Motion | None
    shadows: Shadows | None
    reflection: Reflection | None


@dataclass(frozen=True, kw_only=True)
class TrmvState(RecordState[Passes]):
    """`RecordState`, and the step that tabulates shadows."""

    tabulate: Step[..., Float] = field(repr=False)


def follow_light(stencil: Stencil, sought: Sought, found: LookUp, known: Known) -> LookUp:
    """A history, of which some is taken along other motions.

    Args:
        found: where the surface was; 11 values or, with specular light, 16.
    """
    surface, motion, place, records, tests = sought
    values, is_valid, _ = found
    words = record_words(len(values))

    def along(at: Any, active: Bool) -> LookUp:
        return look_up(stencil, at, records, len(values), tests.min_cosine, active=active,
                       words=words)

    if known.dual is not None:
        beside, hidden = beside_occluder(stencil, place, records, words, known.dual)
        there = along(beside, hidden & ~is_valid)
        there.values[0] = dr.minimum(there.values[0], 1)
        values = [dr.select(there.is_valid, t, v) for t, v in zip(there.values, values)]
        is_valid = is_valid | there.is_valid
    if known.shadows is not None:
        around = surroundings(stencil, stencil.Float(surface.id), known.shadows.table)
        was, moves = shadow_place(stencil, surface, known.shadows.plane, motion, around.motion,
                                  tests, LEAST_SHARE)
        there = along(was, moves & is_valid)
        light = there.values[_DIRECT]
        _replace(values, _DIRECT, [*clamped(light[:3], around), *light[3:]], there.is_valid)
    if known.reflection is not None:
        image, has_image = image_place(stencil, surface, known.reflection, place)
        there = along(image, has_image & is_valid)
        _replace(values, _SPECULAR, there.values[_SPECULAR], there.is_valid)
    return LookUp(values, is_valid)


def _replace(values: list[Float], part: slice, others: list[Float], where: Bool) -> None:
    values[part] = [dr.select(where, o, v) for o, v in zip(others, values[part], strict=True)]
