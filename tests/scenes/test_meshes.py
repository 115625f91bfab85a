"""Laws of the meshes made in code."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from onespp.scenes.description import Mesh, SceneError
from onespp.scenes.meshes import (
    box,
    box_mapped,
    ellipsoid,
    lathe,
    merge,
    paint,
    place,
    rounded_box,
    surface,
    torus,
)
from onespp.scenes.transforms import rotate, scale, translate

VASE = [(0, 0), (1, 0), (1, 0), (1.5, 1), (0.7, 2), (0.7, 2), (0.6, 2), (0.6, 2),
        (1.3, 1), (0, 0.2)]
CLOSED = {
    "box": (box((1, 2, 3)), 6.0),
    "rounded_box": (rounded_box((1, 2, 3), 0.2, 8), None),
    "rounded_box_as_sphere": (rounded_box((2, 2, 2), 1, 16), 4 / 3 * np.pi),
    "lathe": (lathe(VASE), None),
    "ellipsoid": (ellipsoid((1, 2, 3), 64), 8 * np.pi),
    "torus": (torus(2, 0.5, 96), 2 * np.pi**2 * 2 * 0.25),
    "merged": (merge(box((1, 1, 1)), place(box((1, 1, 1)), translate((5, 0, 0)))), 2.0),
    "mirrored": (place(box((1, 2, 3)), scale((-1, 1, 2)) @ rotate((1, 2, 3), 40)), 12.0),
}
closed = pytest.mark.parametrize("name", CLOSED)


def corners(mesh: Mesh) -> np.ndarray:
    """(m, 3, 3): triangle, corner, coordinate."""
    return mesh.vertices[mesh.faces]


def volume(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    return float(np.einsum("ij,ij", a, np.cross(b, c))) / 6


@closed
def test_closed_mesh_has_every_edge_twice_in_opposite_directions(name):
    mesh, _ = CLOSED[name]
    _, welded = np.unique(np.round(mesh.vertices, 9), axis=0, return_inverse=True)
    faces = welded.reshape(-1)[mesh.faces]
    edges = Counter((a, b) for face in faces for a, b in zip(face, np.roll(face, -1)))
    assert all(count == 1 and edges[b, a] == 1 for (a, b), count in edges.items())


@closed
def test_closed_mesh_faces_outward_with_the_right_volume(name):
    mesh, expected = CLOSED[name]
    assert volume(mesh) > 0
    if expected is not None:
        assert volume(mesh) == pytest.approx(expected, rel=0.03)


@closed
def test_normals_are_unit_and_agree_with_the_faces(name):
    mesh, _ = CLOSED[name]
    assert mesh.normals is not None
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-9)
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    face_normal = np.cross(b - a, c - a)
    face_normal /= np.linalg.norm(face_normal, axis=1, keepdims=True)
    agreement = np.einsum("ijk,ik->ij", mesh.normals[mesh.faces], face_normal)
    assert agreement.min() > 0.5


@closed
def test_uv_is_in_the_unit_square(name):
    mesh, _ = CLOSED[name]
    assert mesh.uv is not None
    assert mesh.uv.min() >= 0
    assert mesh.uv.max() <= 1


def test_rounded_box_lies_at_its_radius_from_the_inner_box():
    mesh = rounded_box((1, 2, 3), 0.2, 6)
    inner = np.clip(mesh.vertices, np.array((-0.3, -0.8, -1.3)), np.array((0.3, 0.8, 1.3)))
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices - inner, axis=1), 0.2, atol=1e-9)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), (1, 2, 3), atol=1e-9)


def test_ellipsoid_normals_are_those_of_its_quadric():
    radii = np.array((1, 2, 3))
    mesh = ellipsoid(radii)
    np.testing.assert_allclose(((mesh.vertices / radii) ** 2).sum(axis=1), 1, atol=1e-9)
    gradient = mesh.vertices / radii**2
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals, gradient, atol=0.02)


def test_lathe_is_sharp_at_a_repeated_point_only():
    can = lathe([(0, 0), (1, 0), (1, 0), (1, 2), (1, 2), (0, 2)])
    assert can.normals is not None
    flat = np.abs(can.normals[:, 1])
    assert set(np.round(flat, 9)) == {0.0, 1.0}
    round_rim = lathe([(0, 0), (1, 0), (1, 2)])
    assert round_rim.normals is not None
    assert np.isclose(np.abs(round_rim.normals[:, 1]), 0.5**0.5).any()


def test_surface_of_a_tilted_plane_has_its_normal_and_faces_it():
    u, v = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 2, 3))
    mesh = surface(np.stack([u, v, u + v], axis=2))
    normal = np.array((-1, -1, 1)) / 3**0.5
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals, np.tile(normal, (12, 1)), atol=1e-12)
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    assert (np.cross(b - a, c - a) @ normal > 0).all()


def test_paint_moves_all_uv_to_one_place_and_nothing_else():
    mesh = box((1, 1, 1))
    painted = paint(mesh, 0.3, 0.7)
    assert painted.uv is not None
    assert np.array_equal(np.unique(painted.uv, axis=0), [[0.3, 0.7]])
    assert np.array_equal(painted.vertices, mesh.vertices)


def colored(mesh: Mesh) -> Mesh:
    """By place, and faces by the place of their middle."""
    return replace(mesh, attributes={"vertex_color": mesh.vertices,
                                     "face_color": corners(mesh).mean(1)})


@pytest.mark.parametrize("made", [
    place(colored(box((1, 2, 3))), scale((-1, -1, -1))), paint(colored(box((1, 2, 3))), 0.5),
    box_mapped(colored(ellipsoid((1, 2, 3), 8))),
    merge(colored(box((1, 2, 3))), colored(ellipsoid((1, 1, 1), 8)))], ids=[
        "mirrored", "painted", "box-mapped", "merged"])
def test_attributes_stay_with_their_vertices_and_faces(made):
    mirror = -1 if np.isclose(made.vertices, -made.attributes["vertex_color"]).all() else 1
    np.testing.assert_allclose(made.attributes["vertex_color"], mirror * made.vertices)
    np.testing.assert_allclose(made.attributes["face_color"], mirror * corners(made).mean(1))


@pytest.mark.parametrize(("make", "words"), [
    (lambda: box((1, 0, 1)), "three positive numbers"),
    (lambda: rounded_box((1, 1, 1), 0.6), "at most 0.5"),
    (lambda: lathe([(1, 0)]), "two or more"),
    (lambda: lathe([(1, 0), (-1, 1)]), "below 0"),
    (lambda: surface(np.zeros((1, 5, 3))), "at least 2 x 2"),
    (lambda: merge(), "no meshes"),
    (lambda: merge(box((1, 1, 1)), colored(box((1, 1, 1)))), "the same attributes"),
    (lambda: merge(box((1, 1, 1)), Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))), "none of them"),
])
def test_impossible_mesh_is_refused_in_one_sentence(make, words):
    with pytest.raises(SceneError, match=words):
        make()


def test_a_mesh_keeps_its_vertices_when_the_array_they_came_in_changes():
    vertices = np.eye(3)
    mesh = Mesh(vertices, np.array([[0, 1, 2]]))
    vertices += 5
    np.testing.assert_array_equal(mesh.vertices, np.eye(3))


def test_complex_vertices_are_refused():
    with pytest.raises(SceneError, match="mesh vertices are not real numbers"):
        Mesh(np.eye(3) + 1j, np.array([[0, 1, 2]]))


def test_a_box_around_a_mesh_gives_it_uv_that_are_not_stretched():
    bare = ellipsoid((1, 2, 0.5), 16)
    mapped = box_mapped(Mesh(bare.vertices, bare.faces, bare.normals))
    assert mapped.uv is not None
    assert mapped.normals is not None
    assert 0 <= mapped.uv.min() < 0.1 < 0.9 < mapped.uv.max() <= 1
    corners = bare.vertices[bare.faces], mapped.vertices[mapped.faces]
    assert np.array_equal(*corners)
    assert np.array_equal(bare.normals[bare.faces], mapped.normals[mapped.faces])
    edges = np.diff(corners[0], axis=1)
    flat = np.abs(np.cross(edges[:, 0], edges[:, 1])).argmax(axis=1)  # the axis that is left out
    seen = np.linalg.norm(np.where(np.arange(3) == flat[:, None, None], 0, edges), axis=2)
    assert np.allclose(np.linalg.norm(np.diff(mapped.uv[mapped.faces], axis=1), axis=2), seen / 4)
