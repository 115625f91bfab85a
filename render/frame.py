"""A frame: named images of one size, and the matrices that say where things are.

Symbols: h, w height and width; `b_from_a` a 4x4 float64 matrix that maps column vectors of
space a to space b. Spaces: object (a shape's own), world, camera, screen.

Screen space, after dividing by its fourth component, has x in [0, w) to the right and y in
[0, h) down; the centre of pixel (column x, row y) is (x + 0.5, y + 0.5). That fourth component
is the camera-space depth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from onespp.show.html import Shown, frame_html

from .channels import CHANNELS
from .errors import InputError
from .guides_camera import camera_of_guides

LARGEST_ID = 1 << 16
"""Of objects without matrices, each of which gets one."""


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

    @classmethod
    def from_arrays(cls, *, color: Any, normal: Any = None, depth: Any = None, motion: Any = None,
                    id: Any = None, index: int = 0, camera_from_world: Any = None,
                    screen_from_world: Any = None, world_from_object: Any = None,
                    **channels: Any) -> Frame:
        """A frame of plain arrays, as another renderer gives them.

        Args:
            color: (h, w, 3) linear Rec. 709 radiance.
            normal: (h, w, 3) unit normals that face the camera; in world space, or in any other
                whose axes stay as they are from frame to frame.
            depth: (h, w) camera-space z, not the distance along the ray; 0, negative or not
                finite where there is nothing.
            motion: (h, w, 2) pixels from a pixel's centre to where its surface was in the frame
                before, x to the right and y down. It is believed where matrices say otherwise.
                None, without matrices: surfaces stay where they are on the screen.
            id: (h, w) object IDs from 0 on, -1 for none; default one object where there is depth.
            index: the frame's number.
            camera_from_world, screen_from_world: (4, 4), see the class. Both None: a camera that
                fits depth and normals (`guides_camera.py`).
            world_from_object: (n, 4, 4) by ID; default objects at rest.
            **channels: others of the channel table, as `albedo`.

        Raises:
            InputError: an unknown channel, shapes that disagree, or one matrix without the other.

        Example:
            >>> frame = Frame.from_arrays(color=np.ones((12, 16, 3)), depth=np.full((12, 16), 2.0),
            ...                           normal=np.tile([0.0, 0.0, -1.0], (12, 16, 1)))
            >>> list(frame.images), frame["color"].dtype
            (['color', 'normal', 'depth', 'id', 'motion'], dtype('float32'))
        """
        if (camera_from_world is None) != (screen_from_world is None):
            raise InputError(f"frame {index} has one of camera_from_world and screen_from_world: "
                             "give both, or neither")
        given = {"color": color, "normal": normal, "depth": depth, "motion": motion, "id": id,
                 **channels}
        images = {name: _typed(name, image, index) for name, image in given.items()
                  if image is not None}
        size = images["color"].shape[:2] if images["color"].ndim == 3 else (1, 1)
        if "id" not in images:
            there = images.get("depth", np.ones(size, np.float32))
            images["id"] = np.where(np.isfinite(there) & (there > 0), 0, -1).astype(np.int32)
        if camera_from_world is None:
            images.setdefault("motion", np.zeros((*size, 2), np.float32))
        if world_from_object is None:
            world_from_object = _at_rest(images["id"], index)
        if camera_from_world is not None:
            return cls(index, images, camera_from_world, screen_from_world, world_from_object)
        checked = cls(index, images, np.eye(4), np.eye(4), world_from_object)
        camera, screen = camera_of_guides(images.get("depth"), images.get("normal"), size)
        return replace(checked, camera_from_world=camera, screen_from_world=screen)

    @property
    def height(self) -> int:
        return next(iter(self.images.values())).shape[0]

    @property
    def width(self) -> int:
        return next(iter(self.images.values())).shape[1]

    def _repr_html_(self) -> str:
        """Its colour and all channels, for a notebook."""
        shown = {name: Shown(image, CHANNELS[name].display, CHANNELS[name].about)
                 for name, image in self.images.items()}
        return frame_html(self.index, shown)

    def __contains__(self, channel: str) -> bool:
        return channel in self.images

    def __getitem__(self, channel: str) -> np.ndarray:
        """The image of a channel; InputError if the frame lacks it."""
        if channel not in self.images:
            raise InputError(
                f"frame {self.index} lacks the channel '{channel}' "
                f"(it has {', '.join(self.images)})")
        return self.images[channel]


def _typed(name: str, image: Any, index: int) -> np.ndarray:
    """An image of numbers as float32, of object IDs as int32 if that loses nothing."""
    array = np.asarray(image)
    if name not in CHANNELS or array.dtype.kind not in "fiu":
        return array  # refused later, in words
    if not CHANNELS[name].is_id:
        return array.astype(np.float32)
    return array.astype(np.int32) if array.size and _is_whole(array) else array


def _at_rest(ids: np.ndarray, index: int) -> np.ndarray:
    """A matrix for each object ID that there is."""
    most = int(ids.max()) if ids.size and ids.dtype == np.int32 else 0
    if most > LARGEST_ID:
        raise InputError(f"frame {index} has the object ID {most}: number objects from 0 on, to "
                         f"{LARGEST_ID} at most")
    return np.tile(np.eye(4), (max(most, 0) + 1, 1, 1))


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
