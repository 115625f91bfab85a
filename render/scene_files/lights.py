"""Lights of a Mitsuba file: what shapes emit, what comes from all around, points and directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from onespp.scenes.description import Light, SceneError
from onespp.scenes.transforms import translate
from onespp.scenes.validity import ENVIRONMENTS, LIGHTS

from .document import Node
from .geometry import turned_to
from .surfaces import Surfaces, emitted

_IGNORED = "sampling_weight"  # each emitter is sampled as the others are
_DEFAULT = {"point": "intensity", "spot": "intensity", "directional": "irradiance"}


def emission(shape: Node, surfaces: Surfaces) -> Any:
    """Radiance of a shape's area light, None where it has none."""
    found = shape.parts("emitter")
    if not found:
        return None
    if len(found) > 1 or found[0].plugin != "area":
        odd = found[-1]
        raise odd.error(f"a shape cannot have {'two emitters' if len(found) > 1 else odd.plugin} "
                        "here: use one area light")
    found[0].check_names("radiance", _IGNORED)
    return emitted(found[0].values.get("radiance"), surfaces, found[0])


def of_scene(root: Node) -> list[Node]:
    """The emitters of the scene itself; what a shape refers to is the shape's."""
    referred = {part for shape in root.all_parts("shape") for part in shape.parts("emitter")}
    return [node for node in root.parts("emitter") if node not in referred]


def around(emitters: Sequence[Node], surfaces: Surfaces) -> Any:
    """The scene's environment, None where it has none."""
    found = [node for node in emitters if node.plugin in (*ENVIRONMENTS, "timed_sunsky")]
    if not found:
        return None
    node = found[0]
    if len(found) > 1:
        raise found[1].error("there is another environment: a scene has one")
    if node.plugin == "constant":
        node.check_names("radiance", _IGNORED, "to_world")
        return emitted(node.values.get("radiance"), surfaces, node)
    if node.plugin == "timed_sunsky":
        raise node.error("a timed_sunsky cannot be rendered here: use a sunsky")
    if node.plugin == "envmap":
        node.check_names("filename", "scale", "to_world", "mis_compensation", _IGNORED)
        made: dict[str, Any] = {"type": "envmap", "filename": surfaces.picture(node)}
        if "scale" in node.values:
            made["scale"] = node.number("scale", 1)
        if "mis_compensation" in node.values:
            made["mis_compensation"] = bool(node.values["mis_compensation"])
    else:
        made = {"type": node.plugin, **{key: surfaces.texture(value) if isinstance(value, Node)
                                        else value for key, value in node.values.items()
                                        if key not in (_IGNORED, "to_world")}}
    if "to_world" in node.values:
        made["to_world"] = node.matrix()
    return made


def points(emitters: Sequence[Node], surfaces: Surfaces) -> tuple[Light, ...]:
    """The lights that are neither shapes nor all around."""
    found = [node for node in emitters if node.plugin not in (*ENVIRONMENTS, "timed_sunsky")]
    return tuple(_point(node, surfaces) for node in found)


def _point(node: Node, surfaces: Surfaces) -> Light:
    if node.plugin == "area":
        raise node.error("an area light is of a shape: put it into one, or refer to it "
                         "there")
    if node.plugin not in LIGHTS:
        raise node.error(f"an emitter of type '{node.plugin}' cannot be rendered here: there are "
                         f"area, {', '.join((*ENVIRONMENTS, *LIGHTS))}")
    strength = _DEFAULT[node.plugin]
    made: dict[str, Any] = {
        "type": node.plugin, strength: emitted(node.values.get(strength), surfaces, node)}
    for key, value in node.values.items():
        if isinstance(value, Node) and key != strength:
            made[key] = surfaces.texture(value)
        elif key not in (_IGNORED, strength, "to_world", "position", "direction"):
            made[key] = value
    place = node.matrix()
    if "position" in node.values:
        place = translate(node.triple("position"))
    if "direction" in node.values:
        direction = node.triple("direction")
        length = np.linalg.norm(direction)
        if not length > 0:
            raise node.error("its direction has no length: use x, y and z that are not all 0")
        place = turned_to(direction / length)
    try:
        return Light(made, place)
    except SceneError as error:
        raise node.error(str(error)) from None
