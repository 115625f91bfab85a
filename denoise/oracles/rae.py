"""The recurrent autoencoder in float64 NumPy, as plainly as it can be written, and the planes that
it is fed, which training reads as well. See denoise/methods/recurrent/rae.py."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

SCALE = 16.0  # of light before its logarithm
_TOP = np.log1p(SCALE)
_FARTHEST = 1e15
_LEVELS = 5


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


def padded(planes: np.ndarray, alignment: int = 1 << _LEVELS) -> np.ndarray:
    """(..., h, w, c) mirrored below and on the right, to sides that are multiples."""
    sides = [(0, -n % alignment) for n in planes.shape[-3:-1]]
    return np.pad(planes, [(0, 0)] * (planes.ndim - 3) + [*sides, (0, 0)], "symmetric")


def forward(weights: Mapping[str, np.ndarray], inputs: Iterable[np.ndarray]) -> list[np.ndarray]:
    """(h, w, 3) compressed light of each frame, of planes (h, w, 7), which are `padded`."""
    memory: dict[int, np.ndarray] = {}
    return [_frame(weights, planes, memory) for planes in inputs]


def _frame(weights: Mapping[str, np.ndarray], planes: np.ndarray,
           memory: dict[int, np.ndarray]) -> np.ndarray:
    x, skipped = planes, [planes]
    for i in range(_LEVELS):
        x = _leaky(_convolved(weights, f"down{i}", x))
        h, w, c = x.shape
        x = x.reshape(h // 2, 2, w // 2, 2, c).max((1, 3))
        x = _leaky(_convolved(weights, f"block{i}.input", x))
        x = np.concatenate([x, memory.get(i, np.zeros_like(x))], -1)
        x = _leaky(_convolved(weights, f"block{i}.mix", x))
        x = memory[i] = _leaky(_convolved(weights, f"block{i}.output", x))
        skipped.append(x)
    for i in reversed(range(_LEVELS)):
        x = np.concatenate([x.repeat(2, 0).repeat(2, 1), skipped[i]], -1)
        x = _leaky(_convolved(weights, f"up{i}.join", x))
        x = _convolved(weights, f"up{i}.out", x)
        x = _leaky(x) if i else x
    return x


def _convolved(weights: Mapping[str, np.ndarray], name: str, x: np.ndarray) -> np.ndarray:
    kernel, (h, w, _) = weights[name].astype(np.float64), x.shape
    wide, total = np.pad(x, ((1, 1), (1, 1), (0, 0))), weights[f"{name}.bias"].astype(np.float64)
    for dy in range(3):
        for dx in range(3):
            total = total + wide[dy:dy + h, dx:dx + w] @ kernel[dy, dx]
    return total


def _leaky(x: np.ndarray) -> np.ndarray:
    return np.where(x > 0, x, 0.1 * x)


def rae(frames: Sequence[Any], weights: Mapping[str, np.ndarray], radius: int = 7) -> np.ndarray:
    """(h, w, 3) the last frame's result."""
    inputs = [padded(planes_of(frame.images, frame.camera_from_world)) for frame in frames]
    last = frames[-1]
    h, w = last["id"].shape
    found = expanded(forward(weights, inputs)[-1][:h, :w])
    albedo, emission = texture_of(last.images)
    light = (last["color"] - emission) / albedo
    low, high = np.empty_like(light), np.empty_like(light)
    for y in range(h):
        for x in range(w):
            window = light[max(y - radius, 0):y + radius + 1, max(x - radius, 0):x + radius + 1]
            low[y, x], high[y, x] = window.min((0, 1)), window.max((0, 1))
    return np.clip(found, low, high) * albedo + emission
