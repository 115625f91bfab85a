"""What networks are fed and what becomes of their result, in NumPy, float64; training reads it as
well. See denoise/methods/learned/method.py."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

SCALE = 16.0  # of light before its logarithm
_TOP = np.log1p(SCALE)
_FARTHEST = 1e15


def compressed(light: np.ndarray) -> np.ndarray:
    """g(L), and -g(-L) below 0."""
    return np.sign(light) * np.log1p(SCALE * np.abs(light)) / _TOP


def expanded(value: np.ndarray) -> np.ndarray:
    """The light of g."""
    return np.sign(value) * np.expm1(np.minimum(np.abs(value) * _TOP, 50)) / SCALE


def texture_of(images: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Albedo a, at least 0.01, or 1 on what reflects nothing, and emission E, of a frame or a clip.
    """
    if "albedo" not in images:
        return np.ones(1), np.zeros(1)
    albedo = np.asarray(images["albedo"], np.float64)
    dark = (albedo < 0.01).all(-1, keepdims=True)
    albedo = np.where(dark, 1, np.maximum(albedo, 0.01))
    return albedo, np.asarray(images.get("emission", np.zeros(1)), np.float64)


def planes_of(images: Mapping[str, np.ndarray], camera_from_world: np.ndarray) -> np.ndarray:
    """(h, w, 7) the input: compressed light over albedo, normal x and y in the view, depth and
    roughness.

    Args:
        images: channels of a frame. camera_from_world: (4, 4).
    """
    albedo, emission = texture_of(images)
    light = (np.asarray(images["color"], np.float64) - emission) / albedo
    normal = images["normal"].astype(np.float64) @ camera_from_world[:3, :3].T
    length, z = np.linalg.norm(normal, axis=-1), images["depth"].astype(np.float64)
    there = (images["id"] >= 0) & (z > 0) & (z < _FARTHEST) & (length > 0.1) & (length < 10)
    normal = np.where(there[..., None], normal / np.where(there, length, 1)[..., None], 0)
    mean = z[there].mean() if there.any() else 1.0
    depth = np.where(there, z / (z + mean), 1)
    roughness = np.clip(images.get("roughness", np.ones(z.shape)), 0, 1)
    return np.concatenate([compressed(light), normal[..., :2],
                           depth[..., None], roughness[..., None]], -1)


def padded(planes: np.ndarray, alignment: int) -> np.ndarray:
    """(..., h, w, c) mirrored below and on the right, to sides that are multiples."""
    sides = [(0, -n % alignment) for n in planes.shape[-3:-1]]
    return np.pad(planes, [(0, 0)] * (planes.ndim - 3) + [*sides, (0, 0)], "symmetric")


def convolved(weights: Mapping[str, np.ndarray], name: str, x: np.ndarray) -> np.ndarray:
    """A layer's 3x3 convolution of (h, w, inputs), 0 outside, without a rectifier."""
    kernel, (h, w, _) = weights[name].astype(np.float64), x.shape
    wide, total = np.pad(x, ((1, 1), (1, 1), (0, 0))), weights[f"{name}.bias"].astype(np.float64)
    for dy in range(3):
        for dx in range(3):
            total = total + wide[dy:dy + h, dx:dx + w] @ kernel[dy, dx]
    return total


def pooled(x: np.ndarray) -> np.ndarray:
    """The greatest of each 2x2 pixels."""
    h, w, c = x.shape
    return x.reshape(h // 2, 2, w // 2, 2, c).max((1, 3))


def beside(x: np.ndarray, skipped: np.ndarray) -> np.ndarray:
    """Twice as large, each pixel the nearest one, beside what was skipped."""
    return np.concatenate([x.repeat(2, 0).repeat(2, 1), skipped], -1)


def denoised(frames: Sequence[Any], forward: Callable[[list[np.ndarray]], list[np.ndarray]],
             alignment: int, radius: int = 7) -> np.ndarray:
    """(h, w, 3) the last frame's result.

    Args:
        forward: planes of each frame -> compressed light of each. radius: of the window that holds
            the result.
    """
    last = frames[-1]
    h, w = last["id"].shape
    found = forward([padded(planes_of(f.images, f.camera_from_world), alignment) for f in frames])
    albedo, emission = texture_of(last.images)
    light = (last["color"] - emission) / albedo
    low, high = np.empty_like(light), np.empty_like(light)
    for y in range(h):
        for x in range(w):
            window = light[max(y - radius, 0):y + radius + 1, max(x - radius, 0):x + radius + 1]
            low[y, x], high[y, x] = window.min((0, 1)), window.max((0, 1))
    return np.clip(expanded(found[-1][:h, :w]), low, high) * albedo + emission
