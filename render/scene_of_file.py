"""Files of other programs that are scenes, by their suffix; importing this loads no Mitsuba."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from onespp.render.host.turns import turn
from onespp.render.scene_files.loaded import Loaded

XML, GLTF, BLEND = ".xml", (".glb", ".gltf"), ".blend"
SUFFIXES = (XML, *GLTF, BLEND)


def is_scene_file(path: str | Path) -> bool:
    """Whether a file of this name is one of Mitsuba's, glTF's or Blender's."""
    return str(path).lower().endswith(SUFFIXES)


def scene_of_file(path: Path, define: Mapping[str, str] | None = None, sensor: int = 0) -> Loaded:
    """The scene of a file; imports Mitsuba.

    Args:
        define: values for the `$name` of an XML file. sensor: which of its cameras, from 0.

    Raises:
        SceneError: there is no such file, or it cannot be rendered here.
    """
    with turn():
        if str(path).lower().endswith(XML):
            from onespp.render.scene_files.mitsuba_xml import load_xml

            return load_xml(path, define, sensor)
        if str(path).lower().endswith(BLEND):
            from onespp.render.gltf.blender import load_blend

            return load_blend(path, sensor)
        from onespp.render.gltf.gltf import load_gltf

        return load_gltf(path, sensor)
