"""A frame: named images of one size, and the matrices that say where things are.

Symbols: h, w height and width; `b_from_a` a 4x4 float64 matrix that maps column vectors of
space a to space b. Spaces: object (a shape's own), world, camera, screen.

Screen space, after dividing by its fourth component, has x in [0, w) to the right and y in
[0, h) down; the centre of pixel (column x, row y) is (x + 0.5, y + 0.5). That fourth component
is the camera-space depth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from .channels import CHANNELS
from .errors import InputError


@dataclass(frozen=True)
class Frame:
    """One rendered frame.

    Attributes:
        index: frame number in the animation.
        images: channel name -> array; (h, w) for one component, else (h, w, c), float32 (of other
            floats, methods make that), object IDs int32. See `render/channels.py` for meaning and
            units.
        camera_from_world, screen_from_world: (4, 4) float64.
        world_from_object: (n, 4, 4) float64, indexed by object ID.

    Raises:
        InputError: an unknown channel, an image of another type or without pixels, shapes that
            disagree, IDs that are not whole, a non-finite matrix.
    """

    index: int
    images: Mapping[str, np.ndarray]
    camera_from_world: np.ndarray
    screen_from_world: np.ndarray
    world_from_object: np.ndarray

    def __post_init__(self) -> None:
        if not isinstance(self.images, Mapping) or not self.images:
            raise InputError(f"frame {self.index} has no images: give a dict of arrays by channel")
        size = None
        for name, image in self.images.items():
            if name not in CHANNELS:
                raise InputError(f"frame {self.index} has an unknown channel '{name}'")
            c = CHANNELS[name].components
            _check_type(image, "fiu" if CHANNELS[name].is_id else "f",
                        f"channel '{name}' of frame {self.index}")
            if CHANNELS[name].is_id and image.dtype != np.int32 and not _is_whole(image):
                raise InputError(f"channel '{name}' of frame {self.index} has other values than "
                                 "whole numbers of 32 bits: use int32")
            if image.ndim != (2 if c == 1 else 3) or (c > 1 and image.shape[2] != c):
                raise InputError(
                    f"channel '{name}' of frame {self.index} has shape {image.shape}, "
                    f"expected (h, w{'' if c == 1 else f', {c}'})")
            size = size or image.shape[:2]
            if image.shape[:2] != size:
                raise InputError(
                    f"channel '{name}' of frame {self.index} is {image.shape[1]}x{image.shape[0]}, "
                    f"the others are {size[1]}x{size[0]}")
        for name, dimensions in (("camera_from_world", 2), ("screen_from_world", 2),
                                 ("world_from_object", 3)):
            matrix = _matrix(getattr(self, name), f"{name} of frame {self.index}", dimensions)
            object.__setattr__(self, name, matrix)
        object.__setattr__(self, "images", MappingProxyType(dict(self.images)))

    @property
    def height(self) -> int:
        return next(iter(self.images.values())).shape[0]

    @property
    def width(self) -> int:
        return next(iter(self.images.values())).shape[1]

    def __contains__(self, channel: str) -> bool:
        return channel in self.images

    def __getitem__(self, channel: str) -> np.ndarray:
        """The image of a channel; InputError if the frame lacks it."""
        if channel not in self.images:
            raise InputError(
                f"frame {self.index} lacks the channel '{channel}' "
                f"(it has {', '.join(self.images)})")
        return self.images[channel]


def _check_type(image: Any, kinds: str, what: str) -> None:
    """InputError unless it is an array with values, of one of NumPy's kinds of numbers."""
    if not isinstance(image, np.ndarray):
        raise InputError(f"{what} is a {type(image).__name__}: use a NumPy array")
    if image.dtype.kind not in kinds:
        raise InputError(f"{what} is of {image.dtype}: use float32"
                         + (" or int32" if "i" in kinds else ""))
    if not image.size:
        raise InputError(f"{what} has no pixels")


def _is_whole(image: np.ndarray) -> bool:
    """Whether int32 holds the same values."""
    return bool((np.abs(image.astype(np.float64)) <= 2**31 - 1).all()
                and (image == np.floor(image)).all())


def _matrix(value: Any, what: str, dimensions: int) -> np.ndarray:
    """A finite (4, 4) or, of three dimensions, (n, 4, 4) float64; InputError if it is not one."""
    try:
        matrix = np.asarray(value, np.float64)
    except (TypeError, ValueError):  # not numbers, or rows of several lengths
        matrix = np.empty(0)
    if (matrix.ndim, matrix.shape[-2:]) != (dimensions, (4, 4)) or not np.isfinite(matrix).all():
        shape = "a finite 4x4 matrix" if dimensions == 2 else "finite 4x4 matrices, (n, 4, 4)"
        raise InputError(f"{what} is not {shape}")
    return matrix
