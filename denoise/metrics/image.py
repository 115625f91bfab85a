"""An image and its reference, made fit for the measures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .perceptual.flip import FlipReference
from .tonemap import srgb_from_linear


def blacken(image: np.ndarray, where: np.ndarray) -> np.ndarray:
    """`image` with the pixels of the (h, w) mask `where` set to 0; itself if there are none."""
    return np.where(where[..., None], np.zeros((), image.dtype), image) if where.any() else image


def non_finite(image: np.ndarray) -> np.ndarray:
    """(h, w) mask of pixels that have a NaN or an infinity in any colour."""
    return np.logical_not(np.isfinite(image).all(axis=-1))


class Target:
    """A frame's reference, and what the measures make of it: once for all images it judges.

    Args:
        reference: (h, w, 3) linear radiance.
    Attributes:
        unknown: (h, w) mask of its non-finite pixels. linear: it with those in black. srgb: its
            display values.
    """

    def __init__(self, reference: np.ndarray) -> None:
        self.unknown = non_finite(reference)
        self.linear = blacken(reference, self.unknown)

    @cached_property
    def srgb(self) -> np.ndarray:
        return srgb_from_linear(self.linear)

    @cached_property
    def flip(self) -> FlipReference:
        return FlipReference(self.linear)


@dataclass(frozen=True)
class Pair:
    """An image and its reference, fit for the measures.

    Attributes:
        linear: (a, b), (h, w, 3) linear radiance.
        srgb: (a, b), (h, w, 3) display values in [0, 1].
        target: that of b.
    """

    linear: tuple[np.ndarray, np.ndarray]
    srgb: tuple[np.ndarray, np.ndarray]
    target: Target

    @property
    def flip(self) -> tuple[np.ndarray, FlipReference]:
        """(a, b), a as radiance."""
        return self.linear[0], self.target.flip


def pair(image: np.ndarray, reference: np.ndarray | Target) -> Pair:
    """Two (h, w, 3) images of linear radiance, to be compared.

    A non-finite pixel of `image` is judged as black. Where `reference` is not finite, neither is
    judged (black in both).
    """
    target = reference if isinstance(reference, Target) else Target(reference)
    linear = blacken(image, non_finite(image) | target.unknown)
    return Pair((linear, target.linear), (srgb_from_linear(linear), target.srgb), target)
