"""Images for a page that is opened from disk, where a script is all that a browser may load.

A packed image is a JavaScript file with one call: `onesppImage(key, head, text)`. `text` is base64
of a zlib stream of 16-bit words, all high bytes first, then all low bytes; its words are half
floats (or whole numbers), `drop` low bits of the mantissa rounded away, and each is the difference
from its left neighbour (from the pixel above in the first column), plane after plane. In colours
red and blue are differences from green before that. `page/pixels.js` undoes it.

With 8 of 10 bits of the mantissa a value is off by 0.2 % at most, which is less than half a step
of an 8-bit display at any exposure: pictures and error maps look as the originals do, at a fifth of
the bytes of float32. Figures never come from here.
"""

from __future__ import annotations

import base64
import json
import zlib
from dataclasses import dataclass

import numpy as np

_MANTISSA, _FLOAT_MANTISSA = 10, 23  # bits of a half and of a float32


@dataclass(frozen=True)
class Kind:
    """How a kind of image is stored.

    Attributes:
        bits: of mantissa kept. color: its planes are colours. whole: it holds whole numbers.
        strategy: of zlib. Noise and texture repeat nothing: to look for it takes six times as
            long, for no fewer bytes.
    """

    bits: int
    color: bool = False
    whole: bool = False
    strategy: int = zlib.Z_DEFAULT_STRATEGY


RADIANCE = Kind(8, color=True, strategy=zlib.Z_RLE)
GUIDE = Kind(10)
WHOLE = Kind(10, whole=True)
"""Whole numbers from -1 to 65534, as object IDs are."""


def pack(key: str, image: np.ndarray, kind: Kind) -> str:
    """The text of the file that holds an image.

    Args:
        key: what the page asks for it by.
        image: (h, w) or (h, w, c). Values beyond the range of half floats are clipped.
    """
    planes = np.moveaxis(np.atleast_3d(image), 2, 0)
    drop = 0 if kind.whole else _MANTISSA - kind.bits
    words = np.stack([_whole(p) if kind.whole else _half(p, drop) for p in planes])
    color = kind.color and len(words) == 3
    if color:
        words[0] -= words[1]
        words[2] -= words[1]
    words[:, :, 1:] -= words[:, :, :-1].copy()
    words[:, 1:, 0] -= words[:, :-1, 0].copy()
    data = (words >> 8).astype(np.uint8).tobytes() + words.astype(np.uint8).tobytes()
    head = {"width": planes.shape[2], "height": planes.shape[1], "planes": len(planes),
            "drop": drop, "color": color, "whole": kind.whole}
    zlib_ = zlib.compressobj(strategy=kind.strategy)
    text = base64.b64encode(zlib_.compress(data) + zlib_.flush()).decode()
    return f'onesppImage({json.dumps(key)},{json.dumps(head, separators=(",", ":"))},"{text}");\n'


def _half(plane: np.ndarray, drop: int) -> np.ndarray:
    """(h, w) uint16: half floats without their last bits, shifted down.

    The mantissa is rounded as float32, once: rounding to half first would round some up twice.
    """
    largest = np.array(0x7BFF >> drop << drop, np.uint16).view(np.float16)
    finite = np.isfinite(plane)
    clipped = np.clip(np.where(finite, plane, 0), -float(largest), float(largest))
    lost = _FLOAT_MANTISSA - _MANTISSA + drop
    bits = clipped.astype(np.float32).view(np.uint32)
    rounded = ((bits + np.uint32(1 << (lost - 1))) >> lost << lost).view(np.float32)
    kept = np.where(finite, rounded, plane).astype(np.float16)
    return kept.view(np.uint16) >> drop


def _whole(plane: np.ndarray) -> np.ndarray:
    return (np.asarray(plane, np.int64) + 1).astype(np.uint16)
