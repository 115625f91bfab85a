"""Keyframed animation: motions that are pure functions of a float frame number.

    arm = rotation((0, 0, 1), {0: 0, 20: 540, 40: 0})     # one and a half turns, and back
    car = translation({0: (0, 0, 0), 24: (3, 0, 0)}, ease="spline")
    Shape("hand", ..., world_from_object=car @ arm @ translate((0, 1, 0)))

Keyframes are a mapping {frame: value} in the order of the frames. Between two keys, `ease` is
    "linear"  constant speed;
    "smooth"  slow away from each key and slow into the next (smoothstep, u^2 (3 - 2u));
    "spline"  through all keys without stopping (Catmull-Rom, continuous velocity, may overshoot).
Outside the keys the first and the last value hold, unless `loop` is given: then the last key's
value must be the first one's, and the motion repeats for ever.

Sources: Catmull and Rom 1974 with three-point slopes for uneven frames; for orientations the
cumulative cubic of Kim, Kim and Shin 1995 ("A general construction scheme for unit quaternion
curves"), whose velocity is continuous for uneven frames too (squad's is not).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from . import quaternions
from .description import Motion, SceneError
from .transforms import Matrix, Vector, rotate, scale, translate

Ease = Literal["linear", "smooth", "spline"]
Keys = Mapping[float, Any]
Track = Callable[[float], np.ndarray]


class Animation:
    """A motion that composes: `a @ b` does b first, where either may be a plain matrix."""

    __array_ufunc__ = None  # so that `matrix @ animation` is ours and not NumPy's

    def __init__(self, matrix_at: Motion) -> None:
        self._matrix_at = matrix_at

    def __call__(self, frame: float) -> Matrix:
        return self._matrix_at(frame)

    def __matmul__(self, other: Matrix | Motion) -> Animation:
        return compose(self, other)

    def __rmatmul__(self, other: Matrix | Motion) -> Animation:
        return compose(other, self)


def compose(*parts: Matrix | Motion) -> Animation:
    """The product of matrices and motions at each frame; the last one is applied first."""
    def matrix_at(frame: float) -> Matrix:
        product = np.eye(4)
        for part in parts:
            product = product @ (part(frame) if callable(part) else part)
        return product

    return Animation(matrix_at)


def track(keys: Keys, ease: Ease = "smooth", loop: bool = False) -> Track:
    """Values (scalars or vectors) between keyframes, as float64 arrays.

    Raises:
        SceneError: no keys, frames out of order, values of different lengths or not finite,
            an unknown ease, or a loop that does not close.
    """
    frames, values = _checked(keys, ease, loop)
    slopes = _slopes(frames, np.diff(values, axis=0), loop) if ease == "spline" else None

    def value_at(frame: float) -> np.ndarray:
        i, u, h = _segment(frames, frame, loop)
        a, b = values[i], values[min(i + 1, len(values) - 1)]
        if slopes is None or h == 0:
            return a + (b - a) * _EASE[ease](u)
        return (a + (b - a) * u * u * (3 - 2 * u)
                + h * u * (1 - u) * (slopes[i] * (1 - u) - slopes[i + 1] * u))

    return value_at


def translation(keys: Keys, ease: Ease = "smooth", loop: bool = False) -> Animation:
    """Moves by (x, y, z) offsets."""
    offset = track(keys_of_length(keys, 3, "translation"), ease, loop)
    return Animation(lambda frame: translate(offset(frame)))


def rotation(axis: Vector, keys: Keys, ease: Ease = "smooth", loop: bool = False) -> Animation:
    """Turns about a fixed axis by angles in degrees, any number of turns."""
    _check_axis(axis)
    angle = track(keys_of_length(keys, 0, "rotation"), ease, loop)
    return Animation(lambda frame: rotate(axis, float(angle(frame))))


def scaling(keys: Keys, ease: Ease = "smooth", loop: bool = False) -> Animation:
    """Scales by factors, numbers or (x, y, z)."""
    if isinstance(keys, Mapping) and any(np.ndim(value) for value in keys.values()):
        keys = keys_of_length(keys, 3, "scaling")
    factor = track(keys, ease, loop)
    return Animation(lambda frame: scale(factor(frame)))


def orientation(keys: Keys, ease: Ease = "smooth", loop: bool = False) -> Animation:
    """Turns between orientations given as (axis, degrees), each time the shorter way round.

    Linear and smooth follow the great arc (slerp); for more than half a turn use `rotation`.
    """
    for key in keys.values():
        if not (isinstance(key, tuple | list) and len(key) == 2 and np.shape(key[0]) == (3,)):
            raise SceneError(f"an orientation key is {key!r}: use ((x, y, z), degrees)")
        _check_axis(key[0])
    frames, turns = _checked(
        {frame: quaternions.from_axis_angle(*key) for frame, key in keys.items()}, ease, False)
    steps = np.array([_between(a, b) for a, b in pairwise(turns)]).reshape(-1, 3)
    if loop and len(turns) > 1 and np.linalg.norm(_between(turns[0], turns[-1])) > 1e-9:
        raise SceneError("an animation loops, but its last key is not equal to its first")
    speeds = _slopes(frames, steps, loop) if ease == "spline" else None

    def matrix_at(frame: float) -> Matrix:
        i, u, h = _segment(frames, frame, loop)
        if h == 0:
            return quaternions.to_matrix(turns[i])
        if speeds is None:
            parts = [steps[i] * _EASE[ease](u)]
        else:
            parts = _cumulative_cubic(steps[i], speeds[i] * h / 3, speeds[i + 1] * h / 3, u)
        turn = turns[i]
        for part in parts:
            turn = quaternions.multiply(turn, quaternions.exp(part))
        return quaternions.to_matrix(turn)

    return Animation(matrix_at)


def spin(axis: Vector, degrees_per_frame: float) -> Animation:
    """Turns for ever at constant speed, from no turn at frame 0."""
    _check_axis(axis)
    return Animation(lambda frame: rotate(axis, degrees_per_frame * frame))


def swing(axis: Vector, degrees: float, period: float, phase: float = 0) -> Animation:
    """Swings for ever between +-degrees like a pendulum; phase in periods."""
    _check_axis(axis)
    return Animation(lambda frame: rotate(
        axis, degrees * math.sin(2 * math.pi * (frame / period + phase))))


_EASE: dict[str, Callable[[float], float]] = {
    "linear": lambda u: u,
    "smooth": lambda u: u * u * (3 - 2 * u),
    "spline": lambda u: u,  # a single key: there is nothing to ease
}


def _checked(keys: Keys, ease: str, loop: bool) -> tuple[np.ndarray, np.ndarray]:
    """Keyframes as arrays: frames (n,), values (n,) or (n, k)."""
    if ease not in _EASE:
        raise SceneError(f"unknown ease {ease!r}: use linear, smooth or spline")
    if not isinstance(keys, Mapping) or not keys:
        raise SceneError("an animation has no keyframes: give {frame: value, ...}")
    frames = np.array(list(keys), float)
    if not np.all(np.diff(frames) > 0):
        raise SceneError(f"keyframes {frames.tolist()} are out of order: "
                         "each must come after the one before")
    lengths = {np.shape(value) for value in keys.values()}
    if len(lengths) > 1:
        raise SceneError(f"keyframe values have different shapes, {sorted(lengths)}: "
                         "give every key the same length")
    values = np.array(list(keys.values()), float)
    if not (np.isfinite(values).all() and np.isfinite(frames).all()):
        raise SceneError("a keyframe is not finite")
    if loop and not (len(keys) > 1 and np.allclose(values[0], values[-1])):
        raise SceneError("an animation loops, but its last key is not equal to its first")
    return frames, values


def keys_of_length(keys: Keys, length: int, what: str) -> Keys:
    """The keys, if each value is a number (length 0) or has that length."""
    shape = (length,) if length else ()
    for frame, value in keys.items() if isinstance(keys, Mapping) else ():
        if np.shape(value) != shape:
            wanted = f"{length} numbers" if length else "one number"
            raise SceneError(f"the {what} key at frame {frame} is {value!r}: use {wanted}")
    return keys


def _check_axis(axis: Vector) -> None:
    if np.shape(axis) != (3,) or not np.linalg.norm(axis) > 0:
        raise SceneError(f"a rotation axis is {axis!r}: use three numbers that are not all 0")


def _segment(frames: np.ndarray, frame: float, loop: bool) -> tuple[int, float, float]:
    """Index of the key before `frame`, the place u in [0, 1] up to the next key, its length."""
    first, last = frames[0], frames[-1]
    frame = first + (frame - first) % (last - first) if loop else min(max(frame, first), last)
    if len(frames) == 1:
        return 0, 0.0, 0.0
    i = min(int(np.searchsorted(frames, frame, "right")) - 1, len(frames) - 2)
    h = float(frames[i + 1] - frames[i])
    return i, float(frame - frames[i]) / h, h


def _slopes(frames: np.ndarray, steps: np.ndarray, loop: bool) -> np.ndarray:
    """Velocity at each key from the steps between keys: exact for a parabola."""
    h = np.diff(frames).reshape((-1,) + (1,) * (steps.ndim - 1))
    speeds = steps / h
    if len(speeds) < 2:
        return np.repeat(speeds, 2, axis=0)
    inner = (speeds[:-1] * h[1:] + speeds[1:] * h[:-1]) / (h[:-1] + h[1:])
    if loop:
        first = last = (speeds[-1] * h[0] + speeds[0] * h[-1]) / (h[0] + h[-1])
    else:
        first, last = 2 * speeds[0] - inner[0], 2 * speeds[-1] - inner[-1]
    return np.concatenate([[first], inner, [last]])


def _between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Rotation vector, in the frame of a (and of b), that leads from a to b."""
    return quaternions.log(quaternions.multiply(quaternions.conjugate(a), b))


def _cumulative_cubic(step: np.ndarray, start: np.ndarray, end: np.ndarray,
                      u: float) -> list[np.ndarray]:
    """Rotation vectors to apply in turn at u: Kim et al., eq. 11, cumulative Bernstein basis."""
    inner = quaternions.multiply(quaternions.exp(-start), quaternions.exp(step))
    middle = quaternions.log(quaternions.multiply(inner, quaternions.exp(-end)))
    v = 1 - u
    return [start * (1 - v**3), middle * (u * u * (3 - 2 * u)), end * u**3]
