"""A sequence whose references have independent parts, made without a renderer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from onespp.render.files.sequence import FrameSequence, Reference


def reference_of(truth: np.ndarray, sigma: float, seed: list[int], spp: int = 64) -> Reference:
    """Four parts of a truth, (h, w, 3); the relative noise of their mean is sigma."""
    noise = np.random.default_rng(seed).standard_normal((4, *truth.shape))
    parts = (truth * (1 + 2 * sigma * noise)).astype(np.float32)
    return Reference(parts.mean(axis=0), ((sigma * truth) ** 2).astype(np.float32), spp, parts)


@dataclass(frozen=True)
class Halved(FrameSequence):
    """A sequence that reads these references, whatever its files hold."""

    truth: Callable[[int], np.ndarray] = np.zeros
    sigma: float = 0.02
    seed: int = 0
    without: tuple[int, ...] = ()  # frames whose reference has no parts

    def read_reference(self, i: int) -> Reference:
        made = reference_of(self.truth(i), self.sigma, [self.seed, i])
        return replace(made, parts=None) if i in self.without else made


def halved(sequence: FrameSequence, truth: Callable[[int], np.ndarray], sigma: float = 0.02,
           seed: int = 0, without: tuple[int, ...] = ()) -> Halved:
    return Halved(sequence.folder, sequence.manifest, truth, sigma, seed, without)
