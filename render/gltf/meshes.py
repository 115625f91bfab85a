"""Primitives of a file's meshes as triangles: lists, strips and fans, with indices or without."""

from __future__ import annotations

import numpy as np

from onespp.render.scene_files.geometry import with_lengths
from onespp.scenes.description import Mesh, SceneError

from .accessors import Accessors
from .document import Document
from .item import Item

_TRIANGLES, _STRIP, _FAN = 4, 5, 6


class Meshes:
    """Meshes in object space, each read once."""

    def __init__(self, document: Document, accessors: Accessors) -> None:
        self._document, self._accessors = document, accessors
        self._made: dict[tuple[str, int], Mesh | None] = {}

    def mesh(self, primitive: Item, uv_set: int) -> Mesh | None:
        """The triangles of a primitive, None where it has none.

        Args:
            uv_set: which of its texture coordinates, from 0; there may be none.

        Raises:
            SceneError: a form that cannot be rendered here, or damaged.
        """
        key = (primitive.path, uv_set)
        if key not in self._made:
            self._made[key] = self._read(primitive, uv_set)
        return self._made[key]

    def _read(self, primitive: Item, uv_set: int) -> Mesh | None:
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
        if "COLOR_0" in attributes:
            self._document.leave(primitive, "colours of vertices")
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
        for array in (normals, uv):
            if array is not None and len(array) != len(vertices):
                raise attributes.error(f"it has {len(vertices)} positions and {len(array)} normals "
                                       "or texture coordinates: export the file again")
        if not np.isfinite(vertices).all():
            raise attributes.error("a position is not finite: export the file again")
        if normals is not None:
            normals = with_lengths(normals, vertices, faces)
        try:
            return Mesh(vertices, faces, normals, uv)
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
