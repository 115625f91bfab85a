"""What a frame says about reflections: the specular part, where its light comes from, roughness."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.render.channels import FRAME, GLOSS
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog
from onespp.scenes.description import Rectangle, Shape
from onespp.scenes.materials import diffuse, metal, varnish
from onespp.scenes.transforms import rotate, scale

from .test_renderer import small_scene

NEARLY_MIRROR = {"type": "roughconductor", "material": "none", "alpha": 1e-4}


def with_floor(material: dict):
    rest = [shape for shape in small_scene().shapes if shape.name != "floor"]
    floor = Shape("floor", Rectangle(), material, rotate((1, 0, 0), -90) @ scale(3))
    return small_scene(shapes=(floor, *rest), max_depth=4)


def rendered(material: dict, seed: int = 0):
    scene = with_floor(material)
    frame = Renderer(scene, 48, 64).frame(2, seed, (*FRAME, *GLOSS))
    return frame, frame["id"] == scene.object_names.index("floor"), scene


@pytest.mark.parametrize(("material", "alpha"), [
    (diffuse((0.5, 0.5, 0.5)), 1.0), (metal(roughness=0.15), 0.15),
    (varnish((0.5, 0.4, 0.3), 0.3), 0.3), (varnish((0.5, 0.4, 0.3), 0.05), 0.05),
    ({"type": "roughconductor", "distribution": "beckmann", "alpha": 0.2}, 0.2)])
def test_roughness_is_the_alpha_of_any_material(material, alpha):
    frame, floor, _ = rendered(material)
    assert floor.sum() > 500
    np.testing.assert_allclose(frame["roughness"][floor], alpha, atol=1e-3)
    assert np.all(frame["roughness"][frame["id"] < 0] == 1)


def test_the_specular_part_is_all_of_a_metal_none_of_chalk_and_some_of_varnish():
    share = {}
    for name, material in (("metal", metal(roughness=0.3)), ("chalk", diffuse((0.5,) * 3)),
                           ("varnish", varnish((0.5, 0.5, 0.5), 0.3))):
        frame, floor, _ = rendered(material)
        assert np.all(frame["specular"] <= frame["indirect"] * (1 + 1e-6))
        assert frame["indirect"][floor].sum() > 0
        share[name] = frame["specular"][floor].sum() / frame["indirect"][floor].sum()
    assert (share["metal"], share["chalk"]) == (1, 0)
    assert 0.02 < share["varnish"] < 0.9


def test_a_polished_metal_tells_where_its_reflection_is():
    """Follows the reflected ray of each floor pixel: to the ball by algebra, in float64."""
    frame, floor, scene = rendered(NEARLY_MIRROR)
    world_from_camera = np.linalg.inv(frame.camera_from_world)
    p = frame["position"][floor].astype(np.float64)
    d = p - world_from_camera[:3, 3]
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    d[:, 1] *= -1
    ball = scene.object_names.index("ball")
    center = frame.world_from_object[ball][:3, 3]
    along = ((center - p) * d).sum(1)
    miss = np.linalg.norm(p + along[:, None] * d - center, axis=1)
    seen = (along > 0) & (miss < 0.499)
    distance = along - np.sqrt(np.maximum(0.25 - miss**2, 0))
    assert seen.sum() > 20
    assert np.all(frame["hit_id"][floor][seen] == ball)
    clear = seen & (miss < 0.45)
    np.testing.assert_allclose(frame["hit_distance"][floor][clear], distance[clear], atol=2e-3)
    assert not np.any(frame["hit_id"][floor][miss > 0.501] == ball)


def test_frames_carry_what_the_scene_needs():
    assert Renderer(catalog.load("box"), 8, 8).channels == FRAME
    assert Renderer(with_floor(NEARLY_MIRROR), 8, 8).channels == FRAME + GLOSS
