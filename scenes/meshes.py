"""Triangle meshes made in code, in object space, y up, counter-clockwise seen from outside.

All have unit normals and uv in [0, 1]^2; they are centred at the origin unless they say
otherwise. `merge` makes one object (one material, one ID) of several.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .description import Mesh, SceneError
from .transforms import Matrix, Vector, scale


def box(size: Vector) -> Mesh:
    """A box with sharp edges; `size` is its full (x, y, z) extent.

    On each face u runs along the longer edge and uv is in units of the longest edge of all, so
    that a texture is neither stretched nor out of range.
    """
    half = _extent(size) / 2
    return merge(*(_cube_face(axis, sign, half, np.zeros(3), [np.array([-h, h]) for h in half])
                   for axis in range(3) for sign in (-1, 1)))


def rounded_box(size: Vector, radius: float, segments: int = 4) -> Mesh:
    """A box whose edges and corners are round; `radius` at most half the shortest edge.

    Smooth normals; uv as for `box`. `segments` is the number of strips across a quarter turn,
    rounded up to an even number.
    """
    half = _extent(size) / 2
    if not 0 < radius <= half.min() * (1 + 1e-9):
        raise SceneError(f"a rounded box of size {tuple(size)} has radius {radius}: "
                         f"use more than 0 and at most {half.min():g}")
    strip = radius * np.tan(np.linspace(0, np.pi / 4, (segments + 1) // 2 + 1))
    coordinates = []
    for h in half:
        outer = np.unique(np.round(h - radius + strip, 12))  # a sphere's two halves share a vertex
        coordinates.append(np.unique(np.round(np.concatenate([-outer, outer]), 12)))
    return merge(*(_cube_face(axis, sign, half, np.full(3, radius), coordinates)
                   for axis in range(3) for sign in (-1, 1)))


def lathe(profile: Sequence[Sequence[float]] | np.ndarray, segments: int = 48) -> Mesh:
    """A surface of revolution about the y axis.

    profile: (k, 2) points (radius, y), in the order that has the outside on its right when
    radius is to the right and y up: upward on the outside of a vase, downward on its inside.
    A point given twice in a row is a crease; a profile that ends where it starts is closed.
    u runs round, v along the profile.
    """
    points = np.asarray(profile, float)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or (points[:, 0] < 0).any():
        raise SceneError("a lathe's profile needs two or more (radius, y) points, "
                         "no radius below 0")
    outward = _profile_normals(points)
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    angle[-1] = 0  # the seam is closed to the last bit
    around = np.stack([np.cos(angle), np.zeros(segments + 1), -np.sin(angle)], axis=1)
    up = np.array([0, 1, 0])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    u, v = np.meshgrid(np.linspace(0, 1, segments + 1), length / length[-1])
    mesh = _grid(points[:, None, :1] * around + points[:, None, 1:] * up,
                 outward[:, None, :1] * around + outward[:, None, 1:] * up, u, v)
    return _without_slivers(mesh)


def ellipsoid(radii: Vector, segments: int = 32) -> Mesh:
    """An ellipsoid with semi-axes `radii`; the way to a sphere that is not scaled uniformly."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
    profile = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    profile[[0, -1], 0] = 0
    return place(lathe(profile, segments), scale(_extent(radii)))


def torus(radius: float, thickness: float, segments: int = 48) -> Mesh:
    """A ring about the y axis; `thickness` is the radius of its tube."""
    angle = np.linspace(0, 2 * np.pi, max(segments // 3, 8) + 1)
    profile = np.stack([radius + thickness * np.cos(angle), thickness * np.sin(angle)], axis=1)
    profile[-1] = profile[0]
    return lathe(profile, segments)


def surface(points: np.ndarray) -> Mesh:
    """An open, smooth surface through a grid of points: cloth, curtains, leaves.

    points: (rows, columns, 3), at least 2 x 2; u runs along columns, v along rows, and the
    outside is where d/du x d/dv points.
    """
    points = np.asarray(points, float)
    if points.ndim != 3 or points.shape[2] != 3 or min(points.shape[:2]) < 2:
        raise SceneError(f"a surface has points of shape {points.shape}: "
                         "use (rows, columns, 3), at least 2 x 2")
    rows, columns = points.shape[:2]
    normals = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    return _grid(points, normals, u, v)


def place(mesh: Mesh, matrix: Matrix) -> Mesh:
    """The mesh after a transform, mirrored ones included."""
    linear = np.asarray(matrix)[:3, :3]
    normals = mesh.normals
    if normals is not None:
        normals = normals @ np.linalg.inv(linear)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    faces = mesh.faces[:, ::-1] if np.linalg.det(linear) < 0 else mesh.faces
    return replace(mesh, vertices=mesh.vertices @ linear.T + np.asarray(matrix)[:3, 3], faces=faces,
                   normals=normals)


def merge(*meshes: Mesh) -> Mesh:
    """One mesh of several.

    Raises:
        SceneError: nothing to merge, or only some of them have normals, uv or an attribute.
    """
    if not meshes:
        raise SceneError("there are no meshes to merge")
    parts: dict[str, Any] = {}
    for name in ("normals", "uv"):
        arrays = [getattr(mesh, name) for mesh in meshes]
        given = [array for array in arrays if array is not None]
        if given and len(given) < len(arrays):
            raise SceneError(f"meshes to merge must all have {name}, or none of them")
        parts[name] = np.concatenate(given) if given else None
    widths = [{name: a.shape[1] for name, a in mesh.attributes.items()} for mesh in meshes]
    if any(width != widths[0] for width in widths):
        raise SceneError("meshes to merge must all have the same attributes")
    parts["attributes"] = {name: np.concatenate([mesh.attributes[name] for mesh in meshes])
                           for name in meshes[0].attributes}
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    faces = np.concatenate([mesh.faces.astype(np.int64) + start
                            for mesh, start in zip(meshes, starts)])
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), faces, **parts)


def paint(mesh: Mesh, u: float, v: float = 0.5) -> Mesh:
    """The mesh with one uv throughout: the colour of `materials.palette` that is there."""
    return replace(mesh, uv=np.tile([u, v], (len(mesh.vertices), 1)))


def box_mapped(mesh: Mesh) -> Mesh:
    """The mesh with the uv of a box around it: seen along the axis that a face faces most.

    uv is in units of the longest edge of all, as `box` has it. A vertex between faces of different
    axes becomes several.
    """
    vertices = mesh.vertices
    a, b, c = (vertices[mesh.faces[:, i]] for i in range(3))
    axis = np.abs(np.cross(b - a, c - a)).argmax(axis=1)  # of each face
    corners = 3 * mesh.faces.astype(np.int64) + axis[:, None]
    kept, faces = np.unique(corners, return_inverse=True)
    of, seen_along = kept // 3, kept % 3
    low = vertices[of].min(axis=0)
    longest = float((vertices[of].max(axis=0) - low).max()) or 1.0
    inside = (vertices[of] - low) / longest
    uv = np.take_along_axis(inside, np.array([(2, 1), (0, 2), (0, 1)])[seen_along], axis=1)
    return Mesh(vertices[of], faces.reshape(-1, 3), None if mesh.normals is None
                else mesh.normals[of], uv, attributes_of(mesh, of))


def attributes_of(mesh: Mesh, vertices: Any = slice(None), faces: Any = slice(None),
                  ) -> dict[str, np.ndarray]:
    """The attributes of a mesh's vertices and faces, or of some, by number or mask."""
    return {name: values[faces if name.startswith("face_") else vertices]
            for name, values in mesh.attributes.items()}


def _extent(size: Vector) -> np.ndarray:
    extent = np.asarray(size, float)
    if extent.shape != (3,) or not (extent > 0).all():
        raise SceneError(f"a mesh has size {size!r}: use three positive numbers")
    return extent


def _cube_face(axis: int, sign: int, half: np.ndarray, radius: np.ndarray,
               coordinates: list[np.ndarray]) -> Mesh:
    """One face of a (rounded) box: points of the cube, pulled onto the round edges."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    if sign < 0:  # keeps d/du x d/dv outward
        a, b = b, a
    grid_b, grid_a = np.meshgrid(coordinates[b], coordinates[a], indexing="ij")
    points = np.empty((*grid_a.shape, 3))
    points[..., axis], points[..., a], points[..., b] = sign * half[axis], grid_a, grid_b
    inner = np.clip(points, radius - half, half - radius)
    normals = points - inner
    if not radius.any():
        normals[..., axis] = sign
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    uv = [(grid + half[i]) / (2 * half.max()) for grid, i in ((grid_a, a), (grid_b, b))]
    if half[b] > half[a]:
        uv.reverse()
    return _grid(inner + radius * normals, normals, *uv)


def _grid(points: np.ndarray, normals: np.ndarray, u: np.ndarray, v: np.ndarray) -> Mesh:
    """A mesh of (rows, columns, ...) vertices, outside where d/dcolumn x d/drow points."""
    rows, columns = points.shape[:2]
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, above = corner + 1, corner + columns
    faces = np.concatenate([np.stack([corner, right, above + 1], axis=1),
                            np.stack([corner, above + 1, above], axis=1)])
    normals = normals.reshape(-1, 3)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(points.reshape(-1, 3), faces, normals, np.stack([u.ravel(), v.ravel()], axis=1))


def _without_slivers(mesh: Mesh) -> Mesh:
    """The mesh without triangles that have no area (at a pole or a crease)."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    kept = area > 1e-12 * area.max()
    return replace(mesh, faces=mesh.faces[kept], attributes=attributes_of(mesh, faces=kept))


def _profile_normals(points: np.ndarray) -> np.ndarray:
    """(k, 2) unit normals on the right of a profile, averaged except at creases."""
    edges = np.diff(points, axis=0)
    length = np.linalg.norm(edges, axis=1, keepdims=True)
    right = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / np.maximum(length, 1e-300)
    before, after = np.vstack([right[:1] * 0, right]), np.vstack([right, right[:1] * 0])
    if np.array_equal(points[0], points[-1]):
        before[0], after[-1] = right[-1], right[0]
    normals = before + after
    on_axis = points[:, 0] == 0  # a pole, smooth unless the profile creases there
    normals[on_axis, 0] *= abs(normals[on_axis, 0]) > abs(normals[on_axis, 1])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
