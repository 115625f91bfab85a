"""Boxes: which meshes are some, and what they are as slabs."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from onespp.scenes.description import Cylinder, Disk, Mesh, Rectangle, Sphere

_FACES = 12  # triangles of six sides, without corners in between
_SAME = 1e-5  # distance of places that are one, as a share of a mesh's size
_NONE = 1e-9  # volume, as a share of that of a box of such edges
_FLAT = 1e-3  # of a shading normal from that of its face, at most


def half_edges(geometry: Sphere | Rectangle | Disk | Cylinder | Mesh) -> np.ndarray | None:
    """(4, 3) centre and half edges of a box in object space, whatever its angles are; None of what
    is none, or not shaded flat."""
    if not isinstance(geometry, Mesh) or len(geometry.faces) != _FACES:
        return None
    vertices = geometry.vertices
    size = float(np.ptp(vertices, axis=0).max())
    if not size > 0:
        return None
    used = vertices[np.unique(geometry.faces)]
    _, first = np.unique(np.round(used / (_SAME * size)), axis=0, return_index=True)
    if len(first) != 8:
        return None
    corners = used[first]
    centre = corners.mean(0)
    arms = corners - centre
    signs = np.array([(x, y, z) for x in (1, -1) for y in (1, -1) for z in (1, -1)])
    for three in combinations(range(1, 8), 3):
        edges = (arms[0] - arms[list(three)]) / 2
        ours = signs @ edges
        apart = np.linalg.norm(ours[:, None] - arms[None], axis=-1)
        if apart.min(1).max() < 4 * _SAME * size and abs(np.linalg.det(edges)) > 0:
            box = np.vstack([centre, edges])
            return box if _is_all_of(geometry, box) else None
    return None


def _is_all_of(mesh: Mesh, box: np.ndarray) -> bool:
    """Whether a mesh has the six faces of a box, nothing else, and their normals."""
    places = (mesh.vertices[mesh.faces] - box[0]) @ np.linalg.inv(box[1:])
    side = np.where(np.ptp(places, axis=1) < 1e-3, np.round(places.mean(1)), 0)  # (m, 3)
    if not (np.abs(side).sum(1) == 1).all() or len(np.unique(side, axis=0)) != 6:
        return False
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    whole = 8 * sum(np.linalg.norm(np.cross(*pair)) for pair in combinations(box[1:], 2))
    if not (area > 0).all() or abs(area.sum() / 2 - whole) > 1e-3 * whole:
        return False
    if mesh.normals is None:
        return True
    shading = mesh.normals[mesh.faces] / np.linalg.norm(mesh.normals[mesh.faces], axis=-1,
                                                         keepdims=True)
    return bool(np.abs(shading - (normal / area[:, None])[:, None]).max() < _FLAT)


def slab_words(boxes: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """(n, 17) float32: of boxes (n, 4, 3), centre and half edges, the centre; the rows that take an
    offset from there to shares of the half edges, those of the thinnest side first; and its
    normal, its thickness, and the index of refraction. All are 0 of what has no volume."""
    words = np.zeros((len(boxes), 17), np.float32)
    for i, (centre, *edges) in enumerate(boxes):
        volume = abs(np.linalg.det(edges))
        if not volume > _NONE * np.prod(np.linalg.norm(edges, axis=1)):
            continue
        inverse = np.linalg.inv(np.array(edges).T)
        thin = np.argsort(-np.linalg.norm(inverse, axis=1), kind="stable")
        rows = inverse[thin]
        length = np.linalg.norm(rows[0])
        words[i] = *centre, *rows.ravel(), *(rows[0] / length), 2 / length, indices[i]
    return words
