"""Adaptive temporal filtering (A-SVGF): SVGF whose history gives way where shading has changed.

Symbols: now, before the luminances of a sample of the last frame, shaded again in this one with the
same random numbers (`render/gradient.py`); S the 3x3 strata of the image; F an a-trous filter
over strata, {1/16, 1/4, 3/8, 1/4, 1/16}^2 at steps 1, 2, 4, ...

    g = F[sum |now - before|] / F[sum max(now, before)],  lambda = clamp(gradient_scale g, 0, 1)

of direct and indirect light each, and `moments.py` says what lambda does to their histories.

Source: Schied, Peters and Dachsbacher 2018, "Gradient estimation for real-time adaptive temporal
filtering", doi:10.1145/3233301. Defaults of alpha and history length are Quake II RTX's; those of
the gradient filter were chosen on twelve frames each of box and room that no table reports.

Departures:
- F has no edge weights: a change of light beside an object reaches a few pixels of it as well.
- There are two signals, direct and indirect; specular light is part of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import drjit as dr
import numpy as np

from render.channels import REPLAY
from render.frame import Frame

from .arrays import Color, Float
from .atrous import LARGEST_LEVELS, SPLINE
from .history import RecordState
from .lanes import OnLanes
from .parameters import check_positive, check_range, check_whole
from .stencil import Planes, Stencil, Step, Taps, window
from .structure import evaluate
from .surface import Surface
from .svgf import Svgf, added_up

STRATUM = 3          # pixels, side
_LEAST = 1e-6        # radiance; darker samples say nothing


@dataclass(frozen=True)
class Asvgf(Svgf):
    """SVGF with an adaptive weight of history, by gradients over time (A-SVGF).

    Frames need the channels `replay` and `replay_before` (render with `--channels +gradient`).

    Attributes: those of `Svgf` (`alpha` is that of direct light), and
        alpha_indirect: least weight of the current frame in indirect light [1, 1e-6 to 1].
        gradient_levels: levels of the gradients' a-trous filter [1, 1 to 8].
        gradient_scale: inverse of the relative change of shading that discards all history
            [1, above 0].

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Asvgf(gradient_scale=2.0)
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    alpha: float = 0.02
    max_history_length: float = 256.0
    alpha_indirect: float = 0.01
    gradient_levels: int = 3
    gradient_scale: float = 1.0

    needs: ClassVar[tuple[str, ...]] = (*OnLanes.needs, *REPLAY)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_range(self, "alpha_indirect", 1e-6, 1.0)
        check_positive(self, "gradient_scale")
        check_whole(self, "gradient_levels", LARGEST_LEVELS)

    def init_on(self, stencil: Stencil) -> AsvgfState:
        plain = super().init_on(stencil)
        return AsvgfState(plain.stencil, plain.records,
                          gradients=Gradients.make(stencil, self.gradient_levels))

    def alphas(self, count: int) -> list[float]:
        return [self.alpha, self.alpha_indirect][:count]

    def on_lanes(self, frame: Frame, color: Color, surface: Surface,
                 state: Any) -> tuple[Color, Any]:
        lights, texture = self.read_lights(frame, color, state.stencil)
        changes = state.gradients.find(frame, len(lights), self.gradient_scale)
        filtered, state = self.filter_lights(frame, lights, surface, state, changes)
        return texture.modulate(added_up(filtered)), state


@dataclass(frozen=True)
class AsvgfState(RecordState):
    """`RecordState`, and what filters gradients."""

    gradients: Any = None


@dataclass(frozen=True)
class Gradients:
    """The filter F: a stencil of strata, its planes (two of each signal), their taps and steps."""

    stencil: Stencil
    strata: Stencil
    planes: Planes
    taps: list[Taps]
    steps: list[Step[..., Any]]
    spread: Step[..., Any]

    @staticmethod
    def make(stencil: Stencil, levels: int) -> Gradients:
        height, width = (-(-size // STRATUM) for size in (stencil.height, stencil.width))
        strata = Stencil(height, width, 2 << (levels - 1))
        planes = strata.planes([0.0] * 4)
        taps = [planes.taps([(dy << i, dx << i) for dy, dx in window(2)]) for i in range(levels)]

        def spread(sums: list[Float], scale: list[Float]) -> list[Float]:
            return spread_strata(stencil, strata, sums, scale)

        return Gradients(stencil, strata, planes, taps, [Step(blur) for _ in taps], Step(spread))

    def find(self, frame: Frame, count: int, scale: float) -> list[Float]:
        """lambda of each of `count` signals, on the lanes of the image's stencil."""
        sums = self.strata.load(gather_strata(frame["replay"], frame["replay_before"], count))
        evaluate(sums)
        for taps, step in zip(self.taps, self.steps, strict=True):
            self.planes.store(sums)
            sums = step(taps, sums)
        return self.spread(sums, [self.stencil.opaque(scale)])[:count]


def gather_strata(now: np.ndarray, before: np.ndarray, count: int) -> np.ndarray:
    """(ceil(h / 3), ceil(w / 3), 4) float32: the sums of |now - before|, then of max(now, before).

    Args:
        now, before: (h, w, 2), direct and indirect; below 0 or not finite: no sample.
        count: of signals; for one, luminances of both lights are added up.
    """
    height, width, _ = now.shape
    sampled = (np.isfinite(now) & np.isfinite(before)).all(-1, keepdims=True)
    sampled &= (np.where(sampled, np.minimum(now, before), -1) >= 0).all(-1, keepdims=True)
    now, before = (np.where(sampled, a, 0) for a in (now, before))
    if count == 1:
        now, before = (np.repeat(a.sum(-1, keepdims=True), 2, axis=-1) for a in (now, before))
    both = np.concatenate([np.abs(now - before), np.maximum(now, before)], -1)
    padded = np.pad(both, [(0, -height % STRATUM), (0, -width % STRATUM), (0, 0)])
    rows, columns = padded.shape[0] // STRATUM, padded.shape[1] // STRATUM
    blocks = padded.reshape(rows, STRATUM, columns, STRATUM, 4)
    return blocks.sum((1, 3)).clip(0, 1e18).astype(np.float32)


def blur(taps: Taps, center: list[Float]) -> list[Float]:
    """One level of F."""
    sums: Sequence[Float] = [c * SPLINE[0]**2 for c in center]
    for i, (dy, dx) in enumerate(window(2)):
        h = SPLINE[abs(dy)] * SPLINE[abs(dx)]
        sums = [dr.fma(tap, h, s) for tap, s in zip(taps.at(i), sums)]
        taps.next()
    return list(sums)


def spread_strata(stencil: Stencil, strata: Stencil, sums: list[Float],
                  scale: list[Float]) -> list[Float]:
    """lambda of both signals at each pixel, from its stratum."""
    row, column = stencil.pixel()
    lane = (row // STRATUM) * strata.stride + column // STRATUM
    changes = []
    for s in range(2):
        change, most = (dr.gather(stencil.Float, sums[c], lane) for c in (s, 2 + s))
        g = dr.select(most > _LEAST, change / dr.maximum(most, _LEAST), 0)
        changes.append(dr.minimum(g * scale[0], 1))
    return changes
