"""The one tone map: linear Rec. 709 radiance to clipped sRGB, and back.

Every dB, picture and movie goes through it, at exposure 1, so that they show the same thing.
dB of different tone maps don't compare: name it wherever one stands (`TONE_MAP`).

Source: IEC 61966-2-1:1999. Values are not quantised to 8 bits.
"""

from __future__ import annotations

import numpy as np

from onespp.show.srgb import bytes_from_linear, srgb_from_linear

__all__ = ["TONE_MAP", "bytes_from_linear", "linear_from_srgb", "srgb_from_linear"]

TONE_MAP = "clipped sRGB"


def linear_from_srgb(srgb: np.ndarray) -> np.ndarray:
    """Inverse of `srgb_from_linear` on [0, 1], outside of which it clips."""
    y = np.clip(srgb, 0.0, 1.0)
    return np.where(y <= 0.04045, y / 12.92, ((y + 0.055) / 1.055) ** 2.4)
