"""Scenes of glTF files look as the same scenes of Mitsuba's, or are refused in a sentence."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest

import onespp
from onespp.render.errors import InputError
from onespp.render.gltf.gltf import load_gltf
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi
from onespp.scenes.description import SceneError
from tests.support import brightness
from tests.support.gltf_scenes import EYE, QUAD, SCENES, Made, Writer, lit, moving, painted

FILES = SCENES | {"painted": painted}
SPP = {"moving": 64, "pictured": 128, "lit": 64, "painted": 64}


@pytest.fixture(scope="module", params=list(FILES))
def made(request, tmp_path_factory) -> tuple[str, Made]:
    return request.param, FILES[request.param](tmp_path_factory.mktemp(request.param))


@pytest.mark.parametrize("made", [
    "moving", "lit", "painted", pytest.param("pictured", marks=pytest.mark.slow)], indirect=True)
def test_a_scene_is_as_bright_as_mitsubas(made):
    name, (path, frame, theirs) = made
    brightness.assert_as_bright(*brightness.means(
        mi.load_dict(theirs), load_gltf(path).scene, SPP[name], frame))


def test_surfaces_are_where_mitsubas_are_and_scatter_as_they_do(made):
    name, (path, frame, theirs) = made
    stage = MitsubaScene(load_gltf(path).scene)
    stage.set_frame(frame)
    assert stage.appearance  # metal from a texture too: it is asked of every material
    grid = np.stack(np.meshgrid(np.linspace(-0.6, 0.6, 13), np.linspace(-0.4, 0.3, 8)), -1)
    rays = np.concatenate([grid.reshape(-1, 2), -np.ones((104, 1))], 1) @ EYE[:3, :3].T

    def hits(scene, origin) -> tuple[np.ndarray, ...]:
        eye = mi.Point3f(*map(float, EYE[:3, 3] - origin))
        si = scene.ray_intersect(mi.Ray3f(eye, mi.Vector3f(rays.T.astype(np.float32))))
        bsdf, context = si.bsdf(), mi.BSDFContext()
        light = si.to_local(mi.Vector3f(0.3, 0.8, 0.52))
        return (np.array(si.t), np.array(si.sh_frame.n).T, np.array(si.uv).T, np.concatenate([
            bsdf.eval(context, si, light, si.is_valid()),
            bsdf.eval_null_transmission(si, si.is_valid())]).T)

    t, n, uv, scattered = hits(mi.load_dict(theirs), np.zeros(3))
    ours = hits(stage.mi_scene, stage.origin)
    seen = np.isfinite(t)
    assert seen.sum() > 50
    np.testing.assert_array_equal(np.isfinite(ours[0]), seen)
    np.testing.assert_allclose(ours[0][seen], t[seen], rtol=1e-4)
    np.testing.assert_allclose(ours[1][seen], n[seen], atol=2e-2 if name == "lit" else 1e-3)
    if name == "pictured":
        np.testing.assert_allclose(ours[2][seen], uv[seen], atol=1e-3)
    if name != "lit":  # whose normals are of seven bits
        np.testing.assert_allclose(ours[3][seen], scattered[seen], atol=1e-3, rtol=1e-2)


def test_keys_are_met_and_what_does_not_change_stands_still(tmp_path):
    scene = load_gltf(moving(tmp_path)[0]).scene
    assert (scene.moving, scene.frames, scene.fps) == (("camera", "box"), 25, 24)
    box = next(shape for shape in scene.shapes if shape.name == "box")
    for frame, place, size in ((0, 0, (0.1, 0.1, 0.1)), (5.9, None, (0.1, 0.1, 0.1)),
                               (6, None, (0.4, 0.6, 0.4)), (24, 1, (0.1, 0.1, 0.1)),
                               (99, 1, (0.1, 0.1, 0.1))):
        matrix = box.world_from_object_at(frame)
        np.testing.assert_allclose(np.linalg.norm(matrix[:3, :3], axis=0), size, atol=1e-6)
        if place is not None:
            np.testing.assert_allclose(matrix[:3, 3], (place, place / 2, 0), atol=1e-6)
    turned = box.world_from_object_at(8)[:3, 2]
    np.testing.assert_allclose(np.degrees(np.arctan2(turned[0], turned[2])), 30, atol=1e-4)


def test_a_file_without_camera_and_light_is_seen_and_lit(tmp_path):
    w = Writer()
    w.placed(np.diag((2.0, 2, 2, 1)), name="a\nquad", mesh=w.mesh(w.array(QUAD), w.put(
        "materials", {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}}), mode=6))
    w.json["cameras"] = []
    w.json["extensionsUsed"] = ["KHR_materials_sheen"]
    w.json["animations"] = [{"channels": [{"sampler": 0, "target": {"path": "pointer"}}],
                             "samplers": []}]
    loaded = load_gltf(w.glb(tmp_path / "a.glb"))
    assert loaded.added == ("a.glb has no camera, so one looks at it from the front and no light, "
                            "so a white sky of radiance 1 lights it")
    assert loaded.unused == ("the extension 'KHR_materials_sheen' (extensionsUsed[0]), an "
                             "animation of 'pointer' (animations[0].channels[0].target)")
    frame = onespp.render(loaded.scene, frames=1, size=(12, 16)).read_frame(0)
    assert 20 < (frame["id"] == 0).sum() < 12 * 16
    assert loaded.scene.object_names == ("a_quad",)
    white = frame["albedo"][frame["id"] == 0]
    np.testing.assert_array_equal(white, 1)  # by default all metal: nothing is diffuse


def test_lights_of_blenders_exporter_are_in_watts_again(tmp_path):
    path = lit(tmp_path)[0]
    plain = load_gltf(path).scene.lights
    path.write_text(path.read_text().replace(
        '"version"', '"generator": "Khronos glTF Blender I/O v4.2", "version"', 1))
    for a, b in zip(plain, load_gltf(path).scene.lights):
        key = "irradiance" if a.emitter["type"] == "directional" else "intensity"
        np.testing.assert_allclose(b.emitter[key], np.array(a.emitter[key]) / 683)


def _changed(tree: Any, place: str, value: Any) -> None:
    """Set a value by its place, as "nodes.0.mesh"; None takes it out."""
    *path, last = [int(key) if key.isdigit() else key for key in place.split(".")]
    for key in path:
        tree = tree.setdefault(key, {}) if isinstance(key, str) else tree[key]
    if value is None:
        del tree[last]
    else:
        tree[last] = value


@pytest.mark.parametrize(("place", "value", "sentence"), [
    ("asset.version", "1.0", "asset: the version is '1.0': export it as glTF 2.0"),
    ("extensionsRequired", ["KHR_draco_mesh_compression"],
     r"extensionsRequired\[0\]: 'KHR_draco_mesh_compression' cannot be read here: export without"),
    ("extensionsRequired", ["KHR_texture_basisu"], "export with PNG or JPEG textures"),
    ("nodes.1.skin", 0, r"nodes\[1\]: it has a skin, and meshes are rigid here"),
    ("meshes.0.primitives.0.targets", [{"POSITION": 0}], "morph targets"),
    ("animations", [{"channels": [{"sampler": 0, "target": {"path": "weights"}}]}],
     r"animations\[0\].channels\[0\].target: it changes the form of a mesh"),
    ("nodes.0.mesh", 7, r"nodes\[0\]: its mesh is 7, and there are 2 meshes"),
    ("nodes.0.matrix.3", "x", r"nodes\[0\].matrix\[3\]: it is 'x': use a number"),
    ("nodes.0.children", [0], "it names node 0, which is somewhere else already"),
    ("accessors.0.count", 10**9, r"accessors\[0\]: it has 1000000000 elements"),
    ("accessors.0.count", 100, "do not fit into bufferViews"),
    ("accessors.0.componentType", 5124, "its componentType is 5124"),
    ("buffers.0.byteLength", 10**6, "it should have 1000000 bytes and has"),
    ("buffers.0.uri", "no.bin", r"buffers\[0\]: it names 'no.bin', and there is no such file"),
    ("buffers.0.uri", "https://x.org/a.bin", "use the path of a file beside this one"),
    ("cameras.0.type", "orthographic", r"cameras\[0\]: a camera of type 'orthographic'"),
    ("materials.0.alphaMode", "CUT\n", r"materials\[0\]: its alphaMode is 'CUT\\n'"),
    ("materials.0.pbrMetallicRoughness.metallicFactor", 2, "it is 2: use 0 to 1"),
    ("extensions.KHR_lights_punctual.lights.0.type", "area", "its type is 'area'"),
    ("meshes", [{"primitives": []}] * 2, "there are no meshes in it"),
])
def test_what_cannot_be_rendered_is_told_with_its_place(place: str, value: Any, sentence: str,
                                                        tmp_path):
    path = lit(tmp_path)[0]
    tree = json.loads(path.read_text())
    _changed(tree, place, value)
    path.write_text(json.dumps(tree))
    with pytest.raises(SceneError) as caught:
        load_gltf(path)
    said = str(caught.value)
    assert re.search(sentence, said), said
    assert said.startswith(f"scene file '{path}'"), said
    assert said.isprintable()


def test_the_library_reads_files_and_refuses_what_is_for_others(tmp_path):
    path = lit(tmp_path)[0]
    assert onespp.load(path).object_names == ("box", "box 2", "floor")
    cases: tuple[tuple[Any, dict[str, Any], str], ...] = (
            (path, {"sensor": 1}, "there is no sensor 1: use --sensor 0 to 0"),
            (path, {"define": {"a": 1}}, "is for Mitsuba's XML files"),
            (tmp_path / "no.glb", {}, "there is no scene file '.*no.glb': there is no such file"),
            ("box", {"sensor": 1}, "sensor is for files of Mitsuba, glTF and Blender, and 'box'"))
    for wrong, options, sentence in cases:
        with pytest.raises((InputError, SceneError), match=sentence) as caught:
            onespp.load(wrong, **options)
        assert str(caught.value).isprintable()
