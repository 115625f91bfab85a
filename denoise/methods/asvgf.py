"""Adaptive temporal filtering (A-SVGF): SVGF whose history gives way where shading has changed.

Symbols: now, before the luminances of a sample of the last frame, shaded again in this one with the
same random numbers (`render/tracer/replay.py`); S the 3x3 strata of the image; F an a-trous filter
over strata, {1/16, 1/4, 3/8, 1/4, 1/16}^2 at steps 1, 2, 4, ...

    g = |F[sum now - before]| / F[sum max(now, before)],  lambda = clamp(gradient_scale g, 0, 1)

of direct and indirect light each; what lambda does to their histories: `svgf_accumulation.py`.
F takes differences with their sign: samples that differ by chance cancel, a change of light stays.

Source: Schied, Peters and Dachsbacher 2018, "Gradient estimation for real-time adaptive temporal
filtering", doi:10.1145/3233301. Defaults of alpha and history length are Quake II RTX's; those of
the gradient filter were chosen on twelve frames each of box and room that no table reports.

Departures:
- F has no edge weights: a change of light beside an object reaches a few pixels of it as well.
- There are two signals, direct and indirect; specular light is part of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import drjit as dr
import numpy as np

from onespp.denoise.filters.atrous import LARGEST_LEVELS, SPLINE
from onespp.denoise.history.records import RecordState
from onespp.denoise.jit.arrays import Float
from onespp.denoise.jit.grid import Planes, Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate, mapped
from onespp.denoise.jit.taps import Taps, window
from onespp.render.channels import REPLAY
from onespp.render.frame import Frame

from .base import OnLanes
from .parameters import check_positive, check_range, check_whole
from .svgf import Passes, Svgf

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

    def shading_changes(self, frame: Frame, count: int,
                        state: RecordState[Passes]) -> list[Float]:
        assert isinstance(state, AsvgfState)
        return state.gradients.find(frame, count, self.gradient_scale)

    def alphas(self, count: int) -> list[float]:
        return [self.alpha, self.alpha_indirect][:count]


class OfLights(NamedTuple):
    """A number for each light; both are that of their sum where there is one signal."""

    direct: Float
    indirect: Float


class StrataSums(NamedTuple):
    """sum now - before and sum max(now, before) of each stratum, or means of these."""

    change: OfLights
    largest: OfLights


@dataclass(frozen=True)
class Gradients:
    """The filter F: a stencil of strata, its planes (two of each signal), their taps and steps."""

    stencil: Stencil
    strata: Stencil
    planes: Planes
    taps: list[Taps[StrataSums]]
    steps: list[Step[..., StrataSums]]
    spread: Step[..., OfLights]

    @staticmethod
    def make(stencil: Stencil, levels: int) -> Gradients:
        height, width = (-(-size // STRATUM) for size in (stencil.height, stencil.width))
        strata = Stencil(height, width, 2 << (levels - 1))
        planes = strata.planes([0.0] * 4)
        taps = [planes.taps([(dy << i, dx << i) for dy, dx in window(2)]).named(_strata_sums)
                for i in range(levels)]
        return Gradients(stencil, strata, planes, taps, [Step(blur) for _ in taps],
                         Step(lambda *a: spread_strata(stencil, strata, *a)))

    def find(self, frame: Frame, count: int, scale: float) -> list[Float]:
        """lambda of each of `count` signals, on the lanes of the image's stencil."""
        sums = _strata_sums(*self.strata.load(
            gather_strata(frame["replay"], frame["replay_before"], count)))
        evaluate(sums)
        for taps, step in zip(self.taps, self.steps, strict=True):
            self.planes.store(sums)
            sums = step(taps, sums)
        return list(self.spread(sums, self.stencil.opaque(scale)))[:count]


@dataclass(frozen=True, kw_only=True)
class AsvgfState(RecordState[Passes]):
    """`RecordState`, and what filters gradients."""

    gradients: Gradients


def gather_strata(now: np.ndarray, before: np.ndarray, count: int) -> np.ndarray:
    """(ceil(h / 3), ceil(w / 3), 4) float32: the sums of now - before, then of max(now, before).

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
    both = np.concatenate([now - before, np.maximum(now, before)], -1)
    padded = np.pad(both, [(0, -height % STRATUM), (0, -width % STRATUM), (0, 0)])
    rows, columns = padded.shape[0] // STRATUM, padded.shape[1] // STRATUM
    blocks = padded.reshape(rows, STRATUM, columns, STRATUM, 4)
    return blocks.sum((1, 3)).clip(-1e18, 1e18).astype(np.float32)


def blur(taps: Taps[StrataSums], center: StrataSums) -> StrataSums:
    """One level of F."""
    sums = mapped(lambda c: c * SPLINE[0]**2, center)
    for i, (dy, dx) in enumerate(window(2)):
        sums = mapped(_weighted(SPLINE[abs(dy)] * SPLINE[abs(dx)]), taps.at(i), sums)
        taps.next()
    return sums


def _weighted(h: float) -> Callable[[Float, Float], Float]:
    """Function of (tap, sum)."""
    return lambda tap, total: dr.fma(tap, h, total)


def spread_strata(stencil: Stencil, strata: Stencil, sums: StrataSums, scale: Float) -> OfLights:
    """lambda of both lights at each pixel, from its stratum; scale: gradient_scale."""
    row, column = stencil.pixel()
    lane = (row // STRATUM) * strata.stride + column // STRATUM

    def change_of(light: int) -> Float:
        change, most = (dr.gather(stencil.Float, s[light], lane) for s in sums)
        g = dr.select(most > _LEAST, dr.abs(change) / dr.maximum(most, _LEAST), 0)
        return dr.minimum(g * scale, 1)

    return OfLights(change_of(0), change_of(1))


def _strata_sums(*planes: Float) -> StrataSums:
    return StrataSums(OfLights(*planes[:2]), OfLights(*planes[2:]))
