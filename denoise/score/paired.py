"""How well the difference of two methods is known: their errors by the reference's noise cancel.

Both are judged by the same halves, so a method's error is largely the other's (`halves.py` has the
covariance). Symbols: m_i mean square of method i in a frame, C_ij covariance of m_i and m_j, k =
10 / ln 10. By the delta method the difference of two dB has the variance

    k^2 (C_ii / m_i^2 + C_jj / m_j^2 - 2 C_ij / (m_i m_j)),

of which the mean over frames is taken; where a frame's m isn't resolved, of sums over frames.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from statistics import fmean

import numpy as np

from onespp.denoise.metrics.estimate import Estimate

_K = 10 / math.log(10)


class PairedErrors:
    """Sees the headline's estimates of all methods, frame by frame."""

    def __init__(self) -> None:
        self._frames: dict[tuple[str, str], list[tuple[float, float, np.ndarray]]] = {}
        self._unresolved: set[str] = set()

    def add(self, estimates: Mapping[str, Estimate]) -> None:
        """estimates: method -> mean square of a frame, with its noise."""
        names = [name for name, e in estimates.items() if e.noise is not None]
        if not names:
            return
        noise = [n for name in names if (n := estimates[name].noise) is not None]
        first, second, both = np.stack(noise, axis=1)
        covariance = first @ first.T + second @ second.T - both @ both.T
        self._unresolved |= {name for name in names if not estimates[name].resolved}
        for i, a in enumerate(names):
            for j, b in enumerate(names[:i]):
                self._frames.setdefault((a, b), []).append(
                    (estimates[a].mean, estimates[b].mean, covariance[np.ix_([i, j], [i, j])]))

    def errors(self) -> dict[str, dict[str, float]]:
        """Method -> other -> standard error of the difference of their sequences' dB."""
        found: dict[str, dict[str, float]] = {}
        for (a, b), frames in self._frames.items():
            rows = frames
            if {a, b} & self._unresolved:
                rows = [(fmean(f[0] for f in frames), fmean(f[1] for f in frames),
                         np.mean([f[2] for f in frames], axis=0))]
            if all(row[0] > 0 and row[1] > 0 for row in rows):
                total = sum(_variance(*row) for row in rows) / len(rows) / len(frames)
                found.setdefault(a, {})[b] = found.setdefault(b, {})[a] = math.sqrt(max(total, 0))
        return found


def _variance(m: float, n: float, covariance: np.ndarray) -> float:
    """Of the difference of two dB."""
    slope = np.array([_K / m, -_K / n])
    return float(slope @ covariance @ slope)
