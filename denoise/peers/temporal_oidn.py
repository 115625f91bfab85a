"""Intel Open Image Denoise after temporal accumulation."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from onespp.denoise.methods.temporal import Temporal, TemporalState
from onespp.render.frame import Frame

from .oidn import Oidn, OidnState, emission_of


@dataclass(frozen=True)
class TemporalOidn:
    """Clamped temporal accumulation of the noisy colour, then Open Image Denoise.

    Attributes:
        temporal: accumulation; with less of it than by default, as the network takes out what
            noise is left, and lag it cannot. oidn: what follows it.
    """

    needs: ClassVar[tuple[str, ...]] = tuple(dict.fromkeys((*Temporal.needs, *Oidn.needs)))

    temporal: Temporal = field(default_factory=lambda: Temporal(alpha=0.5, color_box=2.0))
    oidn: Oidn = field(default_factory=Oidn)

    def init(self, height: int, width: int) -> tuple[TemporalState, OidnState]:
        return self.temporal.init(height, width), self.oidn.init(height, width)

    def __call__(self, frame: Frame, state: tuple[TemporalState, OidnState] | None
                 ) -> tuple[np.ndarray, tuple[TemporalState, OidnState]]:
        state = state or self.init(frame.height, frame.width)
        emission = emission_of(frame) if self.oidn.emission_apart else np.zeros(1, np.float32)
        images = {k: v for k, v in frame.images.items() if k != "emission"}
        light = replace(frame, images={**images, "color": frame["color"] - emission})
        color, history = self.temporal(light, state[0])
        image, network = self.oidn(replace(frame, images={**images, "color": color}), state[1])
        return image + emission, (history, network)
