"""The formulas of the papers in float64 NumPy, as plainly as they can be written.

World-space positions, textbook functions, one tap at a time: nothing is shared with the kernels.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from onespp.render.frame import Frame

Weight = Callable[[int, int, "Pixels", "Pixels"], np.ndarray]


class Pixels:
    """Images of a frame in float64, cut out and shifted by `at`."""

    def __init__(self, **images: np.ndarray) -> None:
        self.__dict__.update({k: np.asarray(v, np.float64) for k, v in images.items()})

    def cut(self, rows: slice, columns: slice) -> Pixels:
        return Pixels(**{k: v[rows, columns] for k, v in self.__dict__.items()})


def pairs(pixels: Pixels, shape: tuple[int, int], dy: int, dx: int) -> tuple:
    """(where, pixels p, pixels q = p + (dy, dx)) for all p whose q is inside the image."""
    h, w = shape
    rows = slice(max(-dy, 0), min(h - dy, h))
    columns = slice(max(-dx, 0), min(w - dx, w))
    if rows.start >= rows.stop or columns.start >= columns.stop:
        return None, None, None
    tap = (slice(rows.start + dy, rows.stop + dy), slice(columns.start + dx, columns.stop + dx))
    return (rows, columns), pixels.cut(rows, columns), pixels.cut(*tap)


def read(frame: Frame, **more: np.ndarray) -> Pixels:
    surface = (frame["id"] >= 0) & (np.abs(frame["normal"]).sum(-1) > 0)
    return Pixels(color=frame["color"], n=frame["normal"], position=frame["position"],
                  z=frame["depth"], surface=surface, **more)


def gaussian(frame: Frame, radius: int = 12, sigma_coord: float = 4) -> np.ndarray:
    """G over a square window; see denoise/methods/unguided/gaussian.py."""
    def g(dy: int, dx: int, p: Pixels, q: Pixels) -> np.ndarray:
        return np.exp(-(dy**2 + dx**2) / (2 * sigma_coord**2) * np.ones_like(p.z))

    return weighted_mean(read(frame, c=frame["color"]), square(radius), g)


def bilateral_color(frame: Frame, radius: int = 16, sigma_coord: float = 32,
                    sigma_color: float = 0.6) -> np.ndarray:
    """B over a square window; see denoise/methods/unguided/bilateral_color.py."""
    def b(dy: int, dx: int, p: Pixels, q: Pixels) -> np.ndarray:
        return np.exp(-(dy**2 + dx**2) / (2 * sigma_coord**2)
                      - ((p.c - q.c)**2).sum(-1) / (2 * sigma_color**2))

    return weighted_mean(read(frame, c=frame["color"]), square(radius), b)


def square(radius: int) -> list[tuple[int, int]]:
    """Offsets of a square window, row by row."""
    side = range(-radius, radius + 1)
    return [(dy, dx) for dy in side for dx in side]


def weighted_mean(pixels: Pixels, offsets: list[tuple[int, int]], weight: Weight) -> np.ndarray:
    """Mean of the colour c over taps, weighed by weight(dy, dx, p, q)."""
    shape = pixels.c.shape[:2]
    total, weights = np.zeros((*shape, 3)), np.zeros(shape)
    for dy, dx in offsets:
        where, p, q = pairs(pixels, shape, dy, dx)
        if where is None:
            continue
        w = weight(dy, dx, p, q)
        total[where] += w[..., None] * q.c
        weights[where] += w
    return total / weights[..., None]


def bilateral(frame: Frame, radius: int = 16, **sigmas: float) -> np.ndarray:
    """The assignment's J; see denoise/bilateral.py."""
    return joint_mean(frame, frame["color"], square(radius), **sigmas)


def bilateral_separable(frame: Frame, radius: int = 16, **sigmas: float) -> np.ndarray:
    """J along rows, then along columns; see denoise/separable.py."""
    side = range(-radius, radius + 1)
    rows = joint_mean(frame, frame["color"], [(0, dx) for dx in side], **sigmas)
    return joint_mean(frame, rows, [(dy, 0) for dy in side], **sigmas)


def joint_mean(frame: Frame, color: np.ndarray, offsets: list[tuple[int, int]],
               sigma_coord: float = 32, sigma_color: float = 0.6, sigma_normal: float = 0.1,
               sigma_plane: float = 0.1) -> np.ndarray:
    """Mean of a colour over taps, weighed by the assignment's J."""
    def weight(dy: int, dx: int, p: Pixels, q: Pixels) -> np.ndarray:
        both = (p.surface > 0) & (q.surface > 0)
        cosine = np.where(both, (p.n * q.n).sum(-1), 1).clip(-1, 1)
        d = q.position - p.position
        distance = np.sqrt((d**2).sum(-1))
        across = (p.n * d).sum(-1) / np.maximum(distance, 1e-30)
        sine = np.where(both & (distance > 0), across, 0)
        j = np.exp(-(dy**2 + dx**2) / (2 * sigma_coord**2)
                   - ((p.c - q.c)**2).sum(-1) / (2 * sigma_color**2)
                   - np.arccos(cosine)**2 / (2 * sigma_normal**2)
                   - sine**2 / (2 * sigma_plane**2))
        return np.where(p.surface == q.surface, j, 0)

    return weighted_mean(read(frame, c=color), offsets, weight)


def luminance(color: np.ndarray) -> np.ndarray:
    return color @ [0.2126, 0.7152, 0.0722]


def plane_weight_distance(p: Pixels, q: Pixels) -> np.ndarray:
    """Distance of q from p's tangent plane, seen at p's depth, over p's depth; inf if unlike."""
    both = (p.surface > 0) & (q.surface > 0)
    distance = np.abs((p.n * (q.position - p.position)).sum(-1)) / np.where(both, q.z, 1)
    return np.where(both, distance, np.where(p.surface == q.surface, 0, np.inf))


def window_variance(frame: Frame, lum: np.ndarray, sigma_plane: float,
                    radius: int = 3) -> np.ndarray:
    """Variance of the luminance over the window's pixels within sigma_plane of the plane."""
    pixels, shape = read(frame, l=lum), lum.shape
    n, s1, s2 = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            where, p, q = pairs(pixels, shape, dy, dx)
            if where is None:
                continue
            near = plane_weight_distance(p, q) < sigma_plane
            n[where] += near
            s1[where] += near * q.l
            s2[where] += near * q.l**2
    return np.maximum(s2 / n - (s1 / n)**2, 0)


def blur3x3(image: np.ndarray) -> np.ndarray:
    padded = np.pad(image, 1)
    h, w = image.shape
    return np.sum([padded[1 + dy:1 + dy + h, 1 + dx:1 + dx + w] * 0.25 / 2**abs(dy) / 2**abs(dx)
                   for dy in (-1, 0, 1) for dx in (-1, 0, 1)], axis=0)


def atrous(frame: Frame, levels: int = 5, sigma_luminance: float = 4, sigma_plane: float = 0.01,
           normal_power: float = 128) -> np.ndarray:
    """SVGF's filter of one frame, not demodulated; see denoise/atrous.py."""
    shape = frame["id"].shape
    color = frame["color"].astype(np.float64)
    variance = window_variance(frame, luminance(color), sigma_plane)
    h = {0: 3 / 8, 1: 1 / 4, 2: 1 / 16}
    for i in range(levels):
        pixels = read(frame, c=color, v=variance, l=luminance(color),
                      sigma_l=sigma_luminance * np.sqrt(blur3x3(variance)) + 1e-6)
        total, squares, weights = np.zeros((*shape, 3)), np.zeros(shape), np.zeros(shape)
        for ky in range(-2, 3):
            for kx in range(-2, 3):
                where, p, q = pairs(pixels, shape, ky << i, kx << i)
                if where is None:
                    continue
                both = (p.surface > 0) & (q.surface > 0)
                cosine = np.where(both, np.maximum((p.n * q.n).sum(-1), 0), 1)
                w = (h[abs(ky)] * h[abs(kx)] * np.exp(-np.abs(p.l - q.l) / p.sigma_l)
                     * cosine**normal_power * np.exp(-plane_weight_distance(p, q) / sigma_plane))
                total[where] += w[..., None] * q.c
                squares[where] += w**2 * q.v
                weights[where] += w
        color, variance = total / weights[..., None], squares / weights**2
    return color


def clamp_box(color: np.ndarray, radius: int, k: float) -> tuple[np.ndarray, np.ndarray]:
    """(low, high) of each pixel: mean -+ k standard deviations of the window's pixels inside the
    image."""
    h, w, _ = color.shape
    low, high = np.empty((h, w, 3)), np.empty((h, w, 3))
    for y in range(h):
        for x in range(w):
            window = color[max(y - radius, 0):y + radius + 1, max(x - radius, 0):x + radius + 1]
            window = window.reshape(-1, 3).astype(np.float64)
            mean, sigma = window.mean(0), window.std(0)
            low[y, x], high[y, x] = mean - k * sigma, mean + k * sigma
    return low, high


def previous_screen(previous: Frame, frame: Frame) -> np.ndarray:
    """(h, w, 3): x', y', z' of each pixel's world position, P' V' M' M^-1 X; NaN for background."""
    h, w = frame["id"].shape
    result = np.full((h, w, 3), np.nan)
    for y, x in np.argwhere(frame["id"] >= 0):
        i = frame["id"][y, x]
        world = np.append(frame["position"][y, x].astype(np.float64), 1)
        p = (previous.screen_from_world @ previous.world_from_object[i]
             @ np.linalg.inv(frame.world_from_object[i]) @ world)
        result[y, x] = p[0] / p[3], p[1] / p[3], p[3]
    return result


def reproject_bilinear(previous: Frame, frame: Frame, history: np.ndarray, min_cosine: float = 0.9,
                       plane_tolerance: float = 0.02, fallback: bool = False,
                       at: np.ndarray | None = None) -> np.ndarray:
    """(h, w, c) history of each pixel from tested bilinear taps; NaN where there is none.

    Args:
        fallback: where none passes, the mean of those of the 3x3 pixels around that do.
        at: (h, w, 2) screen positions to look at, NaN for none, instead of where surfaces were.
    """
    h, w = frame["id"].shape
    screen, result = previous_screen(previous, frame), np.full(history.shape, np.nan)
    if at is not None:
        screen[..., :2] = at
    for y, x in np.argwhere(frame["id"] >= 0):
        i = frame["id"][y, x]
        motion = previous.world_from_object[i] @ np.linalg.inv(frame.world_from_object[i])
        n = motion[:3, :3] @ frame["normal"][y, x]
        world = (motion @ np.append(frame["position"][y, x].astype(np.float64), 1))[:3]
        px, py, z = screen[y, x]
        if not (0 <= px < w and 0 <= py < h):
            continue

        def passes(ty, tx, i=i, n=n, world=world, z=z):
            if not (0 <= tx < w and 0 <= ty < h) or previous["id"][ty, tx] != i:
                return False
            off_plane = abs(n @ (previous["position"][ty, tx] - world))
            return n @ previous["normal"][ty, tx] > min_cosine and off_plane < plane_tolerance * z

        left, top = int(np.floor(px - 0.5)), int(np.floor(py - 0.5))
        taps = [((1 - abs(px - 0.5 - tx)) * (1 - abs(py - 0.5 - ty)), ty, tx)
                for ty in (top, top + 1) for tx in (left, left + 1) if passes(ty, tx)]
        if fallback and sum(t[0] for t in taps) < 0.01:
            taps = [(1.0, int(py) + dy, int(px) + dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)
                    if passes(int(py) + dy, int(px) + dx)]
        total = sum(t[0] for t in taps)
        if total >= 0.01:
            result[y, x] = sum(weight * history[ty, tx] for weight, ty, tx in taps) / total
    return result


def accumulate(color: np.ndarray, history: np.ndarray, alpha: float = 0.2, k: float = 1.0,
               radius: int = 3) -> np.ndarray:
    """The assignment's blend; history NaN where there is none."""
    low, high = clamp_box(color, radius, k)
    blended = alpha * color + (1 - alpha) * np.clip(history, low, high)
    return np.where(np.isfinite(history), blended, color)
