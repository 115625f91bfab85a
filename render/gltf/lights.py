"""Point, spot and directional lights of a file (`KHR_lights_punctual`).

Their units are photometric, candela and lux, as emission's is nits. All are taken as radiometric
numbers one to one, so that lamps and lights keep their proportion. Blender's exporter alone makes
candela and lux of watts, by 683 lumens a watt, and leaves emission as it is: its lights are divided
by 683, and the file looks as it did there.

A spot has its whole intensity within its inner angle and falls to none at its outer one, in
Mitsuba linearly with the angle. A light's range is not used, and it does not move.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from onespp.render.scene_files.geometry import turned_to
from onespp.scenes.description import Light, SceneError
from onespp.scenes.transforms import translate
from onespp.scenes.validity import brief

from .document import Document
from .item import Item
from .nodes import Node

_LUMENS_A_WATT = 683.0
_LIGHTS = "KHR_lights_punctual"
_NARROWEST = 1e-3  # degrees between a spot's inner and outer angle


def lights(document: Document, nodes: list[Node]) -> tuple[Light, ...]:
    """The lights of the nodes that are shown."""
    found = [(node, node.item.extension(_LIGHTS)) for node in nodes]
    return tuple(_light(document, node, here) for node, here in found if "light" in here)


def _light(document: Document, node: Node, here: Item) -> Light:
    item = document.refer(here, "light", "lights", document.root.extension(_LIGHTS))
    if callable(node.world_from_node):
        document.leave(node.item, "the motion of a light")
    if "range" in item:
        document.leave(item, "the range of lights")
    blender = "Blender" in document.root.part("asset").text("generator")
    strength = item.number("intensity", 1, 0, 1e12) / (_LUMENS_A_WATT if blender else 1)
    color = tuple((strength * item.numbers("color", (1, 1, 1), 0, 1)).tolist())
    kind, made = item.text("type"), dict[str, Any]()
    if kind == "directional":
        made = {"type": "directional", "irradiance": color}
    elif kind == "point":
        made = {"type": "point", "intensity": color}
    elif kind == "spot":
        spot = item.part("spot")
        inner = np.degrees(spot.number("innerConeAngle", 0, 0, np.pi / 2))
        outer = np.degrees(spot.number("outerConeAngle", np.pi / 4, 0, np.pi / 2))
        outer = max(outer, 2 * _NARROWEST)
        made = {"type": "spot", "intensity": color, "cutoff_angle": float(outer),
                "beam_width": float(min(inner, outer - _NARROWEST))}
    else:
        raise item.error(f"its type is {brief(kind)}: there are point, spot and directional")
    matrix = node.at(0)
    length = np.linalg.norm(matrix[:3, 2])
    if not length > 0:
        raise node.item.error("a light stands on it that its scale makes flat: scale by more "
                              "than 0")
    try:
        return Light(made, translate(matrix[:3, 3]) @ turned_to(-matrix[:3, 2] / length))
    except SceneError as error:
        raise item.error(str(error)) from None
