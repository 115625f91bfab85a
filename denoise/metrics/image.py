"""An image and its reference, made fit for the measures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .errors import RELMSE_FLOOR
from .estimate import Estimate
from .halves import (
    Halves,
    RelativeError,
    display_halves,
    linear_halves,
    mean_difference,
    mean_product,
)
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
        reference: (h, w, 3) linear radiance. parts: (4, h, w, 3), independent ones whose mean it
            is; None where there are none.
    Attributes:
        unknown: (h, w) mask of its non-finite pixels. linear: it with those in black. srgb: its
            display values. parts: with those in black, too. linear_halves, srgb_halves: None
            without parts. relative: of relMSE, likewise.
    """

    def __init__(self, reference: np.ndarray, parts: np.ndarray | None = None) -> None:
        self.unknown = non_finite(reference)
        self.parts = parts
        if parts is not None:
            self.unknown = self.unknown | non_finite(parts).any(axis=0)
            self.parts = np.where(self.unknown[..., None], np.zeros((), parts.dtype), parts)
        self.linear = blacken(reference, self.unknown)

    @cached_property
    def linear_halves(self) -> Halves | None:
        return None if self.parts is None else linear_halves(self.parts)

    @cached_property
    def srgb_halves(self) -> Halves | None:
        return None if self.parts is None else display_halves(self.parts)

    @cached_property
    def relative(self) -> RelativeError | None:
        return None if self.parts is None else RelativeError(self.parts, RELMSE_FLOOR)

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

    @property
    def same(self) -> bool:
        """Whether the image displays the same as the reference, as a copy of it does.

        Such an image isn't independent of the halves: it is compared with the mean.
        """
        return np.array_equal(*self.srgb)


def display_error(images: Pair) -> Estimate | None:
    """The mean square error of display values; None without halves, like the two below."""
    halves = images.target.srgb_halves
    return None if halves is None else mean_product(images.srgb[0], halves)


def relative_error(images: Pair) -> Estimate | None:
    """relMSE."""
    relative = images.target.relative
    return None if relative is None else relative.of(images.linear[0])


def energy(images: Pair) -> Estimate | None:
    """The square of the energy error."""
    halves = images.target.linear_halves
    return None if halves is None else mean_difference(images.linear[0], halves)


def pair(image: np.ndarray, reference: np.ndarray | Target) -> Pair:
    """Two (h, w, 3) images of linear radiance, to be compared.

    A non-finite pixel of `image` is judged as black. Where `reference` is not finite, neither is
    judged (black in both).
    """
    target = reference if isinstance(reference, Target) else Target(reference)
    linear = blacken(image, non_finite(image) | target.unknown)
    return Pair((linear, target.linear), (srgb_from_linear(linear), target.srgb), target)
