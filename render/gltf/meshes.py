"""Primitives of a file's meshes as triangles: lists, strips and fans, with indices or without.

Colours of vertices are linear and multiply the base colour. White ones are as if there were none.

A normal map's frame has t along u and b upwards in the picture, against v. Where b is n x t it is
right-handed, as Mitsuba's is; where the picture lies mirrored it is left-handed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from onespp.render.scene_files.geometry import with_lengths
from onespp.scenes.description import Mesh, SceneError
from onespp.scenes.meshes import attributes_of

from .accessors import Accessors
from .document import Document
from .item import Item

COLOR, ALPHA = "vertex_color", "vertex_alpha"
"""Attributes of meshes: (n, 3) and (n, 1)."""

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_ALONG = 0.7      # cosine: less is another direction
_OF_OTHERS = 0.1  # share of faces


class Meshes:
    """Meshes in object space, each read once."""

    def __init__(self, document: Document, accessors: Accessors) -> None:
        self._document, self._accessors = document, accessors
        self._made: dict[tuple[str, int, tuple[str, ...]], Mesh | None] = {}

    def colors(self, primitive: Item) -> dict[str, np.ndarray]:
        """The colours of a primitive's vertices: `COLOR`, `ALPHA`, or what of these is not 1."""
        attributes = primitive.part("attributes")
        if "COLOR_1" in attributes:
            self._document.leave(attributes, "second colours of vertices")
        if "COLOR_0" not in attributes:
            return {}
        values = self._accessors.floats(attributes, "COLOR_0", "VEC3 VEC4")
        values = np.clip(np.nan_to_num(values), 0, 1)
        return {name: part for name, part in ((COLOR, values[:, :3]), (ALPHA, values[:, 3:]))
                if (part != 1).any()}

    def mesh(self, primitive: Item, uv_set: int, shown: Sequence[str] = ()) -> Mesh | None:
        """The triangles of a primitive, None where it has none.

        Args:
            uv_set: which of its texture coordinates, from 0; there may be none.
            shown: which of its `colors` it takes along.

        Raises:
            SceneError: a form that cannot be rendered here, or damaged.
        """
        key = (primitive.path, uv_set, tuple(shown))
        if key not in self._made:
            self._made[key] = self._read(primitive, uv_set, shown)
        return self._made[key]

    def by_side(self, primitive: Item, uv_set: int,
                shown: Sequence[str] = ()) -> list[tuple[bool, Mesh]]:
        """The triangles of a primitive with texture coordinates, in parts on which a normal map's
        frame is right-handed (False) and left-handed (True)."""
        mesh, attributes = self.mesh(primitive, uv_set, shown), primitive.part("attributes")
        if mesh is None:
            return []
        tangents = None
        if "TANGENT" in attributes:
            tangents = self._accessors.floats(attributes, "TANGENT", "VEC4")
            if len(tangents) != len(mesh.vertices):
                raise attributes.error(f"it has {len(mesh.vertices)} positions and {len(tangents)} "
                                       "tangents: export the file again")
            if _are_elsewhere(mesh, tangents):
                self._document.leave(attributes, "tangents that do not go along u")
        left = _left_handed(mesh, tangents)
        if left.all() or not left.any():
            return [(bool(left[0]), mesh)]
        return [(side, _part(mesh, left == side)) for side in (False, True)]

    def _read(self, primitive: Item, uv_set: int, shown: Sequence[str]) -> Mesh | None:
        if primitive.extension("KHR_draco_mesh_compression").value:
            raise primitive.error("its mesh is compressed: export without compression of meshes")
        if primitive.parts("targets"):
            raise primitive.error("it changes its form (morph targets), and meshes are rigid here: "
                                  "export without shape keys")
        mode = primitive.whole("mode", _TRIANGLES, most=_FAN)
        attributes = primitive.part("attributes")
        if mode < _TRIANGLES or "POSITION" not in attributes:
            self._document.leave(primitive, "points and lines" if mode < _TRIANGLES
                                 else "meshes without positions")
            return None
        vertices = self._accessors.floats(attributes, "POSITION", "VEC3", whole=True)
        order = (self._accessors.indices(primitive, "indices") if "indices" in primitive
                 else np.arange(len(vertices)))
        faces = _faces(order, mode)
        if not len(faces):
            self._document.leave(primitive, "meshes without triangles")
            return None
        if faces.max() >= len(vertices):
            raise primitive.error(f"it names vertex {faces.max()} of {len(vertices)}: export the "
                                  "file again")
        normals = uv = None
        if "NORMAL" in attributes:
            normals = self._accessors.floats(attributes, "NORMAL", "VEC3")
        if (name := f"TEXCOORD_{uv_set}") in attributes:
            uv = self._accessors.floats(attributes, name, "VEC2", whole=True)
            uv = np.where(np.isfinite(uv), uv, 0)
        colors = self.colors(primitive) if shown else {}
        for array in (normals, uv, *colors.values()):
            if array is not None and len(array) != len(vertices):
                raise attributes.error(f"it has {len(vertices)} positions and {len(array)} "
                                       "normals, texture coordinates or colours: export the file "
                                       "again")
        if not np.isfinite(vertices).all():
            raise attributes.error("a position is not finite: export the file again")
        if normals is not None:
            normals = with_lengths(normals, vertices, faces)
        try:
            return Mesh(vertices, faces, normals, uv, {name: colors[name] for name in shown})
        except SceneError as error:
            raise primitive.error(str(error)) from None


def _faces(order: np.ndarray, mode: int) -> np.ndarray:
    """(m, 3) triangles, counter-clockwise from outside, of vertices in order."""
    if mode == _TRIANGLES:
        return order[:len(order) // 3 * 3].reshape(-1, 3)
    i = np.arange(max(len(order) - 2, 0))
    if mode == _FAN:
        return np.stack([order[i + 1], order[i + 2], np.broadcast_to(order[:1], i.shape)], axis=1)
    return np.stack([order[i], order[i + 1 + i % 2], order[i + 2 - i % 2]], axis=1)


def _left_handed(mesh: Mesh, tangents: np.ndarray | None) -> np.ndarray:
    """(m,) of faces, of normal maps: by the sign of the file's tangents, or else by uv."""
    if tangents is not None:
        return tangents[mesh.faces, 3].sum(1) < 0
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    outside = np.cross(b - a, c - a)
    if mesh.normals is not None:
        facing = (outside * mesh.normals[mesh.faces].sum(1)).sum(1)
        return _area(mesh) * np.where(facing < 0, -1, 1) > 0
    return _area(mesh) > 0


def _are_elsewhere(mesh: Mesh, tangents: np.ndarray) -> bool:
    """Whether the file's tangents do not go along u."""
    assert mesh.uv is not None
    area = _area(mesh)
    faces = mesh.faces[area != 0]
    a, b, c = np.moveaxis(mesh.vertices[faces], 1, 0)
    v = mesh.uv[faces, 1]
    along = ((b - a) * (v[:, 2:] - v[:, :1]) - (c - a) * (v[:, 1:2] - v[:, :1])) * np.sign(
        area[area != 0])[:, None]
    theirs = tangents[faces, :3].sum(1)
    lengths = np.linalg.norm(along, axis=1) * np.linalg.norm(theirs, axis=1)
    others = (along * theirs).sum(1) < _ALONG * lengths
    return bool(others.sum() > _OF_OTHERS * len(faces))


def _part(mesh: Mesh, faces: np.ndarray) -> Mesh:
    """Some of a mesh's faces, with the vertices they have."""
    used, numbers = np.unique(mesh.faces[faces], return_inverse=True)
    normals, uv = (None if array is None else array[used] for array in (mesh.normals, mesh.uv))
    return Mesh(mesh.vertices[used], numbers.reshape(-1, 3), normals, uv,
                attributes_of(mesh, used, faces))


def _area(mesh: Mesh) -> np.ndarray:
    """(m,) twice the areas of faces in the picture, above 0 where u, v turn with the vertices."""
    assert mesh.uv is not None
    a, b, c = np.moveaxis(mesh.uv[mesh.faces], 1, 0)
    (u1, v1), (u2, v2) = (b - a).T, (c - a).T
    return u1 * v2 - u2 * v1
