"""Metallic-roughness materials as dictionaries of Mitsuba's.

    opaque, or solid glass (`KHR_materials_volume`)   principled, two-sided unless light gets in
    thin glass (transmission without a volume)        principledthin; of a metal the opaque one
    alphaMode MASK, BLEND                             mask: 0 or 1 by the cutoff, or alpha itself

Both models shade by GGX of alpha = roughness^2 with an F0 of 0.04 (or by `KHR_materials_ior`) and
tint metals by the base colour; the diffuse lobe is Disney's, not Lambert's. Colours of vertices
multiply base colour and alpha. Both sides of every surface are shaded: nothing is culled. Emission
is radiance as it is: factor times texture times `KHR_materials_emissive_strength`, of that share of
the surface that its alpha leaves (not that of vertices).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from onespp.render.mitsuba.textures import PRODUCT, STEP
from onespp.scenes.validity import brief

from .document import Document
from .item import Item
from .meshes import ALPHA, COLOR
from .textures import Texture, Textures

_IOR = 1.5


@dataclass(frozen=True)
class Look:
    """What a surface looks like.

    Attributes:
        material: None where it is not there at all (alpha below its cutoff).
        emission: None, (r, g, b), or a texture's dictionary. uv_set: that its textures need, None
            where it has no textures.
        bumpy: whether it has a normal map. colors: which of its mesh's it needs (`COLOR`, `ALPHA`).
    """

    material: dict[str, Any] | None
    emission: Any
    uv_set: int | None
    bumpy: bool
    colors: tuple[str, ...]


class Materials:
    """Materials, made once each: primitives that refer to one share it."""

    def __init__(self, document: Document) -> None:
        self._document, self._textures = document, Textures(document)
        self._made: dict[Any, Look] = {}

    def look(self, primitive: Item, colors: Collection[str] = (), left: bool = False) -> Look:
        """What a primitive looks like.

        Args:
            colors: names of those that its vertices have. left: where a normal map's frame is
                left-handed.
        """
        item = (self._document.refer(primitive, "material", "materials")
                if "material" in primitive else Item({}, "", primitive.file))
        own = "TANGENT" in primitive.part("attributes")
        key = (item.path, *((left, own) if "normalTexture" in item else (False, False)),
               frozenset(colors))
        if key not in self._made:
            self._made[key] = self._look(item, colors, left, own)
        return self._made[key]

    def _look(self, item: Item, colors: Collection[str], left: bool, own_tangents: bool) -> Look:
        pbr = item.part("pbrMetallicRoughness")
        base = self._textures.texture(pbr, "baseColorTexture", color=True)
        rough = self._textures.texture(pbr, "metallicRoughnessTexture")
        bumps = self._textures.texture(item, "normalTexture")
        shining = self._textures.texture(item, "emissiveTexture", color=True)
        through = item.extension("KHR_materials_transmission")
        clear = self._textures.texture(through, "transmissionTexture")
        if "occlusionTexture" in item:
            self._document.leave(item, "occlusion textures")
        factor = pbr.numbers("baseColorFactor", (1, 1, 1, 1), 0, 1)
        surface = {
            "base_color": _values(base, slice(0, 3), factor[:3]),
            "roughness": _values(rough, slice(1, 2), pbr.number("roughnessFactor", 1, 0, 1)),
            "metallic": _values(rough, slice(2, 3), pbr.number("metallicFactor", 1, 0, 1)),
            "spec_trans": _values(clear, slice(0, 1), through.number("transmissionFactor", 0, 0,
                                                                     1))}
        # Of glTF an index of 0 means a perfect mirror, and 1 none at all.
        ior = item.extension("KHR_materials_ior").number("ior", _IOR, 0, 10)
        surface["eta"] = min(max(ior, 1.001), 10.0) if ior else 10.0
        volume = item.extension("KHR_materials_volume")
        if "attenuationColor" in volume:
            self._document.leave(volume, "what a volume absorbs")
        solid = volume.number("thicknessFactor", 0, 0) > 0
        opacity = _opacity(item, base, float(factor[3]))
        emission, shown = self._emission(item, shining, opacity), []
        if COLOR in colors:
            surface["base_color"] = _by_vertices(surface["base_color"], COLOR)
            shown.append(COLOR)
        if ALPHA in colors and item.text("alphaMode", "OPAQUE") != "OPAQUE":
            opacity = _opacity(item, base, float(factor[3]), by_vertices=True)
            shown.append(ALPHA)
            if emission is not None:
                self._document.leave(item, "alpha of vertices in emission")
        material = _covered(opacity, _material(
            surface, solid, _normal_map(item, bumps, left, own_tangents)))
        return Look(material, emission, self._uv_set(item, base, rough, bumps, shining, clear),
                    bumps is not None, tuple(shown))

    def _emission(self, item: Item, shining: Texture | None, opacity: Any) -> Any:
        factor = item.numbers("emissiveFactor", (0, 0, 0), 0)
        factor = factor * item.extension("KHR_materials_emissive_strength").number(
            "emissiveStrength", 1, 0, 1e9)
        found = _values(shining, slice(0, 3), factor)
        if np.any(factor) and (isinstance(opacity, dict) or opacity != 1):
            if (isinstance(found, dict) and isinstance(opacity, dict)
                    and not _lie_alike(found, opacity)):
                self._document.leave(item, "alpha of emission whose texture lies otherwise")
            else:
                found = _times(found, opacity)
        if isinstance(found, dict):
            return found if found["bitmap"].any() else None
        return found if any(found) else None

    def _uv_set(self, item: Item, *textures: Texture | None) -> int | None:
        sets = {texture.uv_set for texture in textures if texture is not None}
        if len(sets) > 1:
            raise item.error(f"its textures use the coordinates {sorted(sets)}: use one set of "
                             "them in a material")
        return min(sets, default=None)


def _values(texture: Texture | None, channels: slice, factor: Any) -> Any:
    """A factor, or the texture's channels times it."""
    scalar = np.ndim(factor) == 0
    if texture is None:
        return float(factor) if scalar else tuple(map(float, factor))
    if not np.any(factor):
        return 0.0 if scalar else (0.0,) * len(factor)
    values = texture.pixels[..., channels] * np.asarray(factor, np.float32)
    if (values == values[0, 0]).all():
        one: Sequence[float] = values[0, 0].astype(float).tolist()
        return one[0] if scalar else tuple(one)
    return texture.dictionary(values)


def _material(surface: dict[str, Any], solid: bool,
              normal_map: dict[str, Any] | None) -> dict[str, Any]:
    """A surface without its holes."""
    def shaded(made: dict[str, Any]) -> dict[str, Any]:
        return made if normal_map is None else {
            "type": "normalmap", "normalmap": normal_map, "bsdf": made}

    metallic, clear = surface["metallic"], surface["spec_trans"]
    if clear == 0 or metallic == 1:
        opaque = {"type": "principled", **surface}
        del opaque["spec_trans"]
        return {"type": "twosided", "bsdf": shaded(opaque)}
    if solid:
        return shaded({"type": "principled", **surface})
    thin = {"type": "principledthin", **surface}
    del thin["metallic"]
    thin["diff_trans"] = 0.0
    if metallic == 0:
        return shaded(thin)
    metal = {"type": "principled", **surface, "metallic": 1.0}
    del metal["spec_trans"]
    return {"type": "blendbsdf", "weight": metallic, "bsdf_0": shaded(thin),
            "bsdf_1": {"type": "twosided", "bsdf": shaded(metal)}}


def _by_vertices(value: Any, name: str) -> Any:
    """A number, a colour or a texture's dictionary, times an attribute of the mesh."""
    attribute = {"type": "mesh_attribute", "name": name}
    if isinstance(value, dict) or (np.ndim(value) and len(set(value)) > 1):
        return {"type": PRODUCT, "factor_0": value, "factor_1": attribute}
    return attribute | {"scale": float(np.max(value))}


def _opacity(item: Item, base: Texture | None, factor: float, by_vertices: bool = False) -> Any:
    """What alpha leaves of a surface: a number or a texture's dictionary.

    by_vertices: alpha of vertices leaves less.
    """
    mode = item.text("alphaMode", "OPAQUE")
    if mode not in ("OPAQUE", "MASK", "BLEND"):
        raise item.error(f"its alphaMode is {brief(mode)}: there are OPAQUE, MASK and BLEND")
    if mode == "OPAQUE":
        return 1.0
    opacity = _values(base, slice(3, 4), factor)
    by_vertices = by_vertices and opacity != 0
    if mode == "MASK":
        cutoff = item.number("alphaCutoff", 0.5, 0)
        if by_vertices:
            if isinstance(opacity, dict):
                opacity = opacity | {"filter_type": "nearest"}
            return {"type": STEP, "stepped": _by_vertices(opacity, ALPHA), "at_least": cutoff}
        if isinstance(opacity, dict):
            # Between two texels there is no half a hole.
            return opacity | {"bitmap": (opacity["bitmap"] >= cutoff).astype(np.float32),
                              "filter_type": "nearest"}
        return float(opacity >= cutoff)
    return _by_vertices(opacity, ALPHA) if by_vertices else opacity


def _covered(opacity: Any, material: dict[str, Any]) -> dict[str, Any] | None:
    """A material with the holes that its alpha makes; None where there is nothing but holes."""
    if opacity == 0:
        return None
    return material if opacity == 1 else {"type": "mask", "opacity": opacity, "bsdf": material}


def _lie_alike(*textures: dict[str, Any]) -> bool:
    """Whether two textures are on the same places of a surface."""
    a, b = ((t["wrap_mode"], np.asarray(t.get("uv_from_surface", np.eye(4)))) for t in textures)
    return a[0] == b[0] and np.array_equal(a[1], b[1])


def _times(color: Any, opacity: Any) -> Any:
    """A colour or texture times a share, each a number or a dictionary, of the finer one's texels:
    of the opacity's filter, for holes have edges."""
    if not isinstance(opacity, dict):
        return (color | {"bitmap": color["bitmap"] * np.float32(opacity)}
                if isinstance(color, dict) else tuple(c * opacity for c in color))
    share = opacity["bitmap"]
    if isinstance(color, dict):
        size = [max(pair) for pair in zip(color["bitmap"].shape[:2], share.shape[:2])]
        colors, share = (image[np.ix_(*(np.arange(n) * m // n for n, m in zip(size, image.shape)))]
                         for image in (color["bitmap"], share))
    else:
        colors = np.asarray(color, np.float32)
    return opacity | {"bitmap": (colors * share).astype(np.float32)}


def _normal_map(item: Item, bumps: Texture | None, left: bool,
                own_tangents: bool) -> dict[str, Any] | None:
    if bumps is None:
        return None
    scale = item.part("normalTexture").number("scale", 1)
    n = (2 * bumps.pixels[..., :3].astype(np.float64) - 1) * (scale, scale, 1)
    lengths = np.linalg.norm(n, axis=2, keepdims=True)
    n = np.where(lengths > 0, n / np.where(lengths > 0, lengths, 1), (0, 0, 1))
    n = _turned(n, None if own_tangents else bumps.placed.get("uv_from_surface"), left)
    return bumps.dictionary((n / 2 + 0.5).astype(np.float32))


def _turned(values: np.ndarray, transform: np.ndarray | None, left: bool) -> np.ndarray:
    """Normals (h, w, 3) of glTF as Mitsuba takes them, whose y is along n x t.

    x is along t and y against d, the ways of the picture's u and v. Where its uv are a transform
    (4, 4) of the surface's they are turned, as if those had one scale on the surface.
    """
    across, side = np.array([1.0, 0.0]), 1.0
    if transform is not None and (side := float(np.sign(np.linalg.det(transform[:2, :2])))):
        across = np.linalg.inv(transform[:2, :2])[:, 0]
        across /= np.linalg.norm(across)
    down = (side or 1.0) * np.array([-across[1], across[0]])
    x, y, z = np.moveaxis(values, -1, 0)
    along_t, along_d = (x * across[k] - y * down[k] for k in range(2))
    return np.stack([along_t, along_d if left else -along_d, z], axis=-1)
