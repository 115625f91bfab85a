"""Judges one method, frame after frame: its rows of scores, and its error by cause."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from onespp.denoise.metrics.estimate import Estimate, error, value
from onespp.denoise.metrics.flicker import Step
from onespp.denoise.metrics.halves import block_of, products
from onespp.denoise.metrics.image import Pair, non_finite, pair
from onespp.denoise.metrics.metric import Metric
from onespp.denoise.metrics.table import HEADLINE, MEASURES, METRICS, STABILITY, measure_pair

from .causes import BACKGROUND, CAUSES, HISTORIES, history_class
from .frame_truth import FrameTruth
from .method_score import ClassScore, FrameScore


class Tally:
    """Squared error, its variance, and pixels by class, summed over frames."""

    def __init__(self, names: Iterable[str]) -> None:
        self.names = list(names)
        self.squares, self.pixels = np.zeros(len(self.names)), np.zeros(len(self.names))
        self.variances = np.zeros(len(self.names))
        self._exact = True

    def add(self, classes: np.ndarray, planes: list[np.ndarray],
            blocks: np.ndarray | None = None) -> None:
        """Add pixels of a frame.

        Args:
            classes: (n,) index of each pixel's class; one past the last: of none. planes: its
                squared error, (n,); by halves, with the three that its variance takes
                (`halves.products`). blocks: (n,), then.
        """
        count = len(self.names)
        self.pixels += np.bincount(classes, minlength=count + 1)[:count]
        self.squares += np.bincount(classes, planes[0], minlength=count + 1)[:count]
        if blocks is None or not blocks.size:
            return
        self._exact, most = False, int(blocks.max()) + 1
        where = classes * most + blocks
        first, second, both = (np.square(
            np.bincount(where, plane, (count + 1) * most)[:count * most].reshape(count, most)
            ).sum(axis=1) for plane in planes[1:])
        self.variances += np.maximum(first + second - both, 0)

    def scores(self) -> dict[str, ClassScore]:
        """Class -> score; empty if there was nothing to judge."""
        pixels, squares = self.pixels.sum(), self.squares.sum()
        if not pixels:
            return {}
        return {name: ClassScore(
            pixels=float(n / pixels), mse_share=float(s / squares) if squares > 0 else 0.0,
            **self._decibels(s, v, n))
            for name, n, s, v in zip(self.names, self.pixels, self.squares, self.variances)}

    def _decibels(self, square: float, variance: float, pixels: float) -> dict[str, float | None]:
        estimate = Estimate(float(square / pixels), float(variance / pixels**2)) if pixels else None
        if estimate is None or not estimate.resolved:
            return {"psnr_srgb": None, "error": None}
        return {"psnr_srgb": value("dB", estimate),
                "error": None if self._exact else error("dB", estimate)}


class MethodScorer:
    """Sees a method's frames in order.

    Args:
        own: metrics beside those of the table.
    Attributes:
        rows: what was measured. causes, histories: error by class, over frames with a frame
            before them. estimates: measure -> frame -> mean square by halves.
        headline: that of the frame seen last, with its noise; None without halves.
    """

    def __init__(self, own: Iterable[Metric] = ()) -> None:
        self.own = {row.name: row for row in own}
        self.rows: list[FrameScore] = []
        self.causes, self.histories = Tally(CAUSES), Tally(HISTORIES)
        self.estimates: dict[str, dict[int, Estimate]] = {}
        self.headline: Estimate | None = None
        self._before: tuple[int, Pair] | None = None

    def see(self, number: int, after: int | None, image: np.ndarray, ground: FrameTruth,
            ms: float | None, metrics: Iterable[str]) -> None:
        """Score a frame.

        Args:
            after: number of the frame before it in the sequence. image: (h, w, 3) linear radiance.
            metrics: names of those to measure.
        """
        values: dict[str, float | None] = dict.fromkeys((*MEASURES, *self.own))
        errors: dict[str, float] = {}
        self.headline = None
        if ground.target is not None:
            images = pair(image, ground.target)
            chosen = [self.own.get(name) or METRICS[name] for name in metrics]
            copied = images.same
            found = {} if copied else self._estimated(number, chosen, images)
            values.update(measure_pair(images, [m for m in chosen if m.name not in found]))
            self.headline = found.get(HEADLINE.name)
            if self._before and self._before[0] == after:
                old = self._before[1]
                step = Step(images.srgb, old.srgb, ground.source, ground.still, ground.moved,
                            ground.aligned)
                steps = ({} if copied and old.same else
                         self._estimated(number, STABILITY.values(), step))
                values.update({row.name: row.function(step) for row in STABILITY.values()
                               if row.name not in steps})
                found.update(steps)
            for name, estimate in found.items():
                scale = MEASURES[name].scale
                values[name] = value(scale, estimate)
                if estimate.resolved or scale == "mean":
                    errors[name] = error(scale, estimate)
            self._before = number, images
            if ground.causes is not None:
                self._classify(images, ground, copied)
        self.rows.append(FrameScore(
            frame=number, ms=ms, non_finite_pixels=int(non_finite(image).sum()), errors=errors,
            **values))  # pyright: ignore

    def _estimated(self, number: int, rows: Iterable[Metric], judged: Any) -> dict[str, Estimate]:
        found = {row.name: estimate for row in rows if row.estimate
                 and (estimate := row.estimate(judged)) is not None}
        for name, estimate in found.items():
            self.estimates.setdefault(name, {})[number] = estimate.without_noise()
        return found

    def _classify(self, images: Pair, ground: FrameTruth, copied: bool) -> None:
        """Add the frame to the error by class."""
        assert ground.causes is not None
        halves, blocks = images.target.srgb_halves, None
        if halves is None or copied:
            planes = [_mean(np.square(np.subtract(*images.srgb, dtype=np.float64)))]
        else:
            planes = [_mean(plane) for plane in products(images.srgb[0], halves)]
            blocks = block_of(*ground.causes.shape).ravel()
        causes = ground.causes.ravel()
        self.causes.add(causes, planes, blocks)
        histories = np.where(causes == BACKGROUND, len(HISTORIES),
                             history_class(ground.history).ravel())
        self.histories.add(histories, planes, blocks)


def _mean(plane: np.ndarray) -> np.ndarray:
    """(h * w,) means over the colours of (h, w, 3)."""
    return ((plane[..., 0] + plane[..., 1] + plane[..., 2]) / 3).ravel()
