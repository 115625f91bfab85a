"""Intel Open Image Denoise on visibility and on the rest of the light, each by itself.

    colour = E + V' U + R'        R = D + I - V U

E emission, U unshadowed light and V the share of it that arrives, D and I direct and indirect light
(`render/tracer/lights/resampling.py`). V' is the network's result for V as a grey image, with
albedo 1 and the normals; R' its result for R, with albedo and normals. U has no noise, so that
texture and shading of direct light stay as they are, as in our own methods: what these are ahead of
this one is not owed to the split.

V is capped at 1 and what is above is left in R. (With 1.1, as in `inputs/signals.py`, the network
loses 0.03 to 0.6 dB in development scenes; neither is better everywhere.) A frame that lacks the
split is denoised as `Oidn` does it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from onespp.denoise.inputs.repair import repair
from onespp.render.channels import SPLIT
from onespp.render.frame import Frame

from .oidn import Oidn, OidnState, emission_of

LIGHT = ("direct", "indirect", *SPLIT)
"""Channels that a frame must have to be split."""


@dataclass(frozen=True)
class OidnSplit:
    """Open Image Denoise on visibility and on the rest of the light, frame by frame.

    Attributes:
        oidn: what denoises each of them.
    """

    needs: ClassVar[tuple[str, ...]] = Oidn.needs
    uses: ClassVar[tuple[str, ...]] = LIGHT

    oidn: Oidn = field(default_factory=Oidn)

    def init(self, height: int, width: int) -> OidnState:
        """As that of `Oidn`."""
        return self.oidn.init(height, width)

    def __call__(self, frame: Frame, state: OidnState | None) -> tuple[np.ndarray, OidnState]:
        """(h, w, 3) float32; InputError as from `Oidn`."""
        state = state or self.init(frame.height, frame.width)
        if not is_split(frame):
            return self.oidn(frame, state)
        visibility, rest = split(frame)
        return self.joined(frame, visibility, rest, state)

    def joined(self, frame: Frame, visibility: np.ndarray, rest: np.ndarray,
               state: OidnState) -> tuple[np.ndarray, OidnState]:
        """The picture from the two signals, both (h, w, 3) float32, after denoising each."""
        seen, state = self.oidn(_with(frame, visibility, white=True), state)
        other, state = self.oidn(_with(frame, rest), state)
        unshadowed = repair(np.asarray(frame["unshadowed"], np.float32), frame["id"])
        return emission_of(frame) + seen * unshadowed + other, state


def is_split(frame: Frame) -> bool:
    return all(name in frame for name in LIGHT)


def split(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """V in three equal channels, and R; (h, w, 3) float32, repaired."""
    direct, indirect, unshadowed = (
        repair(np.asarray(frame[name], np.float32), frame["id"]) for name in LIGHT[:3])
    visibility = repair(np.atleast_3d(np.asarray(frame["visibility"], np.float32)), frame["id"])
    visibility = np.minimum(visibility, 1)
    return np.repeat(visibility, 3, axis=2), direct + indirect - visibility * unshadowed


def _with(frame: Frame, light: np.ndarray, white: bool = False) -> Frame:
    """The frame with another colour and no emission; white: with albedo 1."""
    images = {k: v for k, v in frame.images.items() if k not in ("emission", *LIGHT)}
    if white:
        images["albedo"] = np.ones_like(light)
    return replace(frame, images={**images, "color": light})
