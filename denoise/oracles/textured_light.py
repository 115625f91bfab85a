"""The filtered innovation of light whose texture is not known, in float64 NumPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from onespp.render.frame import Frame

from .filtered_innovation import (
    guided,
    length_left,
    look_up,
    lum,
    repaid,
    smooth,
    spatial_variance,
    spread,
)
from .filters import previous_screen


def run(frames: list[Frame], m) -> np.ndarray:
    """The colour of the last frame; frames of colour, guides and matrices."""
    levels = min(m.innovation_levels, 4)
    kept, previous, out = np.zeros(0), None, np.zeros(0)
    for frame in frames:
        d = frame["color"].astype(float)
        shape = d.shape[:2]
        found = np.zeros(shape, bool)
        h, s2, n, raw = np.zeros_like(d), np.zeros(shape), np.ones(shape), np.zeros(shape)
        if previous is not None:
            (h, s2, n, raw), found = better_history(previous, frame, kept, m)
            n = np.where(found, np.minimum(n + 1, m.max_history_length), 1)
        e = np.where(found[..., None], d - h, 0)
        wide = smooth(frame, e, found, levels, m)
        q = spread(frame, lum(e) ** 2, found, levels, m, np.zeros(shape))
        spatial = spatial_variance(frame, d, m)
        energy, misses, around = np.moveaxis(smooth(
            frame, np.stack([lum(e) ** 2, raw, spatial], -1), found, 2, m), -1, 0)
        most = np.maximum(spatial, around)
        error = np.minimum(2.5 * np.maximum(misses, 0), energy)
        error = np.where(found, np.maximum(error, energy - s2 - most), 0)
        left = np.where(found, length_left("L", wide, q, energy, wide, h, m.light_change,
                                           m.noise_threshold), 1e6)
        noise = np.minimum(np.maximum(energy - s2 - error, energy / 4), most)
        noise = np.where(left < 2, np.minimum(spatial, energy), noise)
        noise = np.where(found, noise, spatial)
        n = np.maximum(np.minimum(n, left), 1)
        a = np.maximum(np.maximum(1 / n, m.light_alpha), error / (error + np.maximum(noise, 1e-12)))
        n = np.minimum(n, 1 / a)
        certain = 1 - m.noise_threshold * q / np.maximum(lum(wide) ** 2, 1e-20)
        expected = (m.expected_change * lum(d - e + wide)) ** 2
        follow = m.min_gain * expected / np.maximum(expected + q, 1e-20)
        follow = np.maximum(np.maximum(certain, follow), a)
        acc = d - (1 - a)[..., None] * e + (follow - a)[..., None] * wide
        s2 = (1 - a) ** 2 * s2 + a**2 * noise
        out = last_filter(frame, d, d - e, acc, s2, n, found, levels, m)
        kept, previous = np.concatenate([acc, s2[..., None], n[..., None]], -1), frame
    return repaid(out, frames[-1]["id"])


def better_history(previous: Frame, frame: Frame, kept: np.ndarray, m) -> tuple:
    """`history` of the surface, or of the place where that says better what is seen."""
    of_surface, found = history(previous, frame, kept, m)
    still = replace(previous, world_from_object=frame.world_from_object)
    of_place, there = history(still, frame, kept, m)
    there &= found & (np.abs(previous_screen(previous, frame) - previous_screen(still, frame))
                      [..., :2].sum(-1) > 0.05)
    ids = np.maximum(frame["id"], 0)
    turns = np.array([before[:3, :3] @ np.linalg.inv(now[:3, :3]) for before, now in zip(
        previous.world_from_object, frame.world_from_object)])[ids]
    n = frame["normal"].astype(float)
    n /= np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-9)
    turn = 1 - np.einsum("hwi,hwij,hwj->hw", n, turns, n)  # objects here do not change shape
    share = 0.7 + 0.6 * np.clip(turn / 0.015, 0, 1)
    d = frame["color"].astype(float)
    e2, place_e2 = (lum(d - values[0]) ** 2 for values in (of_surface, of_place))
    excess = np.where(there, place_e2 - share * e2, 0)
    better = there & (smooth(frame, excess[..., None], found, min(3, m.innovation_levels), m)
                      [..., 0] < 0)
    return tuple(np.where(better.reshape(better.shape + (1,) * (a.ndim - 2)), b, a)
                 for a, b in zip(of_surface, of_place)), found


def history(previous: Frame, frame: Frame, kept: np.ndarray, m) -> tuple:
    """(h, s^2, n, what the taps differ by less their noise) and where there is one.

    The weight of a tap is how much of it an image holds that is 1 there alone: of the four around
    a place, no two have row and column even or odd alike.
    """
    rows, columns = np.indices(frame["id"].shape)
    alone = [(rows % 2 == y) & (columns % 2 == x) for y in (0, 1) for x in (0, 1)]
    image = np.concatenate([kept, lum(kept[..., :3])[..., None] ** 2, np.stack(alone, -1)], -1)
    values, found = look_up(previous, frame, image, m)
    h, s2 = values[..., :3], values[..., 3]
    differ = values[..., 5] - lum(h) ** 2 - (1 - np.square(values[..., 6:]).sum(-1)) * s2
    return (h, s2, values[..., 4], np.where(found, differ, 0)), found


def last_filter(frame: Frame, d: np.ndarray, h: np.ndarray, acc: np.ndarray, s2: np.ndarray,
                n: np.ndarray, found: np.ndarray, levels: int, m) -> np.ndarray:
    """F acc, and what it took away in so far as d and h have it in common."""
    shape = found.shape
    fade = np.clip(1 - (n - 1) / m.fade_frames, 0, 1)
    everything = np.concatenate([acc, lum(d)[..., None], lum(h)[..., None]], -1)
    f = guided(frame, everything, s2, m.output_levels, np.full(shape, m.texture_sigma), fade,
               np.zeros(shape), m)
    r_d, r_h = lum(d) - f[..., 3], lum(h) - f[..., 4]
    square = lum(acc - f[..., :3]) ** 2
    u = 1 / (2 * s2 + square + np.abs(r_d * r_h) + 1e-12)
    common, every = np.moveaxis(smooth(frame, np.stack([u * r_d * r_h, u * square], -1), found,
                                       levels, m), -1, 0)
    share = np.where(found, np.clip(common / np.maximum(every, 1e-12), 0, 1), 0)
    return f[..., :3] + share[..., None] * (acc - f[..., :3])
