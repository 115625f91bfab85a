"""Materials and textures as plain Python: Mitsuba BSDF dictionaries without Mitsuba.

Colours are linear sRGB reflectances; so are images, float64 (h, w, 3) arrays whose first row is
the top (v = 1). What a paint program or an 8-bit file holds is made linear by `rgb` and `srgb8`.
Patterns come from a seed and nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from . import validity
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
    r, g, b = map(_linear, srgb)
    return r, g, b


def srgb8(pixels: Any) -> np.ndarray:
    """An 8-bit sRGB picture as linear reflectances (or radiances), (h, w, 3) float64.

        image(srgb8(PIL.Image.open("poster.png")))

    pixels: a Pillow image, or a uint8 array (h, w), (h, w, 1), (h, w, 3), or (h, w, 4) if it is
    opaque. Data that are not colours (roughness, opacity, normals) are linear as they are: divide
    those by 255.

    Raises:
        SceneError: not 8-bit, another shape, or transparent somewhere.
    """
    if hasattr(pixels, "convert") and hasattr(pixels, "mode"):  # Pillow; palettes and CMYK too
        if pixels.mode[0] in "IF":
            raise SceneError(f"a picture has mode {pixels.mode}, which is not 8-bit: divide its "
                             "array by its largest value instead")
        pixels = pixels.convert("RGBA")
    codes = np.asarray(pixels)
    if codes.dtype != np.uint8:
        raise SceneError(f"a picture is of {codes.dtype}: srgb8 is for 8-bit ones (uint8)")
    codes = codes[..., None] if codes.ndim == 2 else codes
    if codes.ndim != 3 or codes.shape[2] not in (1, 3, 4) or not codes.size:
        raise SceneError(f"a picture has shape {np.shape(pixels)}: use (h, w), (h, w, 3) or "
                         "(h, w, 4), with pixels")
    if codes.shape[2] == 4 and (codes[..., 3] < 255).any():
        raise SceneError("a picture is transparent in places: lay it on a background, or use its "
                         "alpha / 255 as the opacity of a mask")
    color = np.broadcast_to(codes[..., :3], (*codes.shape[:2], 3))
    return np.array([_linear(code / 255) for code in range(256)])[color]


def _linear(srgb: float) -> float:
    """IEC 61966-2-1, from [0, 1] to [0, 1]."""
    return srgb / 12.92 if srgb <= 0.04045 else ((srgb + 0.055) / 1.055) ** 2.4


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


def mirror(color: Color = (0.9, 0.9, 0.9)) -> dict[str, Any]:
    """A smooth metal: its reflections are sharp. Lamps that it shows are found by chance alone."""
    return {"type": "twosided", "bsdf": {"type": "conductor", "material": "none",
                                         "specular_reflectance": color}}


def glass(index: float = 1.5) -> dict[str, Any]:
    """Clear glass, for closed surfaces whose outside is where their normals point."""
    return {"type": "dielectric", "int_ior": float(index)}


def pane(index: float = 1.5) -> dict[str, Any]:
    """A sheet of clear glass, for open surfaces: both of its sides at once, without thickness."""
    return {"type": "thindielectric", "int_ior": float(index)}


def cutout(material: Mapping[str, Any], opacity: np.ndarray) -> dict[str, Any]:
    """A material where `opacity` is, (h, w) bool, first row at the top; else a hole.

    Each texel is wholly one or the other, so that pixels behind holes have guides of their own.
    """
    texels = np.asarray(opacity, float)
    if texels.ndim != 2 or not texels.size or not np.isin(texels, (0, 1)).all():
        raise SceneError(f"the opacity of a cutout has shape {texels.shape} or other values than 0 "
                         "and 1: use an (h, w) array of bool")
    return {"type": "mask", "bsdf": dict(material), "opacity": {
        "type": "bitmap", "bitmap": texels[..., None], "raw": True, "filter_type": "nearest"}}


def checks(a: Color, b: Color, repeat: tuple[float, float] = (4, 4)) -> dict[str, Any]:
    """A checkerboard with `repeat` pairs of squares along u and v."""
    return {"type": "checkerboard", "color0": a, "color1": b,
            "uv_from_surface": scale((*repeat, 1))}


def image(pixels: np.ndarray, repeat: tuple[float, float] = (1, 1)) -> dict[str, Any]:
    """A texture from (h, w, 3) linear reflectances, repeated along u and v.

    8-bit pictures go through `srgb8` first.

    Raises:
        SceneError: whole numbers, another shape, no pixels, or not finite.
    """
    validity.image(pixels, "a texture", validity.ANY)
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
