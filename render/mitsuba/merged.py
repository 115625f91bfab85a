"""Still meshes of one material built as one, where a scene has very many shapes.

Dr.Jit records a kernel's calls for each shape anew in every frame, so that hundreds of shapes cost
seconds before anything is traced; Mitsuba merges meshes for the same reason. What is merged keeps
its object IDs: they are looked up by the number of the face that a ray hit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from onespp.scenes.description import Mesh, Scene, Shape

MANY = 64  # still meshes; with fewer, each is built by itself


def groups(scene: Scene) -> list[list[Shape]]:
    """Shapes to be built as one, in the order of their names; none where the scene has few."""
    still = [shape for shape in scene.shapes if isinstance(shape.geometry, Mesh)
             and not shape.moves and shape.emission is None]
    if len(still) <= MANY:
        return []
    found: dict[Any, list[Shape]] = {}
    for shape in still:
        mesh = shape.geometry
        assert isinstance(mesh, Mesh)
        widths = tuple((name, data.shape[1]) for name, data in mesh.attributes.items())
        found.setdefault((id(shape.material), mesh.normals is None, mesh.uv is None, widths),
                         []).append(shape)
    return [group for group in found.values() if len(group) > 1]


def joined(parts: Sequence[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Buffers of several meshes as those of one: (n, 3) positions and normals, (n, 2) uv, (m, 3)
    faces, (n or m, k) attributes."""
    starts = np.cumsum([0] + [len(part["vertex_positions"]) for part in parts[:-1]])
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    whole["faces"] = np.concatenate([part["faces"] + np.uint32(start)
                                     for part, start in zip(parts, starts)])
    return whole
