"""Textures of a file: images as linear values, and how they lie on a surface.

glTF's uv (0, 0) is the upper left corner of an image, as it is for Mitsuba's bitmaps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from onespp.render.mitsuba.plugins import plain
from onespp.render.mitsuba.variant import mi

from .document import Document
from .item import Item

_REPEAT, _CLAMP, _MIRROR, _NEAREST = 10497, 33071, 33648, 9728
_WRAPS = {_REPEAT: "repeat", _CLAMP: "clamp", _MIRROR: "mirror"}


@dataclass(frozen=True)
class Texture:
    """An image on a surface.

    Attributes:
        pixels: (h, w, 4) float32 in [0, 1]; of colours linear. uv_set: of the mesh's.
        placed: what else its dictionary says: wrap_mode, filter_type, uv_from_surface.
    """

    pixels: np.ndarray
    uv_set: int
    placed: dict[str, Any]

    def dictionary(self, values: np.ndarray, **other: Any) -> dict[str, Any]:
        """Mitsuba's dictionary of other values, (h, w, 1) or (h, w, 3), in the same place."""
        return {"type": "bitmap", "bitmap": values, "raw": True, **self.placed, **other}


class Textures:
    """Images, each read once as colours and once as data."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._made: dict[tuple[str, bool], np.ndarray] = {}

    def texture(self, item: Item, name: str, color: bool = False) -> Texture | None:
        """The texture that `name` of an item refers to, None where it has none.

        Args:
            color: it holds sRGB colours, which become linear; its alpha is linear anyway.

        Raises:
            SceneError: an image that is not there, or cannot be read.
        """
        if name not in item:
            return None
        reference = item.part(name)
        texture = self._document.refer(reference, "index", "textures")
        if "source" not in texture:
            raise texture.error("it has no image of a kind that can be read here: export with PNG "
                                "or JPEG textures")
        image = self._document.refer(texture, "source", "images")
        key = (image.path, color)
        if key not in self._made:
            self._made[key] = self._pixels(image, color)
        turned = reference.extension("KHR_texture_transform")
        uv_set = turned.whole("texCoord", reference.whole("texCoord", 0))
        placed = self._sampler(texture)
        if turned.value:
            placed["uv_from_surface"] = _transform(turned)
        return Texture(self._made[key], uv_set, placed)

    def _sampler(self, texture: Item) -> dict[str, Any]:
        if "sampler" not in texture:
            return {"wrap_mode": "repeat"}
        sampler = self._document.refer(texture, "sampler", "samplers")
        wraps = [sampler.whole(name, _REPEAT) for name in ("wrapS", "wrapT")]
        if unknown := {*wraps} - {*_WRAPS}:
            raise sampler.error(f"it wraps by {min(unknown)}: there are "
                                f"{', '.join(map(str, _WRAPS))}")
        if wraps[0] != wraps[1]:
            self._document.leave(sampler, "wrapT where it is not wrapS")
        made: dict[str, Any] = {"wrap_mode": _WRAPS[wraps[0]]}
        if sampler.whole("magFilter", 0) == _NEAREST:
            made["filter_type"] = "nearest"
        return made

    def _pixels(self, image: Item, color: bool) -> np.ndarray:
        data = (self._document.content(image) if "uri" in image else
                bytes(self._document.view(self._document.refer(image, "bufferView",
                                                               "bufferViews"))))
        stream = mi.MemoryStream(max(len(data), 1))
        stream.write(data)
        stream.seek(0)
        try:
            bitmap = mi.Bitmap(stream)
            if not color:
                bitmap.set_srgb_gamma(False)
            pixels = np.array(bitmap.convert(mi.Bitmap.PixelFormat.RGBA, mi.Struct.Type.Float32,
                                             srgb_gamma=False))
        except RuntimeError as error:
            raise image.error(f"it is no image that can be read ({plain(error)}): export with PNG "
                              "or JPEG textures") from None
        return np.clip(np.nan_to_num(pixels), 0, 1)


def _transform(item: Item) -> np.ndarray:
    """(4, 4): translation, rotation (counter-clockwise as the image is seen) and scale of uv."""
    (u, v), (across, down) = item.numbers("offset", (0, 0)), item.numbers("scale", (1, 1))
    angle = item.number("rotation", 0)
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.eye(4)
    matrix[:2, :2] = [[c * across, s * down], [-s * across, c * down]]
    matrix[:2, 3] = u, v
    return matrix
