"""The filtered innovation in float64 NumPy, as plainly as it can be written."""

from __future__ import annotations

import numpy as np

from denoise import oracles
from denoise.oracles import Pixels, luminance, pairs, plane_weight_distance, reproject_bilinear
from render.frame import Frame

H = {0: 1 / 2, 1: 1 / 4}


def lum(image: np.ndarray) -> np.ndarray:
    return luminance(image) if image.shape[-1] == 3 else image[..., 0]


def texture_of(frame: Frame) -> np.ndarray:
    """(h, w, 3) albedo that can be divided by."""
    albedo = np.maximum(frame["albedo"].astype(float), 0.01)
    albedo[(frame["albedo"] < 0.01).all(-1)] = 1
    return albedo


def signals_of(frame: Frame) -> dict[str, np.ndarray]:
    """L, G and V, (h, w, c)."""
    albedo = texture_of(frame)
    v = np.minimum(frame["visibility"][..., None].astype(float), 2)
    rest = (frame["direct"].astype(float) + frame["indirect"] - frame["specular"]
            - v * frame["unshadowed"])
    return {"L": rest / albedo, "G": frame["specular"].astype(float), "V": v}


def color_of(frame: Frame, signals: dict[str, np.ndarray]) -> np.ndarray:
    albedo = texture_of(frame)
    return (frame["emission"] + signals["V"] * frame["unshadowed"] + albedo * signals["L"]
            + signals["G"])


def kind_of(frame: Frame) -> np.ndarray:
    """Background, lamps and the rest: only like pixels mix."""
    black = (frame["albedo"] < 0.01).all(-1)
    return np.where(frame["id"] < 0, 0, np.where(black, 1, 2))


def geometry(p: Pixels, q: Pixels, dy: int, dx: int, m) -> np.ndarray:
    distance = np.where(p.kind == 2, plane_weight_distance(p, q) / m.sigma_plane, 0)
    w = H[abs(dy)] * H[abs(dx)] * np.exp(-distance)
    return np.where(p.kind == q.kind, w, 0)


def pixels_of(frame: Frame, **more: np.ndarray) -> Pixels:
    return oracles.read(frame, kind=kind_of(frame), **more)


def smooth(frame: Frame, image: np.ndarray, counts: np.ndarray, levels: int, m) -> np.ndarray:
    """S: levels over the pixels that count."""
    shape = frame["id"].shape
    for i in range(levels):
        pixels = pixels_of(frame, x=image, counts=counts)
        total = np.zeros_like(image)
        weights = np.zeros((*shape, 1))
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                where, p, q = pairs(pixels, shape, dy << i, dx << i)
                if where is None:
                    continue
                w = (geometry(p, q, dy, dx, m) * (q.counts if dy or dx else 1))[..., None]
                total[where] += w * q.x
                weights[where] += w
        image = total / weights
    return image


def spread(frame: Frame, energy: np.ndarray, counts: np.ndarray, levels: int, m) -> np.ndarray:
    """Q: the variance of a smoothing whose pixels have these."""
    shape = frame["id"].shape
    for i in range(levels):
        pixels = pixels_of(frame, x=energy, counts=counts)
        total, weights = np.zeros(shape), np.zeros(shape)
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                where, p, q = pairs(pixels, shape, dy << i, dx << i)
                if where is None:
                    continue
                w = geometry(p, q, dy, dx, m) * (q.counts if dy or dx else 1)
                total[where] += w**2 * q.x
                weights[where] += w
        energy = total / weights**2
    return energy


def guided(frame: Frame, image: np.ndarray, variance: np.ndarray, levels: int, sigma: float,
           fade: np.ndarray, m) -> np.ndarray:
    """The last filter; its last level's taps are weaker by `fade`."""
    shape = frame["id"].shape
    for i in range(levels):
        weaker = fade if i == levels - 1 else np.ones_like(fade)
        pixels = pixels_of(frame, x=image, v=variance, fade=weaker)
        total, squares, weights = np.zeros_like(image), np.zeros(shape), np.zeros(shape)
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                where, p, q = pairs(pixels, shape, dy << i, dx << i)
                if where is None:
                    continue
                w = geometry(p, q, dy, dx, m)
                if dy or dx:
                    w = w * p.fade * np.exp(-np.abs(lum(q.x) - lum(p.x))
                                            / (sigma * (np.sqrt(p.v) + 1e-6)))
                total[where] += w[..., None] * q.x
                squares[where] += w * w * q.v
                weights[where] += w
        image, variance = total / weights[..., None], squares / weights**2
    return image


def spatial_variance(frame: Frame, signal: np.ndarray, m) -> np.ndarray:
    pixels, shape = pixels_of(frame, x=lum(signal)), frame["id"].shape
    count, sum1, sum2 = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            where, p, q = pairs(pixels, shape, dy, dx)
            if where is None:
                continue
            near = (p.kind == q.kind) & ((p.kind < 2)
                                         | (plane_weight_distance(p, q) < m.sigma_plane))
            count[where] += near
            sum1[where] += near * (q.x - p.x)
            sum2[where] += near * (q.x - p.x) ** 2
    return np.maximum(sum2 / count - (sum1 / count) ** 2, 0)


def look_up(previous: Frame, frame: Frame, image: np.ndarray, m) -> tuple:
    """History, 0 where there is none, and where there is one."""
    history = reproject_bilinear(previous, frame, image, m.min_cosine, m.plane_tolerance)
    found = np.isfinite(history).all(-1)
    return np.where(found[..., None], history, 0), found


def run(frames: list[Frame], m) -> np.ndarray:
    """The colour of the last frame."""
    settings = {"L": (m.light_alpha, m.smoothing, m.levels, m.light_sigma),
                "G": (m.light_alpha, m.sharp_smoothing, m.sharp_levels, m.light_sigma),
                "V": (m.visibility_alpha, m.sharp_smoothing, m.sharp_levels, m.visibility_sigma)}
    kept: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    length, previous, out = np.zeros(0), None, {}
    for frame in frames:
        found = np.zeros(frame["id"].shape, bool)
        n = np.ones(frame["id"].shape)
        if previous is not None:
            old, found = look_up(previous, frame, length[..., None], m)
            n = np.where(found, np.minimum(old[..., 0] + 1, m.longest), 1)
        out = {}
        for name, d in signals_of(frame).items():
            alpha, smoothing, levels, sigma = settings[name]
            noise = spatial_variance(frame, d, m)
            e, s2 = np.zeros_like(d), np.zeros(found.shape)
            if previous is not None:
                both = np.concatenate([kept[name][0], kept[name][1][..., None]], -1)
                both, _ = look_up(previous, frame, both, m)
                e, s2 = np.where(found[..., None], d - both[..., :-1], 0), both[..., -1]
                energy = smooth(frame, lum(e)[..., None] ** 2, found, 2, m)[..., 0]
                noise = np.where(found, np.maximum(energy - s2, energy / 4), noise)
            a = np.maximum(1 / n, alpha)
            wide, follow = smooth(frame, e, found, smoothing, m), np.ones_like(a)
            if name == "L":
                q = spread(frame, lum(e) ** 2, found, smoothing, m)
                certain = 1 - m.doubt * q / np.maximum(lum(wide) ** 2, 1e-20)
                follow = np.maximum(np.maximum(certain, m.follow), a)
            history = d - (1 - a)[..., None] * e + (follow - a)[..., None] * wide
            s2 = (1 - a) ** 2 * s2 + a**2 * noise
            kept[name] = history, s2
            fade = np.clip(1 - (n - 1) / m.fade, 0, 1)
            out[name] = guided(frame, history, s2, levels, sigma, fade, m)
        length, previous = n, frame
    return color_of(frames[-1], out)
