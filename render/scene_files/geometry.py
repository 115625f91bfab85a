"""Shapes of a Mitsuba file: meshes as arrays, read by Mitsuba; spheres and the like by name.

Symbols: to_world, a shape's transform in the file; M, the transform of the group that it is in.

Mitsuba's mesh is flat-shaded where the file or the option `face_normals` says so. A flat mesh under
a transform that mirrors faces the other way there (its normal follows the order of vertices), so
its faces are turned round here, where a mirrored mesh keeps its outside.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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

from .document import Node

_FILES = {"obj": ("face_normals", "flip_normals", "flip_tex_coords"),
          "ply": ("face_normals", "flip_normals", "flip_tex_coords"),
          "serialized": ("face_normals", "flip_normals", "shape_index"),
          "cube": ("flip_normals",)}
_ANALYTIC = {"sphere": ("center", "radius"), "rectangle": (), "disk": (),
             "cylinder": ("p0", "p1", "radius")}
_UNROUND = 1e-5
_KNOWN = (*_FILES, *_ANALYTIC, "instance", "merge")


@dataclass(frozen=True)
class Piece:
    """A shape of the file. node: where its name, material and emitter are."""

    node: Node
    geometry: Geometry
    world_from_object: np.ndarray


class Geometries:
    """Reads shapes; a file's mesh is read once for each way in which it is used."""

    def __init__(self) -> None:
        self._meshes: dict[tuple[Any, ...], Mesh] = {}

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
        world = above @ node.matrix()
        if node.plugin in _FILES:
            mesh = self._mesh(node)
            if mesh.normals is None and np.linalg.det(world[:3, :3]) < 0:
                mesh = Mesh(mesh.vertices, mesh.faces[:, ::-1], None, mesh.uv)
            yield Piece(node, mesh, world)
        elif node.plugin in _ANALYTIC:
            yield Piece(node, *_analytic(node, world))
        else:
            raise node.error(f"a shape of type '{node.plugin}' cannot be rendered here: there are "
                             f"{', '.join(_KNOWN)}")

    def _inner(self, node: Node, above: np.ndarray) -> Iterator[Piece]:
        node.check_names("to_world")
        world = above @ node.matrix()
        inner = node.parts("shape")
        if node.plugin == "instance":
            if [part.plugin for part in inner] != ["shapegroup"]:
                raise node.error("an instance needs one shapegroup: refer to it by its id")
            world, inner = world @ inner[0].matrix(), inner[0].parts("shape")
        for part in inner:
            yield from self.pieces(part, world)

    def _mesh(self, node: Node) -> Mesh:
        node.check_names("filename", "to_world", *_FILES[node.plugin])
        options = {name: node.values[name] for name in _FILES[node.plugin] if name in node.values}
        flipped = options.pop("flip_normals", False)
        if node.plugin != "cube":
            options["filename"] = str(node.path())
        key = (node.plugin, flipped, *options.items())
        if key not in self._meshes:
            try:
                self._meshes[key] = _read(node.plugin, options, bool(flipped))
            except (RuntimeError, SceneError) as error:
                raise node.error(f"this {node.plugin} cannot be used: {plain(error)}") from None
        return self._meshes[key]


def mesh_of_file(path: Path) -> Mesh:
    """The mesh of an OBJ or a PLY file: all its triangles as one, without its materials.

    Raises:
        SceneError: it cannot be read, or is no mesh.
    """
    try:
        return _read(path.suffix.lower()[1:], {"filename": str(path)}, False)
    except (RuntimeError, SceneError) as error:
        raise SceneError(f"{path} cannot be used as a mesh: {plain(error)}") from None


def _read(plugin: str, options: dict[str, Any], flipped: bool) -> Mesh:
    mesh = mi.load_dict({"type": plugin, **options})
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
        normals = -normals if flipped else normals
    return Mesh(vertices, faces[:, ::-1] if flipped else faces, normals, uv)


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


def _analytic(node: Node, world: np.ndarray) -> tuple[Geometry, np.ndarray]:
    node.check_names("to_world", "flip_normals", *_ANALYTIC[node.plugin])
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
        if _is_round(world[:3, :3]):
            mirrored = np.linalg.det(world[:3, :3]) < 0
            return Sphere(flipped ^ bool(mirrored)), world @ scale((-1 if mirrored else 1, 1, 1))
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
    return Mesh(mesh.vertices, mesh.faces[:, ::-1], -mesh.normals, mesh.uv)


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
