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

import numpy as np

from .channels import CHANNELS
from .errors import InputError


@dataclass(frozen=True)
class Frame:
    """One rendered frame.

    Attributes:
        index: frame number in the animation.
        images: channel name -> array; (h, w) for one component, else (h, w, c), float32,
            `id` int32. See `render/channels.py` for meaning and units.
        camera_from_world, screen_from_world: (4, 4) float64.
        world_from_object: (n, 4, 4) float64, indexed by object ID.

    Raises:
        InputError: an unknown channel, shapes that disagree, a non-finite matrix.
    """

    index: int
    images: Mapping[str, np.ndarray]
    camera_from_world: np.ndarray
    screen_from_world: np.ndarray
    world_from_object: np.ndarray

    def __post_init__(self) -> None:
        if not self.images:
            raise InputError(f"frame {self.index} has no images")
        size = None
        for name, image in self.images.items():
            if name not in CHANNELS:
                raise InputError(f"frame {self.index} has an unknown channel '{name}'")
            c = CHANNELS[name].components
            if image.ndim != (2 if c == 1 else 3) or (c > 1 and image.shape[2] != c):
                raise InputError(
                    f"channel '{name}' of frame {self.index} has shape {image.shape}, "
                    f"expected (h, w{'' if c == 1 else f', {c}'})")
            size = size or image.shape[:2]
            if image.shape[:2] != size:
                raise InputError(
                    f"channel '{name}' of frame {self.index} is {image.shape[1]}x{image.shape[0]}, "
                    f"the others are {size[1]}x{size[0]}")
        for name in ("camera_from_world", "screen_from_world", "world_from_object"):
            matrix = np.asarray(getattr(self, name), np.float64)
            if matrix.shape[-2:] != (4, 4) or not np.isfinite(matrix).all():
                raise InputError(f"{name} of frame {self.index} is not a finite 4x4 matrix")
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
