"""Shapes of a Mitsuba file: meshes as arrays, read by Mitsuba; spheres and the like by name.

Symbols: A, what a shape's own `to_world` does to directions, (3, 3); N, a normal after A.

Mitsuba applies a shape's own transform to its vertices, and an instance's to what a ray has hit. So
normals that a file does not have follow from the order of vertices, and from angles, after A: an A
that mirrors turns them inward. An instance that mirrors keeps the outside of what is in it, and so
do all transforms here; hence faces are turned round where A mirrors, and normals are A^T N.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from onespp.render.mitsuba.plugins import plain
from onespp.render.mitsuba.variant import mi
from onespp.scenes import meshes
from onespp.scenes.description import (
    Cylinder,
    Disk,
    Geometry,
    Mesh,
    Rectangle,
    SceneError,
    Sphere,
)
from onespp.scenes.transforms import scale, translate
from onespp.scenes.validity import BUFFERS

from .document import Node

_FILES = {"obj": ("face_normals", "flip_normals", "flip_tex_coords"),
          "ply": ("face_normals", "flip_normals", "flip_tex_coords"),
          "serialized": ("face_normals", "flip_normals", "shape_index"),
          "cube": ("flip_normals",)}
_ANALYTIC = {"sphere": ("center", "radius"), "rectangle": (), "disk": (),
             "cylinder": ("p0", "p1", "radius")}
_IGNORED = "silhouette_sampling_weight"  # of derivatives
_UNROUND = 1e-5
_AS_IT_IS, _MIRRORED = np.eye(3), np.diag([-1.0, 1, 1])
_KNOWN = (*_FILES, *_ANALYTIC, "instance", "merge")


@dataclass(frozen=True)
class Piece:
    """A shape of the file. node: where its name, material and emitter are."""

    node: Node
    geometry: Geometry
    world_from_object: np.ndarray


class _File(NamedTuple):
    """A mesh as a file and its options give it. flipped: it faces the other way.

    attributes: of its data of vertices and faces, those that are asked for.
    """

    plugin: str
    options: tuple[tuple[str, Any], ...]
    flipped: bool = False
    attributes: tuple[str, ...] = ()


class Geometries:
    """Reads shapes; a file's mesh is read once for each way in which it is used."""

    def __init__(self) -> None:
        self._meshes: dict[tuple[_File, bytes], Mesh] = {}

    def pieces(self, node: Node, above: np.ndarray | None = None) -> Iterator[Piece]:
        """A shape, or those in it, each with its place in the world.

        Raises:
            SceneError: a shape that cannot be rendered here, or a file that cannot be read.
        """
        above = np.eye(4) if above is None else above
        if node.plugin == "shapegroup":  # stands where its instances say
            return
        if medium := node.parts("medium"):
            raise medium[0].error("media cannot be rendered here, only surfaces: leave out what "
                                  "fills a shape")
        if node.plugin in ("instance", "merge"):
            yield from self._inner(node, above)
            return
        if node.plugin in _FILES:
            yield Piece(node, self._mesh(node), above @ node.matrix())
        elif node.plugin in _ANALYTIC:
            yield Piece(node, *_analytic(node, above))
        else:
            raise node.error(f"a shape of type '{node.plugin}' cannot be rendered here: there are "
                             f"{', '.join(_KNOWN)}")

    def _inner(self, node: Node, above: np.ndarray) -> Iterator[Piece]:
        node.check_names("to_world", _IGNORED)
        world = above @ node.matrix()
        inner = node.parts("shape")
        if node.plugin == "instance":
            if [part.plugin for part in inner] != ["shapegroup"]:
                raise node.error("an instance needs one shapegroup: refer to it by its id")
            inner = inner[0].parts("shape")
        for part in inner:
            yield from self.pieces(part, world)

    def _mesh(self, node: Node) -> Mesh:
        node.check_names("filename", "to_world", _IGNORED, *_FILES[node.plugin])
        options = {name: node.values[name] for name in _FILES[node.plugin] if name in node.values}
        flipped = options.pop("flip_normals", False)
        if node.plugin != "cube":
            options["filename"] = str(node.path())
        file = _File(node.plugin, tuple(options.items()), bool(flipped), _shown(node))
        try:
            return self._made(file, self._turn(file, node.matrix()[:3, :3]))
        except (RuntimeError, UnicodeDecodeError, SceneError) as error:
            raise node.error(f"this {node.plugin} cannot be used: {plain(error)}") from None

    def _made(self, file: _File, turn: np.ndarray) -> Mesh:
        key = file, turn.tobytes()
        if key not in self._meshes:
            mesh = _read(file, turn)
            self._meshes[key] = mesh if turn is _AS_IT_IS else replace(
                mesh, vertices=self._made(file, _AS_IT_IS).vertices)
        return self._meshes[key]

    def _turn(self, file: _File, linear: np.ndarray) -> np.ndarray:
        """What of A, `linear`, its normals depend on: nothing where the file has them."""
        normals, determinant = self._made(file, _AS_IT_IS).normals, np.linalg.det(linear)
        mirror = _MIRRORED if determinant < 0 else _AS_IT_IS
        if normals is None or not determinant:
            return mirror
        turn = mirror if _is_round(linear) else linear / abs(linear).max()
        if turn is _AS_IT_IS:
            return turn
        mirrored = self._made(file, _MIRRORED).normals
        assert mirrored is not None
        return _AS_IT_IS if np.sum(normals * mirrored) > 0 else turn


def mesh_of_file(path: Path) -> Mesh:
    """The mesh of an OBJ or a PLY file: all its triangles as one, without its materials.

    Raises:
        SceneError: it cannot be read, or is no mesh.
    """
    try:
        return _read(_File(path.suffix.lower()[1:], (("filename", str(path)),)), _AS_IT_IS)
    except (RuntimeError, UnicodeDecodeError, SceneError) as error:
        raise SceneError(f"{path} cannot be used as a mesh: {plain(error)}") from None


def _read(file: _File, turn: np.ndarray) -> Mesh:
    """A mesh as Mitsuba has it where A is `turn`, its normals back in object space."""
    place = np.eye(4)
    place[:3, :3] = turn
    mesh = mi.load_dict({"type": file.plugin, **dict(file.options),
                         "to_world": mi.ScalarTransform4f(place.tolist())})
    arrays = mi.traverse(mesh)

    def rows(name: str, width: int) -> np.ndarray:
        return np.array(arrays[name]).reshape(-1, width)

    vertices, faces = rows("vertex_positions", 3), rows("faces", 3).astype(np.int64)
    normals = rows("vertex_normals", 3) if mesh.has_vertex_normals() else None
    uv = rows("vertex_texcoords", 2) if mesh.has_vertex_texcoords() else None
    if uv is not None:
        uv = np.where(np.isfinite(uv), uv, 0)
    if normals is not None:
        normals = with_lengths(normals, vertices, faces)
        normals = normals if turn is _AS_IT_IS else normals @ turn
        normals = -normals if file.flipped else normals
    turned = file.flipped ^ bool(np.linalg.det(turn) < 0)
    return Mesh(vertices, faces[:, ::-1] if turned else faces, normals, uv, {
        name: _attribute(name, np.array(arrays[name]),
                         len(faces if name.startswith("face_") else vertices))
        for name in file.attributes if name in arrays})


def _attribute(name: str, values: np.ndarray, count: int) -> np.ndarray:
    """(count, 1 or 3) values of vertices or faces."""
    width = values.size // count
    if width not in (1, 3):  # Mitsuba shows black
        raise SceneError(f"its attribute '{name}' has rows of {width}, and textures show rows of 1 "
                         "or 3: save it again so, colours without alpha")
    return values.reshape(count, width)


def _shown(node: Node) -> tuple[str, ...]:
    """The attributes that materials in a shape's node show."""
    found: set[str] = set()
    left = node.parts("bsdf")
    while left:
        part = left.pop()
        name = part.values.get("name")
        if (part.plugin == "mesh_attribute" and isinstance(name, str) and name not in BUFFERS
                and name.startswith(("vertex_", "face_"))):
            found.add(name)
        left += part.parts("bsdf", "texture")
    return tuple(sorted(found))


def with_lengths(normals: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Normals; where one has no length, or is none, that of the faces around."""
    bad = ~(np.isfinite(normals).all(axis=1) & np.any(normals, axis=1))
    if not bad.any():
        return normals
    a, b, c = (vertices[faces[:, i]].astype(np.float64) for i in range(3))
    around = np.zeros(vertices.shape)
    for corner in range(3):
        np.add.at(around, faces[:, corner], np.cross(b - a, c - a))
    around[~np.any(around, axis=1)] = 0, 0, 1
    return np.where(bad[:, None], around / np.linalg.norm(around, axis=1, keepdims=True), normals)


def _analytic(node: Node, above: np.ndarray) -> tuple[Geometry, np.ndarray]:
    """A shape that renderers know by name, and its place; `above`, where its instance is."""
    world = above @ node.matrix()
    node.check_names("to_world", "flip_normals", _IGNORED, *_ANALYTIC[node.plugin])
    flipped = bool(node.values.get("flip_normals", False))
    if not np.linalg.det(world[:3, :3]):
        raise node.error(f"this {node.plugin} is flattened by its transform: scale all its axes "
                         "by more than 0")
    if node.plugin == "rectangle":
        return Rectangle(flipped), world
    if node.plugin == "disk":
        return Disk(flipped), world
    radius = node.number("radius", 1)
    if not radius > 0:
        raise node.error(f"the radius of this {node.plugin} is {radius:g}: use more than 0")
    if node.plugin == "sphere":
        world = world @ translate(node.triple("center", "point", (0, 0, 0))) @ scale(radius)
        flipped ^= bool(np.linalg.det(node.matrix()[:3, :3]) < 0)
        if _is_round(world[:3, :3]):
            mirrored = np.linalg.det(world[:3, :3]) < 0
            return Sphere(flipped), world @ scale((-1 if mirrored else 1, 1, 1))
        ball = meshes.ellipsoid((1, 1, 1), 96)
        return _turned(meshes.place(ball, _Z_UP), flipped), world
    start, end = node.triple("p0", "point", (0, 0, 0)), node.triple("p1", "point", (0, 0, 1))
    axis = end - start
    length = float(np.linalg.norm(axis))
    if not length > 0:
        raise node.error("the two ends of this cylinder are one point: move p0 or p1")
    world = world @ translate(start) @ turned_to(axis / length) @ scale((radius, radius, length))
    if not _is_round(world[:3, :2]) or abs(world[:3, :2].T @ world[:3, 2]).max() > (
            _UNROUND * np.linalg.norm(world[:3, 0]) * np.linalg.norm(world[:3, 2])):
        raise node.error("this cylinder is stretched or sheared by its transform: use a mesh")
    return Cylinder(flipped), world


_Z_UP = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])


def _turned(mesh: Mesh, flipped: bool) -> Mesh:
    if not flipped or mesh.normals is None:
        return mesh
    return replace(mesh, faces=mesh.faces[:, ::-1], normals=-mesh.normals)


def turned_to(z: np.ndarray) -> np.ndarray:
    """A rotation, (4, 4), whose third column is `z`, as Mitsuba's `coordinate_system` has it."""
    s, t = (np.array(v).ravel() for v in mi.coordinate_system(mi.ScalarVector3f(z.tolist())))
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = s, t, z
    return matrix


def _is_round(columns: np.ndarray) -> bool:
    """Whether columns are perpendicular and of one length."""
    square = columns.T @ columns
    return bool(abs(square - square[0, 0] * np.eye(len(square))).max() <= _UNROUND * square[0, 0])


def default_name(node: Node) -> str:
    """What a shape is called: by the file, or after the file of its mesh, or its kind."""
    filename = node.values.get("filename")
    return node.id or (Path(filename).stem if isinstance(filename, str) else "") or node.plugin
