"""Colours of vertices: white ones change nothing, and others stay with their vertices."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onespp.render.gltf.gltf import load_gltf
from onespp.render.gltf.meshes import ALPHA, COLOR
from onespp.render.scene_files.loaded import Loaded
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Mesh, SceneError, Shape
from onespp.scenes.fingerprint import fingerprint
from tests.support.gltf_scenes import QUAD, QUAD_UV, Writer
from tests.support.xml_scenes import write_png

RGB = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.5, 0.5, 0.5)])
RGBA = np.c_[RGB, [0.2, 0.4, 0.6, 0.8]]


class File:
    """Quads of one material, each with attributes of its own."""

    def __init__(self, **material: Any) -> None:
        self.w = Writer()
        self.material = self.w.put("materials", {
            "pbrMetallicRoughness": {"metallicFactor": 0, **material.pop("pbr", {})}, **material})

    def quad(self, colors: Any = None, dtype: str = "float32", **attributes: int) -> File:
        w = self.w
        if colors is not None:
            attributes["COLOR_0"] = w.array(colors, dtype, normalized=dtype != "float32")
        w.node(mesh=w.mesh(w.array(QUAD), self.material, mode=4, attributes={
            "TEXCOORD_0": w.array(QUAD_UV), **attributes}, indices=w.array(
                [0, 1, 2, 0, 2, 3], "uint16")))
        return self

    def load(self, folder: Path) -> Loaded:
        return load_gltf(self.w.gltf(folder / "a.gltf"))


def mesh(shape: Shape) -> Mesh:
    assert isinstance(shape.geometry, Mesh)
    return shape.geometry


@pytest.mark.parametrize(("colors", "dtype"), [
    (RGB, "float32"), (np.round(RGB * 255), "uint8"), (np.round(RGB * 65535), "uint16"),
    (RGBA, "float32"), (np.round(RGBA * 255), "uint8"), (RGB * 2 - (RGB == 0.5) * 0.5, "float32")])
def test_all_forms_are_the_same_linear_colours_cut_to_one(colors, dtype: str, tmp_path: Path):
    shape, = File().quad(colors, dtype).load(tmp_path).scene.shapes
    assert list(mesh(shape).attributes) == [COLOR]  # opaque: alpha is of no use
    np.testing.assert_allclose(mesh(shape).attributes[COLOR], RGB, atol=0.002)


def test_white_is_as_if_there_were_none(tmp_path: Path):
    plain = File(alphaMode="BLEND").quad().load(tmp_path)
    white = File(alphaMode="BLEND").quad(np.ones((4, 4))).load(tmp_path)
    assert fingerprint(plain.scene) == fingerprint(white.scene)
    clear = File().quad(np.c_[np.ones((4, 3)), np.zeros(4)]).load(tmp_path)  # opaque
    assert mesh(clear.scene.shapes[0]).attributes == {}
    assert not plain.unused
    assert not white.unused
    other = File(alphaMode="BLEND").quad(np.ones((4, 4)) * (1, 1, 1, 0.5)).load(tmp_path)
    assert list(mesh(other.scene.shapes[0]).attributes) == [ALPHA]
    assert fingerprint(other.scene) != fingerprint(white.scene)


def test_a_material_of_meshes_with_and_without_is_several(tmp_path: Path):
    file = File().quad(RGB).quad().quad(RGB[::-1])
    a, b, c = file.load(tmp_path).scene.shapes
    assert a.material is c.material
    assert a.material is not b.material
    assert "mesh_attribute" in str(a.material)
    assert "mesh_attribute" not in str(b.material)


def test_second_colours_are_told_once(tmp_path: Path):
    file = File()
    other = file.w.array(RGB)
    assert file.quad(RGB, COLOR_1=other).quad(RGB, COLOR_1=other).load(tmp_path).unused == (
        "second colours of vertices (meshes[0].primitives[0].attributes)")


def test_alpha_of_what_glows_is_told(tmp_path: Path):
    file = File(alphaMode="MASK", emissiveFactor=[1, 1, 1]).quad(RGBA)
    assert file.load(tmp_path).unused == "alpha of vertices in emission (materials[0])"


def test_a_number_of_colours_that_is_not_that_of_positions_is_refused(tmp_path: Path):
    with pytest.raises(SceneError, match=r"4 positions and 3 normals, texture coordinates or col"):
        File().quad(RGB[:3]).load(tmp_path)
    with pytest.raises(SceneError, match="its type is 'VEC2': COLOR_0 is VEC3 or VEC4"):
        File().quad(RGB[:, :2]).load(tmp_path)
    file = File()
    file.quad(COLOR_0=file.w.array(RGB * 255, "uint8"))
    with pytest.raises(SceneError, match="whole numbers that are not normalised"):
        file.load(tmp_path)


def test_parts_of_a_mesh_keep_the_colours_of_their_vertices(tmp_path: Path):
    """A mesh whose normal map lies both ways is two."""
    write_png(tmp_path / "n.png", np.full((2, 2, 3), (0.5, 0.5, 1.0)))
    file = File(normalTexture={"index": 0})
    w = file.w
    w.put("textures", {"source": w.put("images", {"uri": "n.png"})})
    positions = np.concatenate([QUAD, QUAD + np.array((3, 0, 0))]).astype(np.float32)
    colors = np.random.default_rng(0).random((8, 3))
    w.node(mesh=w.mesh(w.array(positions), file.material, attributes={
        "TEXCOORD_0": w.array(np.concatenate([QUAD_UV, QUAD_UV * (-1, 1)])),
        "COLOR_0": w.array(colors)}, indices=w.array(
            [0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7], "uint8")))
    shapes = file.load(tmp_path).scene.shapes
    assert len(shapes) == 2
    of = {tuple(place): color for place, color in zip(positions.tolist(), colors)}
    for shape in shapes:
        part = mesh(shape)
        assert len(part.vertices) == 4
        np.testing.assert_allclose(part.attributes[COLOR], [
            of[tuple(place)] for place in part.vertices.tolist()], atol=1e-6)


def test_holes_end_where_alpha_times_the_texture_falls_below_the_cutoff(tmp_path: Path):
    leaf = np.ones((1, 2, 4))
    leaf[0, 1, 3] = 0.25
    write_png(tmp_path / "leaf.png", leaf)
    file = File(alphaMode="MASK", alphaCutoff=0.3, pbr={"baseColorTexture": {"index": 0}})
    file.w.put("textures", {"source": file.w.put("images", {"uri": "leaf.png"})})
    alpha = np.array([0.0, 1, 1, 0])  # u
    scene = file.quad(np.c_[np.ones((4, 3)), alpha]).load(tmp_path).scene
    row = Renderer(scene, 33, 256).frame(0, 0, ("id", "position"))
    seen, x = row["id"][16] == 0, row["position"][16, :, 0]
    u = (x[seen] + 1) / 2
    assert 0.3 <= u.min() < 0.36  # a pixel's width
    assert 0.44 < u.max() < 0.5
    assert np.diff(u).max() < 0.06


def test_a_base_colour_of_nothing_stays_black(tmp_path: Path):
    scene = File(pbr={"baseColorFactor": [0, 0, 0, 1]}).quad(RGB).load(tmp_path).scene
    frame = Renderer(scene, 12, 16).frame(0, 0, ("albedo", "id"))
    np.testing.assert_array_equal(frame["albedo"][frame["id"] == 0], 0)
