"""The user's own scenes and meshes in a data set: all looked at when it is begun, then drawn from.

A file's scene is seen from somewhere on the orbit about what its camera looks at, and the camera
moves from there; one that moves already is left alone. What moves in a file does so from a drawn
frame on. Its light is as it is. A mesh is a thing among others; without uv it gets those of a box.

A file is known by a hash of its bytes, and of those of all meshes, pictures and files that it
names, not by where it is.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from onespp.render.errors import InputError
from onespp.render.files.atomic import read_bytes
from onespp.render.host.turns import turn
from onespp.render.scene_files.loaded import Loaded
from onespp.render.scene_of_file import scene_of_file
from onespp.scenes.animation import Animation
from onespp.scenes.description import Camera, Mesh, Scene, SceneError
from onespp.scenes.drawn.choices import FILES
from onespp.scenes.drawn.draw import Drawn, Request, dealt
from onespp.scenes.drawn.things import footing
from onespp.scenes.meshes import box_mapped

from .patterns import MESHES
from .plan import Plan

_MESHES_KEPT = 64


def opened(plan: Plan, tell: Callable[[str], None] = lambda sentence: None) -> Plan:
    """The plan with the hashes of its files, each of which was read.

    Args:
        tell: told what of a file is not used.

    Raises:
        SceneError: a file that cannot be rendered here. InputError: one that is held out shows the
            same as one that is not.
    """
    contents: dict[str, str] = {}
    for name in plan.named:
        if name.lower().endswith(MESHES):
            contents[name] = _hash(Path(plan.folder, name))
            _mesh(Path(plan.folder, name), contents[name])
            continue
        loaded = scene_of_file(Path(plan.folder, name))
        contents[name] = _content(loaded)
        if loaded.unused:
            tell(f"of {name} is not used: {loaded.unused}")
    out = {contents[name]: name for name in (*plan.held_out.files, *plan.held_out.meshes)}
    for name in (*plan.draw.files, *plan.draw.meshes):
        other = out.get(contents[name], name)
        if other != name:
            raise InputError(f"{name} is the same file as {other}, which is held out: hold both "
                             "out, or take one away")
    return plan.model_copy(update={"contents": contents})


def drawn_of_file(plan: Plan, request: Request) -> Drawn:
    """The scene of a request whose family is `FILES`.

    Raises:
        SceneError: the file cannot be rendered here. InputError: it has changed.
    """
    r = request
    name = dealt(r.choices.files, r, "file")
    loaded = scene_of_file(Path(plan.folder, name))
    content = _content(loaded)
    _require_unchanged(plan, name, content)
    random = np.random.default_rng((r.seed, r.number, r.attempt, 6))
    first = int(random.integers(max(1, loaded.scene.frames - r.frames + 1)))
    scene = _from_frame(loaded.scene, first)
    move, view = "its own", {}
    if not scene.camera.moves:
        with turn():
            camera, move, view = _camera(scene, r, random)
        scene = replace(scene, camera=camera)
    scene = replace(scene, name=f"{r.name}/{r.number}", about=f"{name}, camera: {move}",
                    frames=r.frames, height=r.height, width=r.width)
    return Drawn(scene, (), {
        "seed": r.seed, "attempt": r.attempt, "family": FILES, "file": name, "content": content,
        "first": first, "light": "its own", "camera": move, **view, "things": [], "lamps": []})


def mesh_of(plan: Plan, name: str) -> Mesh:
    """The mesh of one of the plan's files, with uv.

    Raises:
        SceneError: it cannot be read. InputError: it has changed.
    """
    path = Path(plan.folder, name)
    content = _hash(path)
    _require_unchanged(plan, name, content)
    return _mesh(path, content)


@lru_cache(maxsize=_MESHES_KEPT)
def _mesh(path: Path, content: str) -> Mesh:
    """content: of the file; a changed one is read again."""
    from onespp.render.scene_files.geometry import mesh_of_file  # imports Mitsuba

    with turn():
        mesh = mesh_of_file(path)
    try:
        footing(mesh)
    except SceneError as error:
        raise SceneError(f"{path} cannot stand among the things of a scene: {error}") from None
    return mesh if mesh.uv is not None else box_mapped(mesh)


def _require_unchanged(plan: Plan, name: str, content: str) -> None:
    if content != plan.contents.get(name, content):
        raise InputError(f"{Path(plan.folder, name)}, or a file that it names, has changed since "
                         "the data set was begun: put it back")


def _content(loaded: Loaded) -> str:
    """A hash of what a scene was read from."""
    main, *others = (hashlib.sha256(path.read_bytes()).hexdigest() for path in loaded.files
                     if path.is_file())
    return hashlib.sha256(" ".join([main, *sorted(others)]).encode()).hexdigest()[:16]


def _hash(path: Path) -> str:
    return hashlib.sha256(read_bytes(path)).hexdigest()[:16]


def _from_frame(scene: Scene, first: int) -> Scene:
    """The scene whose frame 0 was its frame `first`."""
    def later(at: Callable[[float], np.ndarray]) -> Animation:
        return Animation(lambda frame: at(frame + first))

    shapes = (replace(shape, world_from_object=later(shape.world_from_object_at)) if shape.moves
              else shape for shape in scene.shapes)
    camera = scene.camera
    if camera.moves:
        camera = replace(camera, world_from_camera=later(camera.world_from_camera_at))
    return scene if not first else replace(scene, shapes=tuple(shapes), camera=camera)


def _camera(scene: Scene, request: Request,
            random: np.random.Generator) -> tuple[Camera, str, dict[str, Any]]:
    """A camera for a scene whose own is still, what its move is called, and what was drawn."""
    from onespp.render.scene_files.camera_moves import PERIOD, with_camera_move  # imports Mitsuba

    moves = [move for move in request.choices.cameras if move != "cut"] or ["still"]
    move = dealt(moves, request, "camera")
    speed = float(random.uniform(*request.choices.speed) * random.uniform(0.5, 1.5))
    took = speed * (request.frames - 1)
    length = max(PERIOD, math.ceil(took))
    around, start = (float(random.uniform(0, end)) for end in (PERIOD, length - took))
    back = bool(random.random() < 0.5)
    try:
        orbit = with_camera_move(scene, "orbit").camera
        scene = replace(scene, camera=replace(
            orbit, world_from_camera=orbit.world_from_camera_at(around)))
    except SceneError:  # no room: from where the file's stands
        around = 0.0
    try:
        moved = with_camera_move(replace(scene, frames=length + 1), move).camera
    except SceneError:
        move, moved = "still", scene.camera
    drawn = {"around": round(around, 6)}
    if move == "still":
        return moved, move, drawn
    pace, start = (-speed, start + took) if back else (speed, start)
    return (replace(moved, world_from_camera=Animation(
        lambda frame: moved.world_from_camera_at(start + pace * frame))), move,
        {**drawn, "start": round(start, 6), "pace": round(pace, 6)})
