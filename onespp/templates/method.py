"""A denoising method of one's own.

    onespp denoise data/box --method my_filter.py --set radius=2
    onespp score data/box

What a method is given and must return: docs/own_filter.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from onespp.render.frame import Frame


@dataclass(frozen=True)
class MyFilter:
    """Averages each pixel with those around it that show the same object.

    The fields are the parameters, for `--set`. A value that cannot be is refused when the method is
    built.

    Attributes:
        radius: half width of the square window [pixels, 1 or more].
    """

    radius: int = 1

    # The channels that a frame must have. Without this line: all that it has.
    needs = ("color", "id")

    def __post_init__(self) -> None:
        if self.radius < 1:
            raise ValueError(f"radius is {self.radius}: use 1 or more")

    def init(self, height: int, width: int) -> None:
        """Return the state before the first frame, all that is to be remembered: here nothing."""

    def __call__(self, frame: Frame, state: None) -> tuple[np.ndarray, None]:
        """The image of a frame, (h, w, 3) float32 linear radiance, and the state for the next."""
        color, ids = frame["color"], frame["id"]  # (h, w, 3) float32, (h, w) int32; not to write to
        height, width = ids.shape
        r = self.radius
        padded = np.pad(color, ((r, r), (r, r), (0, 0)))
        padded_ids = np.pad(ids, r, constant_values=-2)  # no object has this number: weight 0
        sums, weights = np.zeros_like(color), np.zeros((height, width, 1), np.float32)
        for y in range(2 * r + 1):
            for x in range(2 * r + 1):
                same = (padded_ids[y:y + height, x:x + width] == ids)[..., None]
                sums += same * padded[y:y + height, x:x + width]
                weights += same
        return sums / weights, state
