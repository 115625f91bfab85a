"""BMFR in float64 NumPy, as plainly as it can be written: world positions, one block after another,
a least-squares fit by singular values of features with rows for the damping; nothing is shared with
the kernels. See denoise/methods/regression/bmfr.py."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from onespp.render.frame import Frame

from .filters import reproject_bilinear


def bmfr(frames: Sequence[Frame], alpha: float = 0.2, alpha_fitted: float = 0.1,
         block_size: int = 32, feature_noise: float = 0.01, demodulate: bool = True) -> np.ndarray:
    """(h, w, 3) the last frame's result; parameters as of `Bmfr`."""
    records, previous, result = None, frames[0], np.zeros(0)
    for i, frame in enumerate(frames):
        shape = frame["id"].shape
        albedo, emission = np.ones((*shape, 3)), np.zeros((*shape, 3))
        is_fitted = frame["id"] >= 0
        if demodulate and "albedo" in frame:
            dark = np.asarray((frame["albedo"] < 0.01).all(-1))
            albedo = np.where(dark[..., None], 1, np.maximum(frame["albedo"], 0.01))
            if "emission" in frame:
                emission = frame["emission"].astype(np.float64)
                is_fitted = is_fitted & ~(dark & (emission > 0).any(-1))
        light = (frame["color"] - emission) / albedo
        old = np.full((*shape, 7), np.nan)
        if records is not None:
            old = reproject_bilinear(previous, frame, records)
        found = np.isfinite(old[..., :1])
        length = np.where(found, np.minimum(old[..., :1] + 1, 255), 1)

        def blended(now, before, least, found=found, length=length):
            weight = np.maximum(least, 1 / length)
            return np.where(found, weight * now + (1 - weight) * before, now)

        mixed = blended(light, old[..., 1:4], alpha)
        shift = [int(block_size * ((step * i) % 16) / 16) for step in (7, 3)]
        fitted = fit(frame, mixed, is_fitted, block_size, shift, feature_noise)
        result = blended(np.where(is_fitted[..., None], fitted, mixed), old[..., 4:], alpha_fitted)
        records, previous = np.concatenate([length, mixed, result], -1), frame
        result = result * albedo + emission
    return result


def fit(frame: Frame, light: np.ndarray, is_fitted: np.ndarray, size: int, shift: Sequence[int],
        feature_noise: float) -> np.ndarray:
    """(h, w, 3) of each pixel, its block's fit."""
    h, w = is_fitted.shape
    eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
    images = {"n": frame["normal"], "x": frame["position"] - eye, "light": light,
              "there": is_fitted}
    # Blocks from row -shift on; what is outside is mirrored, as often as needed.
    rows, columns = (_mirrored(np.arange(-s, n + 2 * size), n) for s, n in zip(shift, (h, w)))
    wide = {k: np.asarray(v, np.float64)[np.ix_(rows, columns)] for k, v in images.items()}
    result = np.zeros((*wide["there"].shape, 3))
    for top in range(0, h + shift[0], size):
        for left in range(0, w + shift[1], size):
            block = slice(top, top + size), slice(left, left + size)
            n, x, c = (wide[k][block].reshape(-1, 3) for k in ("n", "x", "light"))
            there = wide["there"][block].reshape(-1) > 0
            if there.any():
                values = np.zeros(c.shape)
                values[there] = _fitted(n[there], x[there], c[there], feature_noise)
                result[block] = values.reshape(*wide["there"][block].shape, 3)
    return result[shift[0]:, shift[1]:][:h, :w]


def _fitted(n: np.ndarray, x: np.ndarray, light: np.ndarray, feature_noise: float) -> np.ndarray:
    """(pixels, 3) the damped fit, of pixels of one block."""
    extent = np.maximum(np.ptp(x, 0), 1e-3 * np.abs(x).max())
    t = (x - (x.min(0) + x.max(0)) / 2) / extent
    features = np.concatenate([n, t, 4 * t**2], 1)
    features, mean = features - features.mean(0), light.mean(0)
    count = len(x)
    damping = np.sqrt(count * feature_noise**2 / 3) * np.eye(9)
    b = np.linalg.lstsq(np.concatenate([features, damping]),
                        np.concatenate([light - mean, np.zeros((9, 3))]), rcond=None)[0]
    return np.clip(features @ b + mean, light.min(0), light.max(0))


def _mirrored(at: np.ndarray, length: int) -> np.ndarray:
    return np.minimum(at % (2 * length), 2 * length - 1 - at % (2 * length))
