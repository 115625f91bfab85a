"""SVGF and A-SVGF in float64 NumPy, as plainly as they can be written: nothing is shared with the
kernels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from onespp.render.frame import Frame

from . import filters as oracles
from .filters import Pixels, blur3x3, luminance, pairs


def depth_slope(frame: Frame) -> np.ndarray:
    """(h, w, 2) change of depth along x and y on each pixel's tangent plane."""
    h, w = frame["id"].shape
    world_from_camera = np.linalg.inv(frame.camera_from_world)
    b = np.linalg.inv((frame.screen_from_world @ world_from_camera)[[0, 1, 3], :3])
    y, x = np.mgrid[:h, :w] + 0.5
    n = frame["normal"] @ frame.camera_from_world[:3, :3].T

    def depth_at(dx: float, dy: float) -> np.ndarray:
        """Where the ray through a moved pixel meets the plane."""
        here = np.stack([x, y, np.ones_like(x)], -1) @ b.T
        there = np.stack([x + dx, y + dy, np.ones_like(x)], -1) @ b.T
        return frame["depth"] * (n * here).sum(-1) / (n * there).sum(-1)

    with np.errstate(all="ignore"):
        slope = [(depth_at(e, 0) - depth_at(-e, 0)) / (2 * e) for e in (1e-4,)]
        slope += [(depth_at(0, e) - depth_at(0, -e)) / (2 * e) for e in (1e-4,)]
    return np.where(frame["id"][..., None] >= 0, np.stack(slope, -1), 0)


def pixels_of(frame: Frame, **more: np.ndarray) -> Pixels:
    return oracles.read(frame, slope=depth_slope(frame), **more)


def geometry_weight(p: Pixels, q: Pixels, dy: int, dx: int, sigma_depth: float,
                    power: float) -> np.ndarray:
    both = (p.surface > 0) & (q.surface > 0)
    cosine = np.where(both, np.maximum((p.n * q.n).sum(-1), 0), 1)
    slope = np.abs(p.slope[..., 0] * dx + p.slope[..., 1] * dy)
    depth = np.abs(p.z - q.z) / np.where(both, sigma_depth * slope + 1e-3 * p.z, 1)
    return np.where(p.surface == q.surface, cosine**power * np.exp(-np.where(both, depth, 0)), 0)


def spatial_moments(frame: Frame, moments: np.ndarray, sigma_depth: float,
                    power: float) -> np.ndarray:
    """(h, w, 2) means over 7x7."""
    shape = frame["id"].shape
    pixels, total, weights = pixels_of(frame, m=moments), np.zeros((*shape, 2)), np.zeros(shape)
    for dy in range(-3, 4):
        for dx in range(-3, 4):
            where, p, q = pairs(pixels, shape, dy, dx)
            if where is None:
                continue
            w = geometry_weight(p, q, dy, dx, sigma_depth, power)
            total[where] += w[..., None] * q.m
            weights[where] += w
    return total / weights[..., None]


def level(frame: Frame, color: np.ndarray, variance: np.ndarray, step: int, sigma_luminance: float,
          sigma_depth: float, power: float) -> tuple[np.ndarray, np.ndarray]:
    shape = frame["id"].shape
    h = {0: 3 / 8, 1: 1 / 4, 2: 1 / 16}
    pixels = pixels_of(frame, c=color, v=variance, l=luminance(color),
                       sigma_l=sigma_luminance * np.sqrt(blur3x3(variance)) + 1e-6)
    total, squares, weights = np.zeros((*shape, 3)), np.zeros(shape), np.zeros(shape)
    for ky in range(-2, 3):
        for kx in range(-2, 3):
            where, p, q = pairs(pixels, shape, ky * step, kx * step)
            if where is None:
                continue
            w = (h[abs(ky)] * h[abs(kx)] * np.exp(-np.abs(p.l - q.l) / p.sigma_l)
                 * geometry_weight(p, q, ky * step, kx * step, sigma_depth, power))
            total[where] += w[..., None] * q.c
            squares[where] += w**2 * q.v
            weights[where] += w
    return total / weights[..., None], squares / weights**2


def svgf(frames: list[Frame], alpha: float = 0.2, alpha_moments: float = 0.2,
         max_history_length: float = 32, levels: int = 5, sigma_luminance: float = 4,
         sigma_depth: float = 1,
         normal_power: float = 128, min_cosine: float = 0.9, plane_tolerance: float = 0.02,
         demodulate: bool = True, split: bool = True, accumulate: bool = True,
         fallback: bool = True, temporal_variance: bool = True,
         feedback: bool = True, alpha_indirect: float | None = None,
         changes: list[np.ndarray] | None = None,
         refine: Callable[..., np.ndarray] | None = None, specular: bool = False) -> np.ndarray:
    """The last frame's result; parameters as of `onespp.denoise.methods.svgf.Svgf`.

    Args:
        alpha_indirect: that of indirect light; None: `alpha`.
        changes: (h, w, signals) lambda of each frame (A-SVGF); None: 0 everywhere.
        refine: (previous, frame, records, history, direct light) to another history.
        specular: as a third signal, without texture, not as a part of indirect light.
    """
    records, previous, result = None, frames[0], np.zeros(0)
    for i, frame in enumerate(frames):
        shape = frame["id"].shape
        albedo = np.maximum(frame["albedo"], 0.01) if demodulate else np.ones((*shape, 3))
        albedo = np.where((frame["albedo"] < 0.01).all(-1, keepdims=True), 1, albedo)
        names = ("direct", "indirect") if split else ("color",)
        emission = frame["emission"].astype(np.float64) if split or demodulate else 0
        lights = [frame[n] / albedo if split else (frame["color"] - emission) / albedo
                  for n in names]
        if specular:
            lights = [lights[0], lights[1] - frame["specular"] / albedo,
                      frame["specular"].astype(np.float64)]
        now = [np.concatenate([c, luminance(c)[..., None], luminance(c)[..., None]**2], -1)
               for c in lights]
        old = np.full((*shape, 6 * len(now)), np.nan)
        if records is not None and accumulate:
            old = oracles.reproject_bilinear(previous, frame, records, min_cosine,
                                             plane_tolerance, fallback)
            if refine:
                old = refine(previous, frame, records, old, now[0][..., :3])
        kept, result, bare = [], np.zeros((*shape, 3)), np.zeros((*shape, 3))
        for s, signal in enumerate(now):
            before, found = old[..., 6 * s + 1:6 * s + 6], np.isfinite(old[..., 6 * s:6 * s + 1])
            change = changes[i][..., s:s + 1] if changes else np.zeros((*shape, 1))
            length = old[..., 6 * s:6 * s + 1] * (1 - change)**10 + 1
            length = np.where(found, np.minimum(length, max_history_length), 1)
            a = alpha if s == 0 or alpha_indirect is None else alpha_indirect
            weight = np.concatenate([np.maximum(least, 1 / length) for least in
                                     (a, a, a, alpha_moments, alpha_moments)], -1)
            weight = change + (1 - change) * weight
            mixed = np.where(found, weight * signal + (1 - weight) * before, signal)
            spatial = (length < 4) if temporal_variance else np.full(length.shape, True)
            moments = np.where(spatial, spatial_moments(frame, mixed[..., 3:], sigma_depth,
                                                        normal_power), mixed[..., 3:])
            variance = (np.maximum(moments[..., 1] - moments[..., 0]**2, 0)
                        * np.maximum(4 / length[..., 0], 1))
            color, first = mixed[..., :3], mixed[..., :3]
            for k in range(levels):
                color, variance = level(frame, color, variance, 1 << k, sigma_luminance,
                                        sigma_depth, normal_power)
                first = color if k == 0 else first
            kept += [length, first if feedback else mixed[..., :3], mixed[..., 3:]]
            if s == 2:
                bare = color
            else:
                result += color
        records, previous = np.concatenate(kept, -1), frame
        result = result * albedo + bare + emission
    return result


def shading_changes(frame: Frame, levels: int = 3, scale: float = 1) -> np.ndarray:
    """(h, w, 2) lambda of direct and indirect light, from the samples shaded again."""
    now, before = (frame[name].astype(np.float64) for name in ("replay", "replay_before"))
    height, width, _ = now.shape
    sums = np.zeros((2, -(-height // 3), -(-width // 3), 2))
    for y, x in np.argwhere((np.minimum(now, before) >= 0).all(-1)):
        sums[0, y // 3, x // 3] += now[y, x] - before[y, x]
        sums[1, y // 3, x // 3] += np.maximum(now[y, x], before[y, x])
    h = {0: 3 / 8, 1: 1 / 4, 2: 1 / 16}
    _, rows, columns, _ = sums.shape
    for k in range(levels):
        step = 1 << k
        padded = np.pad(sums, [(0, 0), (2 * step,) * 2, (2 * step,) * 2, (0, 0)])
        sums = np.zeros_like(sums)
        for ky in range(-2, 3):
            for kx in range(-2, 3):
                top, left = (2 + ky) * step, (2 + kx) * step
                sums += h[abs(ky)] * h[abs(kx)] * padded[:, top:top + rows, left:left + columns]
    g = np.where(sums[1] > 1e-6, np.abs(sums[0]) / np.maximum(sums[1], 1e-6), 0)
    return np.minimum(scale * g, 1).repeat(3, 0).repeat(3, 1)[:height, :width]


def asvgf(frames: list[Frame], alpha: float = 0.02, alpha_indirect: float = 0.01,
          max_history_length: float = 256, gradient_levels: int = 3, gradient_scale: float = 1,
          **others: float | bool) -> np.ndarray:
    """The last frame's result; parameters as of `onespp.denoise.methods.asvgf.Asvgf`."""
    changes = [shading_changes(frame, gradient_levels, gradient_scale) for frame in frames]
    return svgf(frames, alpha, max_history_length=max_history_length,
                alpha_indirect=alpha_indirect, changes=changes, **others)  # pyright: ignore
