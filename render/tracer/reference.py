"""The reference: many samples, lights by candidates, through the frame's pixel centres.

Four independent parts of equally many samples, of which two make a half. The product of an image's
errors against two independent halves has no noise floor, and the parts tell how noisy they are:
with p one part's mean and m that of all,

    Var[m] = 1/12 * sum_p (p - m)^2,

which holds for any estimator inside a part. A part is one scrambled Sobol sequence, so best a power
of two long, and any reference is the beginning of every larger one.

Rendered in passes, so that it can show progress, be stopped and continued. Passes are dealt to the
parts in turns, and where a part's passes end depends on nothing but the size of the image: the sum
of an interrupted reference is rounded as that of an undisturbed one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from onespp.render.errors import InputError
from onespp.render.files.sequence import Reference
from onespp.render.progress import Progress, silent

from .renderer import Renderer

PARTS = 4
SMALLEST_PASS, LARGEST_PASS = 16, 64  # samples; float32 sums inside a pass stay exact to ~1e-6
MOST_PATHS = 1 << 24  # a pass; some seconds, after which it can be stopped
MOST_SAMPLES = 1 << 24  # a pixel


@dataclass
class SampleSums:
    """Sums over the samples that each part has so far. Enough to go on from.

    parts: total, (h, w, 3) float64, and number of samples of each part.
    """

    parts: tuple[tuple[np.ndarray, int], ...]

    @classmethod
    def start(cls, height: int, width: int) -> SampleSums:
        return cls(((np.zeros((height, width, 3)), 0),) * PARTS)

    @classmethod
    def of(cls, reference: Reference) -> SampleSums:
        """What a finished reference with parts amounts to, but for its rounding in the file."""
        assert reference.parts is not None
        n = (reference.spp or 0) // PARTS
        return cls(tuple((n * part.astype(np.float64), n) for part in reference.parts))

    @property
    def samples(self) -> list[int]:
        """Of each part."""
        return [n for _, n in self.parts]

    def add(self, part: int, sample_sum: np.ndarray, samples: int) -> None:
        """All of it or, where an interrupt comes between, nothing."""
        total, n = self.parts[part]
        grown = (total + sample_sum, n + samples)
        self.parts = (*self.parts[:part], grown, *self.parts[part + 1:])

    def reference(self) -> Reference:
        """The reference; all parts have equally many samples."""
        (n,) = set(self.samples)
        return Reference.of_parts(np.stack([total / n for total, _ in self.parts]), PARTS * n)


def whole_spp(spp: int) -> int:
    """The next number of samples that four parts can share.

    Raises:
        InputError: none, or more than MOST_SAMPLES.
    """
    if spp < 1:
        raise InputError(f"a reference of {spp} spp has no samples: use {PARTS} spp or more")
    if spp > MOST_SAMPLES:
        raise InputError(f"a reference of {spp:.3g} spp is beyond float32: use at most "
                         f"{MOST_SAMPLES}")
    return -(-spp // PARTS) * PARTS


def pass_end(done: int, pixels: int) -> int:
    """Samples that a part has after its next pass, for images of that many pixels.

    16, 32 and 64, the largest pass, and multiples of that; where pixels are so many that fewer are
    the largest pass, multiples of those.
    """
    largest = 1 << (max(1, min(LARGEST_PASS, MOST_PATHS // pixels)).bit_length() - 1)
    if done < largest:
        return min(largest, max(SMALLEST_PASS, 1 << done.bit_length()))
    return (done // largest + 1) * largest


def next_pass(samples: Sequence[int], end: int, pixels: int) -> tuple[int, int] | None:
    """The part whose turn it is, and how many samples it gets; None where all have `end`."""
    part = min(range(PARTS), key=lambda p: samples[p])
    done = samples[part]
    return (part, min(end, pass_end(done, pixels)) - done) if done < end else None


def render_reference(renderer: Renderer, index: int, seed: int, spp: int, *,
                     antialias: bool = False, sums: SampleSums | None = None,
                     progress: Progress = silent) -> Reference:
    """The reference of one frame.

    Args:
        spp: samples a pixel, rounded up to what the parts can share (`whole_spp`).
        sums: what an earlier, interrupted call had done; the result has the same bytes as an
            undisturbed one. Where a part has more samples than asked for, all get as many. It is
            added to, so what it holds when a call is interrupted is what that had done.
        progress: told of the samples a pixel after every pass.
    """
    pixels = renderer.height * renderer.width
    sums = SampleSums.start(renderer.height, renderer.width) if sums is None else sums
    end = max(whole_spp(spp) // PARTS, *sums.samples)
    while (step := next_pass(sums.samples, end, pixels)) is not None:
        part, count = step
        start = sums.samples[part]
        sums.add(part, renderer.sample_sum(index, seed, part, count, antialias, start), count)
        progress(sum(sums.samples), PARTS * end, f"reference of frame {index}")
    return sums.reference()
