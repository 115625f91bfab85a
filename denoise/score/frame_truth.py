"""What all methods are judged against in one frame: the reference, and what happened there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from onespp.denoise.geometry.correspondence import GUIDES, NOWHERE, previous_pixel
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
    """

    frame: Frame
    reference: Reference | None
    history: np.ndarray
    source: np.ndarray | None = None
    causes: np.ndarray | None = None
    still: np.ndarray | None = None

    @cached_property
    def target(self) -> Target | None:
        """What images are compared with."""
        return None if self.reference is None else Target(self.reference.color)


def read_frame_truth(sequence: FrameSequence, number: int,
                     before: FrameTruth | None) -> tuple[FrameTruth, Frame]:
    """The ground of a frame, and the frame itself. `before`: of the frame before, None if none."""
    wanted = ("color", *GUIDES, "albedo", "roughness")
    frame = sequence.read_frame(number, [c for c in wanted if c in sequence.channels])
    reference = sequence.read_reference(number) if sequence.has_reference(number) else None
    guided = all(name in frame for name in GUIDES)
    if before is None or not guided:
        return FrameTruth(frame, reference, np.ones(sequence.size, np.int64)), frame
    source = previous_pixel(before.frame, frame)
    history = lengthen(before.history, source)
    if reference is None or before.reference is None:
        return FrameTruth(frame, reference, history, source), frame
    lit = changed_light(before.frame, frame, before.reference, reference, source)
    return FrameTruth(frame, reference, history, source, causes(before.frame, frame, source, lit),
                  _still(before.frame, frame, source, lit)), frame


def _still(before: Frame, now: Frame, source: np.ndarray, lit: np.ndarray) -> np.ndarray | None:
    if not (np.array_equal(before.camera_from_world, now.camera_from_world)
            and np.array_equal(before.screen_from_world, now.screen_from_world)):
        return None
    return (source != NOWHERE) & ~lit & ~moving(before, now)
