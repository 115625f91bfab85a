"""A file of Blender's, by way of the user's own Blender, which exports it to glTF.

Blender is the only reader of its files that knows their modifiers, constraints and drivers. It
runs without a window and without the user's settings; what it exports is what it would render. What
glTF cannot hold (procedural textures, volumes, its sky) its exporter leaves out.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path

from onespp.render.scene_files.loaded import Loaded
from onespp.scenes.description import SceneError

from .gltf import load_gltf

VARIABLE = "ONESPP_BLENDER"
_ELSEWHERE = ("/Applications/Blender.app/Contents/MacOS/Blender",)  # where it is on no PATH
_FAILED = 3  # exit code of a script that raises
_EXPORT = ("import bpy, sys; bpy.ops.export_scene.gltf(filepath=sys.argv[-1], export_format='GLB', "
           "use_renderable=True, export_apply=True, export_cameras=True, export_lights=True, "
           "export_animations=True)")


def load_blend(path: Path, sensor: int = 0) -> Loaded:
    """The scene of a `.blend` file.

    Args:
        sensor: which of its cameras, from 0.

    Raises:
        SceneError: there is no such file or no Blender, Blender fails, or what it exports cannot be
            rendered here.
    """
    if not path.is_file():
        raise SceneError(f"there is no scene file '{path}'")
    program = _blender(path)
    with tempfile.TemporaryDirectory(prefix="onespp-") as folder:
        exported = Path(folder, f"{path.stem}.glb")
        command = [program, "--background", "--factory-startup", str(path.resolve()),
                   "--python-exit-code", str(_FAILED), "--python-expr", _EXPORT, "--",
                   str(exported)]
        try:
            done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                                  errors="replace", check=False)
        except OSError as error:
            raise SceneError(f"scene file '{path}': {program} does not run "
                             f"({error.strerror}): set {VARIABLE} to Blender's program") from None
        if done.returncode or not exported.is_file():
            raise SceneError(f"scene file '{path}': {program} could not export it to glTF "
                             f"({_last_line(done)}): open it in Blender and export a .glb")
        try:
            loaded = load_gltf(exported, sensor)
        except SceneError as error:  # about a file that nobody will find
            raise SceneError(str(error).replace(str(exported), f"{path}, as Blender exports it,"),
                             ) from None
    scene = replace(loaded.scene, about=f"A scene of {path.name}")
    return replace(loaded, scene=scene, files=(path,))


def _blender(path: Path) -> str:
    """The program that the variable names, or the one there is."""
    if named := os.environ.get(VARIABLE):
        return named
    found = shutil.which("blender") or next((p for p in _ELSEWHERE if os.path.exists(p)), None)
    if found is None:
        raise SceneError(f"scene file '{path}' is one of Blender's, and there is no `blender` "
                         f"here: install it, set {VARIABLE} to its program, or export a .glb")
    return found


def _last_line(done: subprocess.CompletedProcess[str]) -> str:
    """Of what it said: the error, where it said one."""
    lines = [line.strip() for line in (done.stdout + done.stderr).splitlines() if line.strip()]
    errors = [line for line in lines if "error" in line.lower()]
    return (errors or lines or [f"exit code {done.returncode}"])[-1][:200]
