"""Pictures and patterns painted for the room: (h, w, 3) linear reflectances, first row on top."""

from __future__ import annotations

import numpy as np

from onespp.scenes.materials import mix, noise, rgb


def wallpaper() -> np.ndarray:
    """Two pinks in stripes, uneven as plaster is, 512 x 256; 2 m of wall from floor to ceiling."""
    u = np.arange(256) / 256
    stripe = np.tile((u * 10 % 1 < 0.5).astype(float), (512, 1))
    pink = mix(rgb("#f0bcc2"), np.array(rgb("#eaaeb6")), stripe)
    return pink * (0.95 + 0.08 * noise(512, 256, (12, 6), seed=1))[..., None]


def rug_pattern() -> np.ndarray:
    """Concentric bands and diamonds, 384 x 384; the rug's uv is undistorted, 1 along its length."""
    v, u = np.mgrid[0:384, 0:384] / 384
    edge = np.minimum(np.minimum(u, 1 - u), np.minimum(v, 1.8 / 2.6 - v))
    cream, rose, deep = (np.array(rgb(code)) for code in ("#dccbb0", "#c0606f", "#5d3450"))
    diamond = (abs((u * 10) % 1 - 0.5) + abs((v * 10) % 1 - 0.5)) < 0.3
    out = np.where(diamond[..., None], rose, cream)
    for inner, color in ((0.1, cream), (0.085, deep), (0.07, rose), (0.03, deep)):
        out = np.where((edge < inner)[..., None], color, out)
    return out * (0.85 + 0.3 * noise(384, 384, (96, 96), seed=4, octaves=1))[..., None]


def dusk() -> np.ndarray:
    """An evening sky over hills, 256 x 256, the top row first."""
    v, u = np.mgrid[0:256, 0:256] / 256
    sky = mix(rgb("#5a6fb0"), rgb("#f6b48a"), v**1.3)
    clouds = noise(256, 256, (9, 3), seed=6, octaves=4)
    sky = mix(sky, np.array(rgb("#f7d9d0")), (clouds - 0.5) * 2.2)
    for height, color in ((0.68, "#6d6a9a"), (0.78, "#4a5680")):
        ridge = height + 0.05 * np.sin(9 * u + 20 * height) + 0.02 * np.sin(23 * u)
        sky = np.where((v > ridge)[..., None], rgb(color), sky)
    return sky


def rainbow() -> np.ndarray:
    """Rainbow arcs on paper, 192 x 256."""
    v, u = np.mgrid[0:192, 0:256] / 192
    radius = np.hypot(u - 2 / 3, v - 0.88)
    out = np.tile(np.array(rgb("#efe6d4")), (192, 256, 1))
    for i, code in enumerate(("#4d7c8a", "#7fb09c", "#e9c46a", "#e08e5b", "#c8553d")):
        ring = (v < 0.88) & (abs(radius - 0.56 + 0.09 * i) < 0.037)
        out = np.where(ring[..., None], rgb(code), out)
    return out


def paintings() -> np.ndarray:
    """Three abstract paintings side by side, 256 x 768."""
    v, u = np.mgrid[0:256, 0:256] / 256
    paper = np.array(rgb("#f2eadb"))

    def disks(circles: list[tuple[float, float, float, str]]) -> np.ndarray:
        out = np.tile(paper, (256, 256, 1))
        for x, y, r, color in circles:
            out = np.where(((u - x) ** 2 + (v - y) ** 2 < r * r)[..., None], rgb(color), out)
        return out

    suns = disks([(0.5, 0.4, 0.28, "#e07a5f"), (0.62, 0.56, 0.2, "#3d405b"),
                  (0.3, 0.66, 0.14, "#81b29a")])
    hills = np.tile(np.array(rgb("#f4d9b8")), (256, 256, 1))
    hills = np.where(((u - 0.7) ** 2 + (v - 0.32) ** 2 < 0.018)[..., None], rgb("#e4572e"), hills)
    for height, code in ((0.5, "#7aa6a1"), (0.64, "#3f7d78"), (0.8, "#1f4e5a")):
        ridge = height + 0.07 * np.sin(7 * u + 11 * height)
        hills = np.where((v > ridge)[..., None], rgb(code), hills)
    stripes = np.where(((u * 5).astype(int) % 2 == 0)[..., None], np.array(rgb("#2a3d66")), paper)
    stripes = np.where((v > 0.35 + 0.3 * u)[..., None], stripes, np.array(rgb("#d9a441")))
    return np.concatenate([suns, hills, stripes], axis=1)
