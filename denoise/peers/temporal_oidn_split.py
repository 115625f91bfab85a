"""Open Image Denoise on our own split signals after temporal accumulation of each.

Before the network of `oidn_split.py`, visibility, glossy light and the rest are accumulated each
with a history of its own, clamped to each one's own window; diffuse light divided by the albedo,
so that no texture is resampled. Of all forms of the network this is the
one to be measured against: it has our input, our split, and a history.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from onespp.denoise.inputs.demodulation import SMALLEST_ALBEDO
from onespp.denoise.inputs.repair import repair
from onespp.denoise.inputs.surface import GUIDES
from onespp.denoise.methods.temporal import Temporal, TemporalState
from onespp.render.frame import Frame

from .oidn import OidnState
from .oidn_split import OidnSplit, is_split, split
from .temporal_oidn import TemporalOidn

SIGNALS = 3  # visibility, glossy light, diffuse light


@dataclass(frozen=True)
class TemporalOidnSplit:
    """Clamped accumulation of visibility, glossy and diffuse light, then `oidn-split`.

    Attributes:
        temporal: accumulation, as in `temporal-oidn`. split: what follows it.
    """

    needs: ClassVar[tuple[str, ...]] = TemporalOidn.needs
    uses: ClassVar[tuple[str, ...]] = (*OidnSplit.uses, "specular")

    temporal: Temporal = field(default_factory=lambda: TemporalOidn().temporal)
    split: OidnSplit = field(default_factory=OidnSplit)

    def init(self, height: int, width: int) -> SplitState:
        """State before the first frame; InputError as from `Oidn`."""
        network = self.split.init(height, width)
        histories = tuple(self.temporal.init(height, width) for _ in range(SIGNALS))
        return SplitState(histories, network)

    def __call__(self, frame: Frame, state: SplitState | None) -> tuple[np.ndarray, SplitState]:
        """(h, w, 3) float32; InputError as from `Oidn` and `Temporal`."""
        state = state or self.init(frame.height, frame.width)
        if not is_split(frame):
            whole = TemporalOidn(self.temporal, self.split.oidn)
            image, (history, network) = whole(frame, (state.histories[0], state.network))
            return image, SplitState((history, *state.histories[1:]), network)
        visibility, rest = split(frame)
        glossy = (repair(np.asarray(frame["specular"], np.float32), frame["id"])
                  if "specular" in frame else np.zeros_like(rest))
        smooth, histories = [], []
        albedo = _albedo(frame)
        for signal, history in zip((visibility, glossy, (rest - glossy) / albedo),
                                   state.histories):
            guides = {name: frame[name] for name in (*GUIDES, "motion") if name in frame}
            image, after = self.temporal(replace(frame, images={**guides, "color": signal}),
                                         history)
            smooth.append(image)
            histories.append(after)
        visibility, glossy, diffuse = smooth
        image, network = self.split.joined(frame, visibility, glossy + albedo * diffuse,
                                           state.network)
        return image, SplitState(tuple(histories), network)


@dataclass(frozen=True)
class SplitState:
    """A history of each signal, in the order of the call, and the network."""

    histories: tuple[TemporalState, ...]
    network: OidnState


def _albedo(frame: Frame) -> np.ndarray:
    """What diffuse light is divided by, as in `inputs/demodulation.py`; 1 without an albedo."""
    if "albedo" not in frame:
        return np.ones(1, np.float32)
    albedo = np.where(np.abs(frame["albedo"]) < 1e6, frame["albedo"], np.float32(1))
    dark = (albedo < SMALLEST_ALBEDO).all(axis=2, keepdims=True)
    return np.where(dark, np.float32(1), np.maximum(albedo, np.float32(SMALLEST_ALBEDO)))
