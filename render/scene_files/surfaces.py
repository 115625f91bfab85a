"""Materials and textures of a file as dictionaries of Mitsuba's, as a scene holds them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import drjit as dr
import numpy as np

from onespp.render.mitsuba import plugins
from onespp.render.mitsuba.variant import mi
from onespp.scenes import validity
from onespp.scenes.description import Material, SceneError

from .document import Node

_REFUSED = {
    "hair": "fibres", "polarizer": "polarisation", "retarder": "polarisation",
    "circular": "polarisation", "measured_polarized": "polarisation",
    "bsdf_wrapper": "what it wraps", "volume": "volumes"}
_EMPTY = np.full((2, 2, 3), 0.5)


class Surfaces:
    """Materials, made once each: shapes that refer to one share it."""

    def __init__(self) -> None:
        self._made: dict[int, Material] = {}
        self._tried: set[Any] = set()
        self._pictures: set[str] = set()  # which have been read

    def material(self, node: Node) -> Material:
        """The dictionary of a BSDF.

        Raises:
            SceneError: of a kind or with values that cannot be rendered here.
        """
        if id(node) not in self._made:
            made = self._dictionary(node)
            self._check(node, made)
            self._made[id(node)] = made
        return self._made[id(node)]

    def texture(self, node: Node) -> dict[str, Any]:
        """The dictionary of a texture."""
        return self._dictionary(node)

    def _dictionary(self, node: Node) -> dict[str, Any]:
        if node.plugin in _REFUSED:
            raise node.error(f"a {node.plugin} cannot be rendered here, which knows nothing of "
                             f"{_REFUSED[node.plugin]}: use another {node.kind}")
        if mi.PluginManager.instance().plugin_type(node.plugin) is None:
            raise node.error(f"there is no plugin '{node.plugin}' in Mitsuba: correct its type")
        made: dict[str, Any] = {"type": node.plugin}
        for key, value in node.values.items():
            if isinstance(value, Node):
                if value.kind not in ("bsdf", "texture"):
                    raise value.error(f"a {value.plugin} in a {node.plugin} cannot be rendered "
                                      "here: leave it out")
                made[key.replace(".", "_")] = self._dictionary(value)
            else:
                made[key] = value if key != "filename" else (
                    self.picture(node) if node.plugin == "bitmap" else str(node.path()))
        return made

    def picture(self, node: Node) -> str:
        """The image file that it names, which can be read."""
        path = str(node.path())
        if path not in self._pictures:
            try:
                mi.Bitmap(path)
            except RuntimeError as error:
                raise node.error(f"this {node.plugin} names '{path}', which is no image that can "
                                 f"be read ({plugins.plain(error)}): save it again as PNG, JPEG or "
                                 "EXR") from None
            self._pictures.add(path)
        return path

    def _check(self, node: Node, material: Material) -> None:
        """Say now what is wrong with it, while it is known where; images are read later.

        Mitsuba is asked once for each set of plugins, properties and texts: some take long.
        """
        what, kind = f"this {node.plugin}", _kind(material)
        try:
            validity.material(material, what)
            if kind not in self._tried:
                plugins.bsdf(_without_images(material), what)
                self._tried.add(kind)
        except SceneError as error:
            raise node.error(str(error)) from None


def _kind(value: Any) -> Any:
    """What a dictionary is but for its numbers, hashable."""
    if isinstance(value, Mapping):
        return tuple((key, "" if key == "filename" else _kind(part)) for key, part in value.items())
    return value if isinstance(value, str | bool) else type(value)


def _without_images(value: Mapping[str, Any]) -> dict[str, Any]:
    made = {key: _without_images(part) if isinstance(part, Mapping) else part
            for key, part in value.items()}
    if made.get("type") == "bitmap" and "filename" in made:
        made["bitmap"] = _EMPTY
        del made["filename"]
    return made


def emitted(value: Any, surfaces: Surfaces, node: Node) -> Any:
    """What an emitter radiates: a colour, or the dictionary of a texture that varies.

    A number is white; a spectrum of one value is not: equal energy at all wavelengths is reddish.

    Args:
        value: of the emitter's property; None where it has none.
    """
    if isinstance(value, tuple):
        return value
    if isinstance(value, int | float) and not isinstance(value, bool):
        return (float(value),) * 3
    if isinstance(value, Node):
        value = surfaces.texture(value)
    if not isinstance(value, Mapping | None):
        raise node.error(f"what this {node.plugin} radiates is {validity.brief(value)}: use a "
                         "number, an rgb, a spectrum or a texture")
    if value is not None and value["type"] == "bitmap":
        return value
    try:
        validity.check_light(value or {}, "its radiance")
        loaded = plugins.area_light(value, "its radiance") if value else mi.load_dict(
            {"type": "area"})
    except SceneError as error:
        raise node.error(str(error)) from None
    if mi.has_flag(loaded.flags(), mi.EmitterFlags.SpatiallyVarying):
        return value
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(0, 0, 1)
    r, g, b = (float(part[0]) for part in loaded.eval(si))
    return r, g, b
