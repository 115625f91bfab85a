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
    """Averages the light of each pixel with that of those around it that show the same object.

    The fields are the parameters, for `--set`. A value that cannot be is refused when the method is
    built.

    Attributes:
        radius: half width of the square window [pixels, 1 or more].
    """

    radius: int = 1

    # The channels that a frame must have. Without this line: all that it has.
    needs = ("color", "albedo", "id")

    def __post_init__(self) -> None:
        if self.radius < 1:
            raise ValueError(f"radius is {self.radius}: use 1 or more")

    def init(self, height: int, width: int) -> None:
        """Return the state before the first frame, all that is to be remembered: here nothing."""

    def __call__(self, frame: Frame, state: None) -> tuple[np.ndarray, None]:
        """The image of a frame, (h, w, 3) float32 linear radiance, and the state for the next."""
        # (h, w, 3) float32, (h, w, 3) float32, (h, w) int32; none of them to be written to
        color, albedo, ids = frame["color"], frame["albedo"], frame["id"]
        height, width = ids.shape
        r = self.radius
        texture = np.maximum(albedo, 0.01)  # not to be blurred: taken out, and put back below
        light = np.pad(color / texture, ((r, r), (r, r), (0, 0)))
        others = np.pad(ids, r, constant_values=-2)  # no object has this number: weight 0
        sums, weights = np.zeros_like(color), np.zeros((height, width, 1), np.float32)
        for y in range(2 * r + 1):
            for x in range(2 * r + 1):
                same = (others[y:y + height, x:x + width] == ids)[..., None]
                sums += same * light[y:y + height, x:x + width]
                weights += same
        return texture * sums / weights, state
