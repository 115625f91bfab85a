"""Bumps of normal maps point where the picture says, however it lies on the surface."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import onespp
from onespp.render.gltf.gltf import load_gltf
from onespp.scenes.transforms import rotate, scale, translate
from tests.support.gltf_scenes import QUAD, QUAD_UV, Writer
from tests.support.xml_scenes import write_png

BUMP = np.array([0.48, 0.36, 0.8])  # to the right of the picture, and up
TURN = rotate((0, 0, 1), 25)
UPRIGHT = QUAD_UV * (1, -1) + (0, 1)
LAID = {  # uv of the corners
    "upright": UPRIGHT, "mirrored": UPRIGHT * (-1, 1) + (1, 0), "v up": QUAD_UV,
    "upside down": 1 - UPRIGHT, "on its side": UPRIGHT[[1, 2, 3, 0]],
    "on its side, mirrored": UPRIGHT[[1, 0, 3, 2]]}


def bumpy(w: Writer, folder: Path, **transform) -> int:
    """A grey material whose every point leans as BUMP says."""
    if "textures" not in w.json:
        write_png(folder / "bumps.png", np.broadcast_to(BUMP / 2 + 0.5, (4, 4, 3)))
        w.put("textures", {"source": w.put("images", {"uri": "bumps.png"})})
    return w.grey(normalTexture={"index": 0, "extensions": {
        "KHR_texture_transform": transform} if transform else {}})


def quad(w: Writer, material: int, uv: np.ndarray, **attributes) -> int:
    return w.mesh(w.array(QUAD), material, indices=w.array([0, 1, 2, 0, 2, 3], "uint16"),
                  attributes={"TEXCOORD_0": w.array(uv), **attributes})


def normals(path: Path) -> dict[str, np.ndarray]:
    """Name -> mean normal that its pixels show."""
    scene = load_gltf(path).scene
    frame = onespp.render(scene, path.parent / "out", frames=1, size=(48, 72)).read_frame(0)
    return {name: frame["normal"][frame["id"] == i].mean(0)
            for i, name in enumerate(scene.object_names)}


def expected(uv: np.ndarray, place: np.ndarray) -> np.ndarray:
    """By which way u and v go on a quad that faces +z, v down."""
    corners = QUAD[[1, 3]] - QUAD[0]
    ways = np.linalg.inv(np.stack([uv[1] - uv[0], uv[3] - uv[0]])) @ corners @ place[:3, :3].T
    t, d = (way / np.linalg.norm(way) for way in ways)
    return BUMP[0] * t - BUMP[1] * d + BUMP[2] * np.array([0, 0, 1])


@pytest.mark.parametrize("mirror", [1, -1])
@pytest.mark.parametrize("smooth", [False, True])
def test_bumps_point_where_the_picture_has_them(tmp_path, mirror, smooth):
    w = Writer()
    material, places = bumpy(w, tmp_path), {}
    more = {"NORMAL": w.array(QUAD * 0 + (0, 0, 1))} if smooth else {}
    for k, (name, uv) in enumerate(LAID.items()):
        places[name] = (translate((2.5 * (k % 3), 2.5 * (k // 3), 0)) @ TURN
                        @ scale((mirror, 1, 1)))
        w.placed(places[name], name=name, mesh=quad(w, material, uv, **more))
    found = normals(w.gltf(tmp_path / "a.gltf"))
    assert set(found) == set(LAID)
    for name, uv in LAID.items():
        np.testing.assert_allclose(found[name], expected(uv, places[name]), atol=0.02)


def test_a_picture_that_is_turned_on_its_surface_turns_its_bumps(tmp_path):
    w, c, s = Writer(), np.cos(0.6), np.sin(0.6)
    cases = {"turned": ({"rotation": 0.6}, [[c, s], [-s, c]]),
             "flipped": ({"scale": [1, -1]}, [[1, 0], [0, -1]]),
             "mirrored": ({"scale": [-2, 1]}, [[-2, 0], [0, 1]]),
             "flat": ({"scale": [0, 1]}, np.eye(2))}  # which way is nobody's to say
    for k, (name, (transform, _)) in enumerate(cases.items()):
        w.placed(translate((2.5 * k, 0, 0)), name=name,
                 mesh=quad(w, bumpy(w, tmp_path, **transform), UPRIGHT))
    found = normals(w.gltf(tmp_path / "a.gltf"))
    for name, (_, matrix) in cases.items():
        np.testing.assert_allclose(
            found[name], expected(UPRIGHT @ np.array(matrix).T, np.eye(4)), atol=0.02)


def test_a_mesh_of_both_sides_is_two_shapes_that_move_as_one(tmp_path):
    w = Writer()
    step = np.array([1, 0, 0])
    both = w.mesh(w.array(np.concatenate([QUAD - step, QUAD + step])), bumpy(w, tmp_path),
                  indices=w.array([4, 5, 6, 4, 6, 7, 0, 1, 2, 0, 2, 3], "uint16"), attributes={
                      "TEXCOORD_0": w.array(np.concatenate([LAID["mirrored"], UPRIGHT]))})
    node = w.node(mesh=both, name="face", scale=[1.0, 1, 1])
    w.channel(node, "translation", [0, 1], [(0, 0, 0), (1, 0, 0)], "LINEAR")
    path = w.gltf(tmp_path / "a.gltf")
    scene = load_gltf(path).scene
    assert scene.object_names == ("face", "face mirrored")
    whole, mirrored = scene.shapes
    assert (len(whole.geometry.faces), len(whole.geometry.vertices)) == (2, 4)
    np.testing.assert_array_equal(whole.geometry.vertices[:, 0].min(), 0)
    np.testing.assert_array_equal(mirrored.geometry.vertices[:, 0].max(), 0)
    np.testing.assert_array_equal(whole.world_from_object_at(7), mirrored.world_from_object_at(7))
    for normal in normals(path).values():
        np.testing.assert_allclose(normal[1:], BUMP[1:], atol=0.02)


@pytest.mark.parametrize(("tangent", "side", "told"), [
    ((1, 0, 0, 1), 1, False), ((1, 0, 0, -1), -1, False), ((0, 1, 0, 1), 1, True)])
def test_tangents_say_the_side_and_are_told_where_they_go_elsewhere(tmp_path, tangent, side, told):
    w = Writer()
    w.placed(np.eye(4), name="quad", mesh=quad(
        w, bumpy(w, tmp_path), UPRIGHT, TANGENT=w.array([tangent] * 4)))
    path = w.gltf(tmp_path / "a.gltf")
    found, = normals(path).values()
    np.testing.assert_allclose(found, BUMP * (1, side, 1), atol=0.02)
    assert ("tangents that do not go along u (meshes[0].primitives[0].attributes)"
            in load_gltf(path).unused) == told
