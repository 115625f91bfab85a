"""Materials and textures as plain Python: Mitsuba BSDF dictionaries without Mitsuba.

Colours are linear sRGB reflectances; so are images, float64 (h, w, 3) arrays whose first row is
the top (v = 1). Patterns come from a seed and nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from .description import Color, SceneError
from .transforms import scale

Texture = Color | np.ndarray | Mapping[str, Any]


def rgb(code: str) -> Color:
    """A colour as in a paint program, '#rrggbb' (sRGB), as linear reflectance."""
    if len(code) != 7 or code[0] != "#":
        raise SceneError(f"a colour is {code!r}: use '#rrggbb'")
    try:
        srgb = [int(code[i:i + 2], 16) / 255 for i in (1, 3, 5)]
    except ValueError:
        raise SceneError(f"a colour is {code!r}: use '#rrggbb'") from None
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in srgb)
    return r, g, b


def diffuse(color: Texture) -> dict[str, Any]:
    """Matt, on both sides."""
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": color}}


def varnish(color: Texture, roughness: float = 0.2) -> dict[str, Any]:
    """A diffuse base under a rough clear coat: varnished wood, painted toys, glazed clay."""
    return {"type": "twosided", "bsdf": {
        "type": "roughplastic", "distribution": "ggx", "alpha": float(roughness),
        "int_ior": 1.5, "nonlinear": True, "diffuse_reflectance": color}}


def metal(color: Color = (0.95, 0.93, 0.88), roughness: float = 0.15) -> dict[str, Any]:
    """A rough mirror whose reflectance at normal incidence is `color`."""
    return {"type": "twosided", "bsdf": {
        "type": "roughconductor", "material": "none", "distribution": "ggx",
        "alpha": float(roughness), "specular_reflectance": color}}


def checks(a: Color, b: Color, repeat: tuple[float, float] = (4, 4)) -> dict[str, Any]:
    """A checkerboard with `repeat` pairs of squares along u and v."""
    return {"type": "checkerboard", "color0": a, "color1": b,
            "uv_from_surface": scale((*repeat, 1))}


def image(pixels: np.ndarray, repeat: tuple[float, float] = (1, 1)) -> dict[str, Any]:
    """A texture from (h, w, 3) linear reflectances, repeated along u and v."""
    return {"type": "bitmap", "bitmap": np.asarray(pixels), "raw": True,
            "uv_from_surface": scale((*repeat, 1))}


def palette(colors: Sequence[Color]) -> np.ndarray:
    """Vertical bands. The i-th of n colours is at u = (i + 0.5) / n (see `meshes.paint`)."""
    return np.tile(np.repeat(np.array(colors, float), 8, axis=0), (4, 1, 1))


def noise(height: int, width: int, cells: tuple[int, int], seed: int,
          octaves: int = 4) -> np.ndarray:
    """(h, w) value noise in [0, 1] that tiles; cells: (rows, columns) of the coarsest octave."""
    rng = np.random.default_rng(seed)
    total, weight = np.zeros((height, width)), 0.0
    for octave in range(octaves):
        rows, columns = (min(n << octave, limit) for n, limit in zip(cells, (height, width)))
        lattice = rng.random((rows, columns))
        total += 0.5**octave * _stretch(_stretch(lattice, height).T, width).T
        weight += 0.5**octave
    return total / weight


def mix(a: Color | np.ndarray, b: Color | np.ndarray, t: np.ndarray) -> np.ndarray:
    """Colours between a (t = 0) and b (t = 1), for (h, w) t: (h, w, 3)."""
    t = np.clip(t, 0, 1)[..., None]
    return np.asarray(a) * (1 - t) + np.asarray(b) * t


def wood(light: Color, dark: Color, seed: int, height: int = 256, width: int = 512) -> np.ndarray:
    """Wood with its grain along u: wavy rings, fine fibres. Tiles along u and v."""
    v = np.linspace(0, 1, height, endpoint=False)[:, None]
    bend = noise(height, width, (3, 2), seed, octaves=3)
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (7 * v + 5 * bend))
    fibre = noise(height, width, (96, 4), seed + 1, octaves=2)
    return mix(light, dark, 0.55 * rings**2 + 0.7 * (fibre - 0.35))


def planks(light: Color, dark: Color, seed: int, rows: int = 12, size: int = 1024) -> np.ndarray:
    """A floor of boards along u with staggered joints, each board of its own shade. Tiles."""
    rng = np.random.default_rng(seed)
    grain = wood(light, dark, seed + 1, size // 4, size)
    out = np.empty((size, size, 3))
    edges = np.linspace(0, size, rows + 1).round().astype(int)
    seam = max(size // 400, 1)
    for top, bottom in pairwise(edges):
        start = rng.integers(size)
        for part in range(2):
            columns = np.arange(part * size // 2, (part + 1) * size // 2) + start
            row, column = rng.integers(grain.shape[0]), rng.integers(size)
            board = grain[(np.arange(bottom - top)[:, None] + row) % grain.shape[0],
                          (columns + column) % size] * rng.uniform(0.6, 1.1)
            board[:seam] *= 0.4
            board[:, :seam] *= 0.4
            out[top:bottom, columns % size] = board
    return np.clip(out, 0, 0.95)


def plaster(color: Color, seed: int, contrast: float = 0.08, size: int = 256) -> np.ndarray:
    """A wall that is not quite even. Tiles."""
    shade = 1 + contrast * (2 * noise(size, size, (8, 8), seed, octaves=5) - 1)
    return np.clip(np.asarray(color) * shade[..., None], 0, 0.95)


def weave(warp: Color, weft: Color, threads: int = 32, size: int = 256) -> np.ndarray:
    """Cloth of two yarns, over and under. Tiles."""
    u = np.arange(size) * threads / size
    over = (np.floor(u)[:, None] + np.floor(u)) % 2
    ridge = abs(np.sin(np.pi * u))
    shade = 0.75 + 0.25 * np.where(over, ridge[:, None], ridge[None, :])
    return mix(warp, weft, over) * shade[..., None]


def _stretch(lattice: np.ndarray, size: int) -> np.ndarray:
    """Rows of a lattice interpolated to `size` rows, smoothly and periodically."""
    position = np.arange(size) * len(lattice) / size
    index = position.astype(int)
    u = (position - index)[:, None]
    u = u * u * (3 - 2 * u)
    return lattice[index] * (1 - u) + lattice[(index + 1) % len(lattice)] * u
