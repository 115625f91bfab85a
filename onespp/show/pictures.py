"""What an image looks like: 8-bit sRGB, by what its values are."""

from __future__ import annotations

from enum import Enum

import numpy as np

from .srgb import bytes_from_linear


class Display(Enum):
    """How a picture shows an image."""

    LIGHT = "tone-mapped, as radiance"
    AXES = "components of a unit vector, -1 to 1"
    RANGE = "from its least to its greatest value"
    UNIT = "0 to 1"
    OBJECT = "a colour for each object"


_GOLDEN = 0.618034  # of a turn of hue from one object to the next: neighbours differ most


def picture(image: np.ndarray, display: Display = Display.LIGHT) -> np.ndarray:
    """(h, w, 3) uint8 of an (h, w) or (h, w, c) image; what is not a number is black, or 0."""
    if display is Display.OBJECT:
        return _objects(image)
    if display is Display.LIGHT:
        return bytes_from_linear(image)
    values = np.nan_to_num(np.asarray(image, np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    if display is Display.AXES:
        shown = (values + 1) / 2
    elif display is Display.RANGE:
        shown = _stretched(values)
    else:
        shown = values
    return np.rint(255 * np.clip(_three(shown), 0, 1)).astype(np.uint8)


def fitted(image: np.ndarray, widest: int) -> np.ndarray:
    """Pixels of an image at steps that make it at most so many wide."""
    step = -(-image.shape[1] // widest)
    return image[::step, ::step]


def _stretched(values: np.ndarray) -> np.ndarray:
    """From the least to the greatest value, without the 1 % at either end."""
    low, high = np.quantile(values, (0.01, 0.99))
    return (values - low) / (high - low if high > low else 1)


def _three(image: np.ndarray) -> np.ndarray:
    """Of one component grey; of two red and green."""
    planes = np.atleast_3d(image)
    if planes.shape[2] == 1:
        return np.repeat(planes, 3, axis=2)
    return np.pad(planes, ((0, 0), (0, 0), (0, 3 - planes.shape[2])))


def _objects(ids: np.ndarray) -> np.ndarray:
    """A colour for each ID; none is black."""
    hue = 6 * ((np.maximum(ids, 0) * _GOLDEN)[..., None] + np.array([0, 1 / 3, 2 / 3])) % 6
    color = 0.35 + 0.6 * np.clip(np.abs(hue - 3) - 1, 0, 1)
    return np.rint(255 * np.where((ids >= 0)[..., None], color, 0)).astype(np.uint8)
