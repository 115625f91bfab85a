"""A glTF 2.0 file as a scene.

Shapes are the triangles of the nodes' meshes, a shape for each primitive, called after its node.
What cannot be rendered here (skins, morph targets, compressed meshes and textures) is refused where
it stands in the JSON; what is not used is told once. A file without a camera gets one that sees
everything, one without light a white sky.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from onespp.render.scene_files.loaded import FRAMES, Loaded, scene_name, unique_names
from onespp.scenes.description import MOST_FRAMES, Scene, SceneError, Shape
from onespp.scenes.transforms import Matrix

from . import animations, cameras
from .accessors import Accessors
from .document import Document
from .lights import lights
from .materials import Materials
from .meshes import Meshes
from .nodes import Node, nodes

FPS = 24
MAX_DEPTH = 8
_SKY = (1.0, 1.0, 1.0)


def load_gltf(path: Path, sensor: int = 0) -> Loaded:
    """The scene of a file.

    Args:
        sensor: which of its cameras, from 0, in the order of its nodes.

    Raises:
        SceneError: there is no such file, or it cannot be rendered here; one sentence with the
            file and the place in its JSON.
    """
    document = Document(path)
    accessors = Accessors(document)
    try:
        with np.errstate(all="ignore"):
            return _loaded(document, accessors, path, sensor)
    except SceneError as error:
        text = str(error)
        raise SceneError(text if text.startswith(("scene file", "there is no")) else
                         f"scene file '{path}': {text}") from None


def _loaded(document: Document, accessors: Accessors, path: Path, sensor: int) -> Loaded:
    tracks = animations.tracks(document, accessors, FPS)
    shown = nodes(document, tracks)
    shapes = _shapes(document, accessors, shown)
    if not shapes:
        raise SceneError(f"scene file '{path}': there are no meshes in it: export some")
    added = []
    found = cameras.camera(document, shown, sensor)
    if found is None:
        found = cameras.camera_of_all(shapes), cameras.WIDTH, cameras.HEIGHT
        added.append("no camera, so one looks at it from the front")
    points = lights(document, shown)
    sky = None if points or any(shape.emission is not None for shape in shapes) else _SKY
    if sky is not None:
        added.append("no light, so a white sky of radiance 1 lights it")
    last = max((float(track.times[-1]) for track in tracks.values() if not track.is_still),
               default=FRAMES - 1)
    camera, width, height = found
    scene = Scene(
        name=scene_name(path), about=f"A scene of {scene_name(path)}{path.suffix}", shapes=shapes,
        camera=camera, frames=min(max(math.floor(last + 1e-6) + 1, 1), MOST_FRAMES), width=width,
        height=height, max_depth=MAX_DEPTH, fps=FPS, environment=sky, lights=points)
    scene.try_frames([0, scene.frames - 1])
    unused = ", ".join(f"{what} ({where})" for what, where in document.unused.items())
    return Loaded(scene, unused, f"{path.name} has {' and '.join(added)}" if added else "",
                  tuple(document.files))


def _shapes(document: Document, accessors: Accessors, shown: list[Node]) -> tuple[Shape, ...]:
    meshes, materials = Meshes(document, accessors), Materials(document)
    parts: list[tuple[str, Node, dict]] = []
    for node in shown:
        if "mesh" not in node.item:
            continue
        if "skin" in node.item:
            raise node.item.error("it has a skin, and meshes are rigid here: export without "
                                  "armatures, or with their motion as that of objects")
        for primitive in document.refer(node.item, "mesh", "meshes").parts("primitives"):
            colors = meshes.colors(primitive)
            look = materials.look(primitive, colors)
            mesh = meshes.mesh(primitive, look.uv_set or 0, look.colors)
            if mesh is None or look.material is None:
                continue
            if look.uv_set is not None and mesh.uv is None:
                raise primitive.error(f"its material has textures, and it has no TEXCOORD_"
                                      f"{look.uv_set}: unwrap it, or take the textures out")
            sides = (meshes.by_side(primitive, look.uv_set or 0, look.colors) if look.bumpy
                     else [(False, mesh)])
            for left, mesh in sides:
                look = materials.look(primitive, colors, left != _mirrors(node.at(0)))
                name = f"{node.name} mirrored" if left and len(sides) > 1 else node.name
                parts.append((name, node, {
                    "geometry": mesh, "material": look.material, "emission": look.emission}))
    made = []
    for name, (_, node, part) in zip(unique_names(name for name, _, _ in parts), parts):
        try:
            made.append(Shape(name, world_from_object=node.world_from_node, **part))
        except SceneError as error:
            raise node.item.error(str(error)) from None
    return tuple(made)


def _mirrors(matrix: Matrix) -> bool:
    return bool(np.linalg.det(matrix[:3, :3]) < 0)
