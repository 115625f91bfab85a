"""What all methods are judged against in one frame: the reference, and what happened there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from onespp.denoise.geometry.correspondence import GUIDES, NOWHERE, carry, previous_pixel
from onespp.denoise.metrics.halves import Halves
from onespp.denoise.metrics.image import Target
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.frame import Frame

from .causes import causes, changed_light, lengthen, moving


@dataclass(frozen=True)
class FrameTruth:
    """A frame without its colour. What follows is None without a frame before, guides, reference.

    Attributes:
        source: `correspondence.previous_pixel`. history: `classes.lengthen`, never None.
        causes: index into `classes.CAUSES`.
        still: mask of pixels whose surface and light are those of before; None, too, where the
            camera moves.
        before: the target of the frame before.
    """

    frame: Frame
    reference: Reference | None
    history: np.ndarray
    source: np.ndarray | None = None
    causes: np.ndarray | None = None
    still: np.ndarray | None = None
    before: Target | None = None

    @cached_property
    def target(self) -> Target | None:
        """What images are compared with."""
        if self.reference is None:
            return None
        return Target(self.reference.color, self.reference.parts)

    @cached_property
    def aligned(self) -> Halves | None:
        """Halves of the change of the reference, pixel by pixel."""
        now, old = self._halves
        return now.minus(old) if now is not None and old is not None else None

    @cached_property
    def moved(self) -> Halves | None:
        """Halves of the change of the reference along the motion."""
        (now, old), source = self._halves, self.source
        if now is None or old is None or source is None:
            return None
        return now.minus(old.apply(lambda image: carry(image, source)))

    @property
    def _halves(self) -> tuple[Halves | None, Halves | None]:
        """Of this frame and the one before."""
        now, old = (None if t is None else t.srgb_halves for t in (self.target, self.before))
        return now, old


def read_frame_truth(sequence: FrameSequence, number: int,
                     before: FrameTruth | None) -> tuple[FrameTruth, Frame]:
    """The ground of a frame, and the frame itself. `before`: of the frame before, None if none."""
    wanted = ("color", *GUIDES, "motion", "albedo", "roughness")
    frame = sequence.read_frame(number, [c for c in wanted if c in sequence.channels])
    reference = sequence.read_reference(number) if sequence.has_reference(number) else None
    guided = all(name in frame for name in GUIDES)
    last = None if before is None else before.target
    if before is None or not guided:
        return FrameTruth(frame, reference, np.ones(sequence.size, np.int64), before=last), frame
    source = previous_pixel(before.frame, frame)
    history = lengthen(before.history, source)
    if reference is None or before.reference is None:
        return FrameTruth(frame, reference, history, source, before=last), frame
    lit = changed_light(before.frame, frame, before.reference, reference, source)
    return FrameTruth(frame, reference, history, source, causes(before.frame, frame, source, lit),
                  _still(before.frame, frame, source, lit), last), frame


def _still(before: Frame, now: Frame, source: np.ndarray, lit: np.ndarray) -> np.ndarray | None:
    if not (np.array_equal(before.camera_from_world, now.camera_from_world)
            and np.array_equal(before.screen_from_world, now.screen_from_world)):
        return None
    return (source != NOWHERE) & ~lit & ~moving(before, now)
