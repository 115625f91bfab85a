"""An image and its reference, made fit for the measures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .tonemap import srgb_from_linear


def blacken(image: np.ndarray, where: np.ndarray) -> np.ndarray:
    """`image` with the pixels of the (h, w) mask `where` set to 0; itself if there are none."""
    return np.where(where[..., None], np.zeros((), image.dtype), image) if where.any() else image


def non_finite(image: np.ndarray) -> np.ndarray:
    """(h, w) mask of pixels that have a NaN or an infinity in any colour."""
    return np.logical_not(np.isfinite(image).all(axis=-1))


@dataclass(frozen=True)
class Pair:
    """An image and its reference, fit for the measures.

    Attributes:
        linear: (a, b), (h, w, 3) linear radiance.
        srgb: (a, b), (h, w, 3) display values in [0, 1].
    """

    linear: tuple[np.ndarray, np.ndarray]
    srgb: tuple[np.ndarray, np.ndarray]


def pair(image: np.ndarray, reference: np.ndarray) -> Pair:
    """Two (h, w, 3) images of linear radiance, to be compared.

    A non-finite pixel of `image` is judged as black. Where `reference` is not finite, neither is
    judged (black in both).
    """
    unknown = non_finite(reference)
    linear = blacken(image, non_finite(image) | unknown), blacken(reference, unknown)
    return Pair(linear, (srgb_from_linear(linear[0]), srgb_from_linear(linear[1])))
