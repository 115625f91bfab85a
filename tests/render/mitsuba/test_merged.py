"""Many still meshes are built as few, and nobody can tell."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.render.mitsuba import merged
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import meshes
from onespp.scenes.animation import spin
from onespp.scenes.description import Camera, Mesh, Rectangle, Scene, Shape
from onespp.scenes.materials import diffuse, metal
from onespp.scenes.transforms import look_at, rotate, scale, translate

CHANNELS = ("id", "hit_id", "blocker_id", "light_id", "normal", "depth", "color")


def crowd() -> Scene:
    """72 little boxes of three materials in rows, one of which turns, on a floor under a lamp."""
    block = meshes.box((0.5, 0.5, 0.5))
    flat = Mesh(block.vertices, block.faces, None, block.uv)
    materials = [diffuse((0.8, 0.3, 0.3)), diffuse((0.3, 0.3, 0.8)), metal()]
    blocks = []
    for i in range(72):
        place = translate((i % 9 - 4, 0.3, i // 9 - 4)) @ rotate((0, 1, 0), 10 * i)
        if i % 5 == 0:
            place = place @ scale((-1, 1, 1))
        blocks.append(Shape(f"block {i:02d}", flat if i % 7 == 0 else block, materials[i % 3],
                            spin((0, 1, 0), 5) if i == 40 else place))
    floor = Shape("floor", Rectangle(), materials[0], rotate((1, 0, 0), -90) @ scale(6))
    lamp = Shape("lamp", Rectangle(), materials[0], translate((0, 4, 0)) @ rotate((1, 0, 0), 90),
                 emission=20.0)
    return Scene("crowd", "", (*blocks, floor, lamp),
                 Camera(look_at((0, 4, 7), (0, 0, 0)), 60), 4, 32, 24)


def test_merged_meshes_keep_their_ids_and_their_light(monkeypatch: pytest.MonkeyPatch):
    scene = crowd()
    stage = MitsubaScene(scene)
    assert len(stage.mi_scene.shapes()) == 2 + 1 + 6  # the moving one; by material, flat or not
    together = Renderer(scene, 24, 32, direct="resampled").frame(1, 0, CHANNELS)
    monkeypatch.setattr(merged, "MANY", 1000)
    assert len(MitsubaScene(scene).mi_scene.shapes()) == 74
    apart = Renderer(scene, 24, 32, direct="resampled").frame(1, 0, CHANNELS)
    for name in CHANNELS:
        np.testing.assert_allclose(together[name], apart[name], rtol=1e-4, atol=1e-5, err_msg=name)
    for name, least in (("id", 60), ("hit_id", 30), ("blocker_id", 5)):
        assert len(np.unique(together[name])) > least, name
