"""Judges one method, frame after frame: its rows of scores, and its error by cause."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from onespp.denoise.metrics.errors import decibels
from onespp.denoise.metrics.flicker import Step
from onespp.denoise.metrics.image import Pair, non_finite, pair
from onespp.denoise.metrics.table import MEASURES, STABILITY, measure_pair

from .causes import BACKGROUND, CAUSES, HISTORIES, history_class
from .frame_truth import FrameTruth
from .scorecard import ClassScore, FrameScore


class Tally:
    """Squared error, pixels by class, summed over frames."""

    def __init__(self, names: Iterable[str]) -> None:
        self.names = list(names)
        self.squares, self.pixels = np.zeros(len(self.names)), np.zeros(len(self.names))

    def add(self, classes: np.ndarray, squared: np.ndarray) -> None:
        """classes: index of each pixel's class; squared: its error; of one shape."""
        count = len(self.names)
        self.pixels += np.bincount(classes.ravel(), minlength=count)
        self.squares += np.bincount(classes.ravel(), squared.ravel(), minlength=count)

    def scores(self) -> dict[str, ClassScore]:
        """Class -> score; empty if there was nothing to judge."""
        pixels, squares = self.pixels.sum(), self.squares.sum()
        return {name: ClassScore(
            pixels=float(n / pixels), mse_share=float(s / squares) if squares else 0.0,
            psnr_srgb=decibels(float(s / n)) if n else None)
            for name, n, s in zip(self.names, self.pixels, self.squares) if pixels}


class MethodScorer:
    """Sees a method's frames in order.

    Attributes:
        rows: what was measured. causes, histories: error by class, over frames with a frame
            before them.
    """

    def __init__(self) -> None:
        self.rows: list[FrameScore] = []
        self.causes, self.histories = Tally(CAUSES), Tally(HISTORIES)
        self._before: tuple[int, Pair] | None = None

    def see(self, number: int, after: int | None, image: np.ndarray, ground: FrameTruth,
            ms: float | None, metrics: Iterable[str]) -> None:
        """Score a frame.

        Args:
            after: number of the frame before it in the sequence. image: (h, w, 3) linear radiance.
            metrics: names of those to measure.
        """
        values: dict[str, float | None] = dict.fromkeys(MEASURES)
        if ground.target is not None:
            images = pair(image, ground.target)
            values.update(measure_pair(images, metrics))
            if self._before and self._before[0] == after:
                values.update(_changes(self._before[1], images, ground))
            self._before = number, images
            if ground.causes is not None:
                squared = np.square(np.subtract(*images.srgb, dtype=np.float64)).mean(axis=-1)
                self.causes.add(ground.causes, squared)
                surface = ground.causes != BACKGROUND
                self.histories.add(history_class(ground.history)[surface], squared[surface])
        self.rows.append(FrameScore(
            frame=number, ms=ms, non_finite_pixels=int(non_finite(image).sum()),
            **values))  # pyright: ignore


def _changes(before: Pair, now: Pair, ground: FrameTruth) -> Mapping[str, float | None]:
    step = Step(now.srgb, before.srgb, ground.source, ground.still)
    return {row.name: row.function(step) for row in STABILITY.values()}
