"""TRMV in float64 NumPy, in world space, a pixel at a time; see methods/reliable_motion/."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from onespp.render.frame import Frame

from .filtered_innovation import on_tangent_planes, shadow_shift
from .filters import previous_screen, reproject_bilinear
from .svgf import svgf

RLB = np.array([[1, 0, 0], [0.2126, 0.7152, 0.0722], [0, 0, 1]])  # red, luminance, blue


def trmv(frames: Sequence[Frame], shadow_motion: bool = True, glossy_motion: bool = True,
         dual_motion: bool = True) -> np.ndarray:
    """The last frame's result; parameters as of `Trmv`."""
    def refine(previous: Frame, frame: Frame, records: np.ndarray, old: np.ndarray,
               direct: np.ndarray) -> np.ndarray:
        old = old.copy()
        if dual_motion:
            beside = reproject_bilinear(previous, frame, records,
                                        at=place_beside_occluder(previous, frame))
            beside[..., ::6] = np.minimum(beside[..., ::6], 1)  # lengths
            old = np.where(np.isfinite(old[..., :1]), old, beside)
        is_valid = np.isfinite(old[..., 0])
        if shadow_motion:
            was, mean, sigma = shadow_surroundings(previous, frame, direct)
            moves = np.isfinite(was[..., 0])
            there = reproject_bilinear(previous, on_tangent_planes(frame, was, moves), records)
            there[..., 1:4] = np.clip(there[..., 1:4] @ RLB.T, mean - sigma, mean + sigma) @ (
                np.linalg.inv(RLB).T)
            where = is_valid & moves & np.isfinite(there[..., 0])
            old[where, 1:6] = there[where, 1:6]
        if glossy_motion:
            there = reproject_bilinear(previous, frame, records, at=image_place(previous, frame))
            where = is_valid & np.isfinite(there[..., 0])
            old[where, 13:18] = there[where, 13:18]
        return old

    return svgf(list(frames), refine=refine, specular=glossy_motion)


def motion_of(previous: Frame, frame: Frame, i: int) -> np.ndarray:
    """World space of a frame to that of the one before it, as object i moved."""
    return previous.world_from_object[i] @ np.linalg.inv(frame.world_from_object[i])


def projected(frame: Frame, point: np.ndarray) -> np.ndarray:
    """(x, y, depth)."""
    p = frame.screen_from_world @ [*point, 1]
    return np.array([p[0] / p[3], p[1] / p[3], p[3]])


def place_beside_occluder(previous: Frame, frame: Frame) -> np.ndarray:
    """(h, w, 2) x - m; NaN where nothing hid the surface."""
    h, w = frame["id"].shape
    screen, result = previous_screen(previous, frame), np.full((h, w, 2), np.nan)
    for y, x in np.argwhere(frame["id"] >= 0):
        px, py, _ = screen[y, x]
        if not (0 <= px < w and 0 <= py < h):
            continue
        column, row = int(px), int(py)
        occluder = previous["id"][row, column]
        if occluder < 0 or occluder == frame["id"][y, x]:
            continue
        point = [*previous["position"][row, column].astype(float), 1]
        now = projected(frame, (np.linalg.inv(motion_of(previous, frame, occluder)) @ point)[:3])
        if now[2] > 0 and 0 <= now[0] < w and 0 <= now[1] < h:
            result[y, x] = np.array([x, y]) + 0.5 - (now[:2] - [column + 0.5, row + 0.5])
    return result


def image_place(previous: Frame, frame: Frame) -> np.ndarray:
    """(h, w, 2) where the mirror's image was; NaN for none."""
    h, w = frame["id"].shape
    result = np.full((h, w, 2), np.nan)
    eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
    for y, x in np.argwhere((frame["id"] >= 0) & (frame["hit_id"] >= 0)
                            & (frame["hit_distance"] > 0)):
        p, n = frame["position"][y, x].astype(float), frame["normal"][y, x].astype(float)
        v = (p - eye) / np.linalg.norm(p - eye)
        hit = p + frame["hit_distance"][y, x] * (v - 2 * (v @ n) * n)
        surface = motion_of(previous, frame, int(frame["id"][y, x]))
        hit = (motion_of(previous, frame, int(frame["hit_id"][y, x])) @ [*hit, 1])[:3]
        p, n = (surface @ [*p, 1])[:3], surface[:3, :3] @ n
        height = (hit - p) @ n
        image = projected(previous, hit - 2 * height * n)
        if height > 0 and image[2] > 0:
            result[y, x] = image[:2]
    return result


def shadow_surroundings(previous: Frame, frame: Frame,
                        direct: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(h, w, 2) pixels by which shadows were elsewhere, NaN where they were not; mean and standard
    deviation of direct light in red, luminance and blue."""
    h, w = frame["id"].shape
    shift = shadow_shift(previous, frame)
    light = direct @ RLB.T
    was, mean, sigma = np.full((h, w, 2), np.nan), light.copy(), np.zeros((h, w, 3))
    for y, x in np.argwhere(frame["id"] >= 0):
        window = slice(max(y - 3, 0), y + 4), slice(max(x - 3, 0), x + 4)
        same = frame["id"][window] == frame["id"][y, x]
        told = shift[window][same]
        told = told[np.isfinite(told[:, 0])]
        if len(told) > 0.25 * same.sum():
            was[y, x] = told.mean(0)
        mean[y, x], sigma[y, x] = light[window][same].mean(0), light[window][same].std(0)
    return was, mean, sigma
