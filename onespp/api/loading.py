"""A scene by name, from a file of Python, of Mitsuba's or of glTF, to render or to move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from onespp.render.errors import InputError
from onespp.render.host.turns import turn
from onespp.render.scene_files.loaded import Loaded
from onespp.scenes import catalog
from onespp.scenes.description import Scene, SceneError

from .caller import caller, public

_XML, _GLTF = ".xml", (".glb", ".gltf")


@public
def load(scene: str | Path | Scene, *, define: Mapping[str, object] | None = None,
         sensor: int = 0) -> Scene:
    """A scene to render, or to change first.

    A `Scene` is a frozen dataclass in plain Python and NumPy: `dataclasses.replace` makes another
    of it, and each of its shapes may get a motion (see `onespp.scenes.animation`).

    Args:
        scene: a name of `onespp.scenes()`, the path of a `.py` file, a Mitsuba 3 `.xml`
            file or a glTF 2.0 file (`.glb`, `.gltf`), or a `Scene`, which is returned as it is.
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
                         "path of a .py, .xml, .glb or .gltf file, or a onespp.Scene")
    kind = str(scene).lower()
    if define and not kind.endswith(_XML):
        raise InputError(f"-D is for Mitsuba's XML files, and '{scene}' is none: leave it out")
    if not kind.endswith((_XML, *_GLTF)):
        if sensor:
            raise InputError(f"--sensor is for files of Mitsuba and of glTF, and '{scene}' is "
                             "none: leave it out")
        return catalog.load(str(scene))
    with turn():
        loaded = _of_file(Path(scene), kind, define or {}, sensor)
    if loaded.added:
        caller().inform(loaded.added)
    if loaded.unused:
        caller().inform(f"of {Path(scene).name} is not used: {loaded.unused}")
    return loaded.scene


def _of_file(path: Path, kind: str, define: Mapping[str, object], sensor: int) -> Loaded:
    """The scene of another program's file; imports Mitsuba."""
    if kind.endswith(_XML):
        from onespp.render.scene_files.mitsuba_xml import load_xml

        return load_xml(path, {str(name): _text(value) for name, value in define.items()}, sensor)
    from onespp.render.gltf.gltf import load_gltf

    return load_gltf(path, sensor)


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
