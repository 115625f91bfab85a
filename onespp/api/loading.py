"""A scene by name, or from a file of Python, Mitsuba, glTF or Blender, to render or to move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from onespp.render.errors import InputError
from onespp.render.host.turns import turn
from onespp.render.scene_of_file import XML, is_scene_file, scene_of_file
from onespp.scenes import catalog
from onespp.scenes.description import Scene, SceneError

from .caller import caller, public


@public
def load(scene: str | Path | Scene, *, define: Mapping[str, object] | None = None,
         sensor: int = 0) -> Scene:
    """A scene to render, or to change first.

    A `Scene` is a frozen dataclass in plain Python and NumPy: `dataclasses.replace` makes another
    of it, and each of its shapes may get a motion (see `onespp.scenes.animation`).

    Args:
        scene: a name of `onespp.scenes()`, the path of a `.py` file, a Mitsuba 3 `.xml`
            file, a glTF 2.0 file (`.glb`, `.gltf`) or one of Blender's (`.blend`, by the Blender
            that is installed), or a `Scene`, which is returned as it is.
        define: values for the `$name` of an XML file, by name.
        sensor: which of an XML or glTF file's cameras, from 0.

    Raises:
        SceneError: no such scene, or it cannot be rendered here; with the file and the line.
        InputError: `define` or `sensor` for a scene that is no such file.

    Example:
        >>> import onespp
        >>> onespp.load("box").max_depth
        6
    """
    if isinstance(scene, Scene):
        return scene
    if not isinstance(scene, str | Path):
        raise SceneError(f"a scene is a {type(scene).__name__}: use a name of onespp.scenes(), the "
                         "path of a .py, .xml, .glb, .gltf or .blend file, or a onespp.Scene")
    if define and not str(scene).lower().endswith(XML):
        raise InputError(f"-D is for Mitsuba's XML files, and '{scene}' is none: leave it out")
    if not is_scene_file(scene):
        if sensor:
            raise InputError(f"--sensor is for files of Mitsuba, glTF and Blender, and '{scene}' "
                             "is none: leave it out")
        return catalog.load(str(scene))
    texts = {str(name): _text(value) for name, value in (define or {}).items()}
    loaded = scene_of_file(Path(scene), texts, sensor)
    if loaded.added:
        caller().inform(loaded.added)
    if loaded.unused:
        caller().inform(f"of {Path(scene).name} is not used: {loaded.unused}")
    return loaded.scene


@public
def animate(scene: str | Path | Scene, *, camera: str | None = None,
            moves: Mapping[str, str] | None = None, frames: int | None = None) -> Scene:
    """A scene with its camera or some of its shapes set in motion.

    Sizes follow from the scene: how far away what the camera sees is, how large a shape is. The
    camera's path passes through no surface; where there is less room, the move is smaller.

    Args:
        scene: as for `load`.
        camera: "orbit", "dolly", "handheld", or "still"; None leaves it as it is.
        moves: names of shapes and, for each, "spin", "swing" or "slide".
        frames: how many the scene has then.

    Raises:
        SceneError: no such scene, move or shape, or the camera has no room.

    Example:
        >>> import onespp
        >>> onespp.animate("hard/mirror", camera="orbit").moving[0]
        'camera'
    """
    made = load(scene)
    if moves or camera:
        with turn():
            from onespp.render.scene_files.camera_moves import with_camera_move  # imports Mitsuba
            from onespp.render.scene_files.shape_moves import with_shape_moves

            made = with_camera_move(made, camera) if camera else made
            made = with_shape_moves(made, moves or {})
    return made if frames is None else replace(made, frames=frames)


def _text(value: object) -> str:
    """A value as XML has it."""
    return str(value).lower() if isinstance(value, bool) else str(value)
