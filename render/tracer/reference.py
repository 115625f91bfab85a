"""The reference: many samples, lights by candidates, through the frame's pixel centres.

Rendered in independent passes, so that it can show progress, be stopped and continued, and say
how noisy it is itself.

Symbols: n_k samples and m_k mean of pass k; N = sum of n_k; m overall mean; K passes. The variance
of the mean is estimated between passes,

    Var[m] = 1/N * sum_k n_k (m_k - m)^2 / (K - 1),

which holds for any estimator inside a pass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from onespp.render.errors import InputError
from onespp.render.files.sequence import Reference

from .renderer import Renderer

LARGEST_PASS = 64  # samples; float32 sums inside a pass stay exact to ~1e-6
MOST_PATHS = 1 << 24  # a pass; some seconds, after which it can be stopped
FEWEST_PASSES = 8  # so that the variance has a few degrees of freedom
MOST_SAMPLES = 1 << 24


@dataclass
class SampleSums:
    """Sums over the passes done so far, float64 (h, w, 3). Enough to go on from.

    total: sum n_k m_k. squares: sum n_k m_k^2.
    """

    total: np.ndarray
    squares: np.ndarray
    passes: int = 0
    samples: int = 0

    @classmethod
    def start(cls, height: int, width: int) -> SampleSums:
        return cls(np.zeros((height, width, 3)), np.zeros((height, width, 3)))

    def add(self, sample_sum: np.ndarray, samples: int) -> None:
        total = sample_sum.astype(np.float64)
        self.passes += 1  # first, and samples last: an interrupt between leaves them at odds
        self.total += total
        self.squares += total * total / samples
        self.samples += samples

    @classmethod
    def of(cls, reference: Reference, passes: int) -> SampleSums:
        """What a finished reference amounts to, but for its rounding to float32."""
        mean, samples = reference.color.astype(np.float64), reference.spp or 0
        spread = reference.variance.astype(np.float64) * (passes - 1) * samples
        return cls(samples * mean, spread + samples * mean * mean, passes, samples)

    def reference(self) -> Reference:
        mean = self.total / self.samples
        spread = np.maximum(self.squares - self.samples * mean * mean, 0)
        variance = spread / ((self.passes - 1) * self.samples)
        return Reference(mean.astype(np.float32), variance.astype(np.float32), self.samples)


def pass_sizes(spp: int, pixels: int = 1) -> list[int]:
    """Samples of each pass, for images of that many pixels.

    Raises:
        InputError: fewer than 2 samples, which have no variance; or more than MOST_SAMPLES.
    """
    if spp < 2:
        raise InputError(f"a reference of {spp} spp has no variance: use 2 spp or more")
    if spp > MOST_SAMPLES:
        raise InputError(f"a reference of {spp:.3g} spp is beyond float32: use at most "
                         f"{MOST_SAMPLES}")
    largest = max(1, min(LARGEST_PASS, MOST_PATHS // pixels))
    passes = min(spp, max(FEWEST_PASSES, -(-spp // largest)))
    size, larger = divmod(spp, passes)
    return [size + 1] * larger + [size] * (passes - larger)


def render_reference(renderer: Renderer, index: int, seed: int, spp: int, *,
                     antialias: bool = False, progress: SampleSums | None = None,
                     after_pass: Callable[[SampleSums], None] = lambda progress: None) -> Reference:
    """The reference of one frame.

    Args:
        progress: what an earlier, interrupted call had done; the result has the same bytes as
            an undisturbed one.
        after_pass: called after every pass, to show or save the progress.
    """
    progress = progress or SampleSums.start(renderer.height, renderer.width)
    for size in pass_sizes(spp, renderer.height * renderer.width)[progress.passes:]:
        progress.add(renderer.sample_sum(index, seed, progress.passes, size, antialias), size)
        after_pass(progress)
    return progress.reference()
