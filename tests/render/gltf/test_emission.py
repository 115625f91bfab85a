"""What shines is there: holes do not glow, and a veil glows as much as there is of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from onespp.render.gltf.gltf import load_gltf
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi
from onespp.scenes.transforms import translate
from tests.support.gltf_scenes import QUAD, QUAD_UV, Writer
from tests.support.xml_scenes import write_png

GLOW = np.array([1, 0.5, 0.25])
TURNED = {"extensions": {"KHR_texture_transform": {"offset": [0.5, 0]}}}


def shining(w: Writer, name: str, place: int, alpha: float = 1.0, leaf: bool = False,
            picture: dict | None = None, mode: str = "BLEND") -> None:
    """A quad that glows; a leaf has holes on its left half, a picture shines above alone."""
    pbr = {"baseColorFactor": [0, 0, 0, alpha], "metallicFactor": 0}
    if leaf:
        pbr["baseColorTexture"] = {"index": 0}
    more = {} if picture is None else {"emissiveTexture": {"index": 1, **picture}}
    material = w.put("materials", {"pbrMetallicRoughness": pbr, "emissiveFactor": GLOW.tolist(),
                                   "alphaMode": mode, **more})
    w.placed(translate((2.5 * place, 0, 0)), name=name, mesh=w.mesh(
        w.array(QUAD), material, indices=w.array([0, 1, 2, 0, 2, 3], "uint16"),
        attributes={"TEXCOORD_0": w.array(QUAD_UV * (1, -1) + (0, 1))}))


def written(folder: Path, *quads: dict) -> Path:
    w = Writer()
    leaf = np.ones((3, 2, 4))
    leaf[:, 0, 3] = 0
    for name, pixels in (("leaf", leaf), ("glow", np.array([1.0, 1, 0, 0])[:, None, None]
                                          * np.ones((4, 1, 3)))):
        write_png(folder / f"{name}.png", pixels)
        w.put("textures", {"source": w.put("images", {"uri": f"{name}.png"}), "sampler": w.put(
            "samplers", {"magFilter": 9728})})
    for k, quad in enumerate(quads):
        shining(w, place=k, **quad)
    return w.gltf(folder / "a.gltf")


def glow(path: Path, count: int) -> np.ndarray:
    """(quads, 2, 2) radiance of the quarters of each quad, as shares of GLOW."""
    stage = MitsubaScene(load_gltf(path).scene)
    stage.set_frame(0)
    points = [(2.5 * k + x, y, 5) for k in range(count) for y in (0.4, -0.4) for x in (-0.4, 0.4)]
    eyes = (np.array(points) - stage.origin) / stage.unit
    si = stage.mi_scene.ray_intersect(mi.Ray3f(mi.Point3f(eyes.T.astype(np.float32)),
                                               mi.Vector3f(0, 0, -1)))
    radiance = np.array(si.emitter(stage.mi_scene).eval(si)).T / GLOW
    np.testing.assert_allclose(radiance, radiance[:, :1] * [1, 1, 1], rtol=1e-5)
    return radiance[:, 0].reshape(-1, 2, 2)


def test_emission_is_of_what_alpha_leaves(tmp_path):
    cases = (
        ({"name": "whole", "mode": "OPAQUE", "alpha": 0.1}, [[1, 1], [1, 1]]),
        ({"name": "veil", "alpha": 0.25}, [[0.25, 0.25], [0.25, 0.25]]),
        ({"name": "holes", "leaf": True, "mode": "MASK"}, [[0, 1], [0, 1]]),
        ({"name": "half holes", "leaf": True, "alpha": 0.5}, [[0, 0.5], [0, 0.5]]),
        ({"name": "holes, pictured", "leaf": True, "mode": "MASK", "picture": {}},
         [[0, 1], [0, 0]]),
        ({"name": "veil, pictured", "alpha": 0.5, "picture": {}}, [[0.5, 0.5], [0, 0]]))
    path = written(tmp_path, *(quad for quad, _ in cases))
    np.testing.assert_allclose(glow(path, len(cases)), [share for _, share in cases], atol=1e-5)


def test_a_picture_that_lies_elsewhere_than_alpha_is_told(tmp_path):
    loaded = load_gltf(written(tmp_path, {"name": "a", "leaf": True, "picture": TURNED}))
    assert "alpha of emission whose texture lies otherwise (materials[0])" in loaded.unused
