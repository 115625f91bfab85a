"""Small pictures of a result and its error, as JPEG files, for the pages of the docs."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np

from onespp.denoise.metrics.tonemap import bytes_from_linear
from onespp.denoise.report.contact_sheets import display_error
from onespp.denoise.report.panels import error_picture, resize

QUALITY = 75  # of the files


def beside_error(images: Sequence[np.ndarray], reference: np.ndarray) -> np.ndarray:
    """(h, n w, 3) uint8: linear images, and right of them the error of the first."""
    return np.hstack([*map(bytes_from_linear, images),
                      error_picture(display_error(images[0], reference))])


def jpeg(picture: np.ndarray, scale: int = 1) -> bytes:
    """A JPEG file of an (h, w, 3) uint8 picture, each pixel `scale` pixels wide."""
    height, width = picture.shape[:2]
    file = io.BytesIO()
    resize(picture, (scale * height, scale * width)).save(file, format="JPEG", quality=QUALITY)
    return file.getvalue()
