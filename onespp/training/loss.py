"""What networks are trained to.

Symbols: P result, T truth, both compressed light (g of denoise/methods/learned/method.py), t a
frame of the clip. Mean over pixels and components of

    0.8 |P - T| + 0.1 |LoG P - LoG T| + 0.1 |(P_t - P_t-1) - (T_t - T_t-1)|

and over frames, weighted by `FRAME_WEIGHTS`: what comes late in a clip has a history to use. LoG is
a Gaussian of 1.5 pixels in seven taps along rows and columns, and the Laplacian of its result.

Source: Chaitanya et al. 2017, section 4: the shares, the sigma and the frame weights. Departures:
light is compressed by g and not by the power 0.2 (see `rae.py`); the frame weights are divided by
their sum; the image is mirrored at its border for the Gaussian.
"""

# pyright: standard, reportMissingImports=false
from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

FRAME_WEIGHTS = (0.011, 0.044, 0.135, 0.325, 0.607, 0.882, 1.0)
"""Of the seven frames of a clip; shorter ones have the last of them."""
SHARES = (0.8, 0.1, 0.1)  # of pixels, of gradients, of changes in time
_SIGMA, _RADIUS = 1.5, 3

Array = Any


def loss(found: Array, truth: Array) -> Array:
    """A number; images (batch, time, h, w, 3)."""
    time = found.shape[1]
    weights = np.array(FRAME_WEIGHTS[-time:])
    error = found - truth
    in_time = jnp.concatenate([jnp.zeros_like(error[:, :1]), error[:, 1:] - error[:, :-1]], 1)
    terms = (error, _edges(error), in_time)  # all of them linear in P - T
    frames = sum(share * jnp.abs(term).mean((0, 2, 3, 4)) for share, term in zip(SHARES, terms))
    return (frames * weights).sum() / weights.sum()


def _edges(image: Array) -> Array:
    """The Laplacian of a Gaussian."""
    taps = np.exp(-0.5 * (np.arange(-_RADIUS, _RADIUS + 1) / _SIGMA)**2)
    for axis in (2, 3):
        image = _along(image, axis, taps / taps.sum())
    return sum(_along(image, axis, np.array([1.0, -2, 1])) for axis in (2, 3))


def _along(image: Array, axis: int, taps: np.ndarray) -> Array:
    radius, size = len(taps) // 2, image.shape[axis]
    sides = [(radius, radius) if a == axis else (0, 0) for a in range(image.ndim)]
    wide = jnp.pad(image, sides, "symmetric")
    window = [slice(None)] * axis
    return sum(float(w) * wide[(*window, slice(i, i + size))] for i, w in enumerate(taps))
