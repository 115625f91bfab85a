"""A Mitsuba 3 XML file as a scene.

Everything that decides what the file looks like through Mitsuba's `path` is taken over: shapes,
materials, lights, the camera, the longest path. What says how Mitsuba would render it (the film but
for its size, the integrator but for its depth, sampler, filter, lens) is not used, and told once.
What cannot be rendered here is refused where it stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from onespp.scenes.description import LONGEST_PATH, Camera, Scene, SceneError, Shape

from . import lights
from .document import Node, read_document
from .geometry import Geometries, Piece, default_name
from .loaded import FRAMES, Loaded, scene_name, unique_names
from .surfaces import Surfaces

# Of shapes without a material, as in Mitsuba: of lamps, and of others.
_BLACK = {"type": "diffuse", "reflectance": (0.0, 0.0, 0.0)}
_GRAY = {"type": "diffuse", "reflectance": (0.5, 0.5, 0.5)}
_FILM = (768, 576)
_FULL_FRAME = np.hypot(36, 24)  # mm, what Mitsuba's focal lengths are for
_FOCAL_LENGTH = "50mm"  # where nothing is said, as in Mitsuba
_DIRECT_DEPTH = 2
_SENSOR = ("to_world", "fov", "fov_axis", "focal_length", "near_clip", "far_clip",
           "principal_point_offset_x", "principal_point_offset_y", "shutter_open", "shutter_close",
           "aperture_radius", "focus_distance", "srf")
# Mitsuba's camera has x to the left and y up.
_SENSOR_FROM_CAMERA = np.diag([-1.0, -1, 1, 1])


def load_xml(path: Path, parameters: Mapping[str, str] | None = None, sensor: int = 0) -> Loaded:
    """The scene of a file.

    Args:
        parameters: values for the file's `$name`. sensor: which of its cameras, from 0.

    Raises:
        SceneError: there is no such file, or it cannot be rendered here; one sentence with the
            file, the line and the column.
    """
    root, files = read_document(path, dict(parameters or {}))
    camera_node = _sensor(root, path, sensor)
    camera, width, height = _camera(camera_node)
    if media := camera_node.parts("medium"):
        raise media[0].error("media cannot be rendered here, only surfaces: leave it out")
    integrator = _integrator(root)
    surfaces = Surfaces()
    emitters = lights.of_scene(root)
    try:
        scene = Scene(
            name=scene_name(path), about=f"A still scene of {path.name}",
            shapes=_shapes(root, surfaces, path), camera=camera, frames=FRAMES, width=width,
            height=height, max_depth=_depth(integrator),
            environment=lights.around(emitters, surfaces),
            lights=lights.points(emitters, surfaces))
    except SceneError as error:
        text = str(error)
        raise SceneError(text if text.startswith("scene file") else
                         f"scene file '{path}': {text}") from None
    return Loaded(scene, ", ".join(_unused(root, camera_node, integrator)), files=files)


def _sensor(root: Node, path: Path, number: int) -> Node:
    sensors = root.parts("sensor")
    if not sensors:
        raise SceneError(f"scene file '{path}': there is no camera: add a <sensor>")
    if not 0 <= number < len(sensors):
        raise SceneError(f"scene file '{path}': there is no sensor {number}: use --sensor 0"
                         + (f" to {len(sensors) - 1}" if len(sensors) > 1 else ""))
    return sensors[number]


def _camera(node: Node) -> tuple[Camera, int, int]:
    """The camera, and the size of its film, (width, height)."""
    if node.plugin not in ("perspective", "thinlens"):
        raise node.error(f"a sensor of type '{node.plugin}' cannot be rendered here: use "
                         "perspective")
    node.check_names(*_SENSOR)
    for name in ("principal_point_offset_x", "principal_point_offset_y"):
        if node.number(name, 0):
            raise node.error("a camera whose principal point is off the centre cannot be rendered "
                             f"here: leave out '{name}'")
    width, height = _film(node)
    matrix = node.matrix() @ _SENSOR_FROM_CAMERA
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    if not lengths.all():
        raise node.error("the transform of this sensor flattens it: scale by more than 0")
    matrix[:3, :3] /= lengths
    fov, axis = _field_of_view(node, width / height)
    try:
        return Camera(matrix, fov, axis, bool(np.linalg.det(matrix[:3, :3]) < 0)), width, height
    except SceneError as error:
        raise node.error(str(error)) from None


def _film(node: Node) -> tuple[int, int]:
    films = node.parts("film")
    if not films:
        return _FILM
    film = films[0]
    width, height = (int(film.number(name, size)) for name, size in zip(("width", "height"), _FILM))
    whole = {"crop_offset_x": 0, "crop_offset_y": 0, "crop_width": width, "crop_height": height}
    if any(film.number(name, size) != size for name, size in whole.items()):
        raise film.error("a cropped film cannot be rendered here: leave out the crop")
    if min(width, height) < 1:
        raise film.error(f"a film of {width}x{height} is empty: use at least 1x1")
    return width, height


def _field_of_view(node: Node, aspect: float) -> tuple[float, str]:
    """Degrees, and along what; a diagonal one becomes that along x, for the film's aspect."""
    axis = str(node.values.get("fov_axis", "x")).lower()
    if "fov" in node.values and "focal_length" not in node.values:
        fov = node.number("fov", 0)
    else:
        length = str(node.values.get("focal_length", _FOCAL_LENGTH)).removesuffix("mm")
        axis = "diagonal"
        try:
            fov = float(2 * np.degrees(np.arctan(_FULL_FRAME / 2 / float(length))))
        except (ValueError, ZeroDivisionError):
            raise node.error(f"the focal_length of this sensor is {length!r}: use millimetres, as "
                             "50mm") from None
    if axis == "diagonal":
        half = np.tan(np.radians(fov) / 2) / np.sqrt(1 + 1 / aspect**2)
        fov, axis = float(2 * np.degrees(np.arctan(half))), "x"
    return fov, axis


def _integrator(root: Node) -> Node | None:
    """The one that traces paths, inside of those that wrap it."""
    found = root.parts("integrator")
    while found and (inner := found[0].parts("integrator")):
        found = inner
    return found[0] if found else None


def _depth(integrator: Node | None) -> int:
    if integrator is None:
        return LONGEST_PATH
    if integrator.plugin == "direct":
        return _DIRECT_DEPTH
    depth = int(integrator.number("max_depth", -1))
    return LONGEST_PATH if depth < 0 else min(max(depth, 1), LONGEST_PATH)


def _shapes(root: Node, surfaces: Surfaces, path: Path) -> tuple[Shape, ...]:
    geometries = Geometries()
    pieces: list[tuple[str, Piece]] = []
    for node in root.parts("shape"):
        found = list(geometries.pieces(node))
        for piece in found:
            own = default_name(piece.node)
            pieces.append((own if piece.node is node else f"{default_name(node)}/{own}", piece))
    if not pieces:
        raise SceneError(f"scene file '{path}': there are no shapes: add one")
    return tuple(_shape(name, piece, surfaces)
                 for name, (_, piece) in zip(unique_names(name for name, _ in pieces), pieces))


def _shape(name: str, piece: Piece, surfaces: Surfaces) -> Shape:
    node = piece.node
    bsdfs = node.parts("bsdf")
    if len(bsdfs) > 1:
        raise bsdfs[1].error("a shape has one material: leave out one")
    without = _BLACK if node.parts("emitter") else _GRAY
    material = surfaces.material(bsdfs[0]) if bsdfs else without
    try:
        return Shape(name, piece.geometry, material, piece.world_from_object,
                     lights.emission(node, surfaces))
    except SceneError as error:
        text = str(error)
        raise (error if text.startswith("scene file") else node.error(text)) from None


def _unused(root: Node, camera: Node, integrator: Node | None) -> list[str]:
    """What of the file is not used, in words."""
    said = []
    films = camera.parts("film")
    if films:
        said.append(f"the film '{films[0].plugin}' but for its size")
        said += [f"the filter '{part.plugin}'" for part in films[0].parts()]
    said += [f"the sampler '{part.plugin}'" for part in camera.parts("sampler")]
    if camera.plugin == "thinlens":
        said.append("the lens of the camera")
    if {"near_clip", "far_clip"} & set(camera.values):
        said.append("the camera's clip distances")
    if integrator is not None:
        hidden = " (lamps show: 'hide_emitters' too)" if integrator.values.get(
            "hide_emitters") else ""
        said.append(f"the integrator '{integrator.plugin}' but for its depth{hidden}")
    said += [f"the transform of the shapegroup '{shape.id}'" for shape in root.all_parts("shape")
             if shape.plugin == "shapegroup" and "to_world" in shape.values]
    others = len(root.parts("sensor")) - 1
    if others:
        said.append(f"{others} other sensor{'s' * (others > 1)}")
    return said
