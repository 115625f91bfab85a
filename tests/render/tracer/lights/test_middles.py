"""Middles of strata: to the bit what lights give that are asked, and so are frames."""

from __future__ import annotations

from pathlib import Path

import drjit as dr
import numpy as np
import pytest

import onespp
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.lights import resampling
from onespp.render.tracer.lights.middles import middles_of
from onespp.render.tracer.lights.strata import stratum_place
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Camera, Cylinder, Disk, Light, Mesh, Rectangle, Scene, Shape
from onespp.scenes.description import Sphere as Ball
from onespp.scenes.materials import diffuse
from onespp.scenes.meshes import box
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support import xml_scenes

PLACE = translate((0.3, 0.7, -0.2)) @ rotate((1, 2, 3), 33) @ scale(0.4)
PICTURE = np.random.default_rng(2).random((5, 7, 3)) ** 4
SKY = np.random.default_rng(3).random((8, 16, 3)) ** 3
SUNNY = np.full((64, 128, 3), 0.1)
SUNNY[20:22, 30:33] = 900
CAMERA = Camera(look_at((0, 1, 5), (0, 0.5, 0)))


def quad() -> Mesh:
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
    return Mesh(corners, np.array([(0, 1, 2), (0, 2, 3)]), uv=(corners[:, :2] + 1) / 2)


def lamp(geometry, emission=(3.0, 2.0, 1.0)) -> Scene:
    return under(None, shapes=(Shape("lamp", geometry, diffuse((0, 0, 0)), PLACE, emission),))


def under(environment, *lights: Light, shapes: tuple[Shape, ...] = ()) -> Scene:
    ground = Shape("ground", Rectangle(), diffuse((0.5, 0.4, 0.3)),
                   rotate((1, 0, 0), -90) @ scale(3))
    return Scene("lit", "For a test", (ground, *shapes), CAMERA, 2, 9, 12,
                 environment=environment, lights=lights)


SUN = Light({"type": "directional", "irradiance": {"type": "rgb", "value": (1.0, 2.0, 3.0)}},
            rotate((1, 0, 0), 130))
SCENES = {
    "rectangle": lamp(Rectangle()), "disk": lamp(Disk()), "cylinder": lamp(Cylinder()),
    "mesh": lamp(box((1, 2, 3))), "sphere": lamp(Ball()), "sphere from inside": lamp(
        Ball(flipped=True)), "picture": lamp(Rectangle(), PICTURE), "mesh with a picture": lamp(
        quad(), PICTURE), "constant": under((0.2, 0.3, 0.4)), "sky": under(SKY),
    "sky with a sun": under(SUNNY), "directional": under(None, SUN)}


def renderer_of(scene: Scene) -> Renderer:
    return Renderer(scene, 9, 12, direct="resampled", sampler="zsobol")


@pytest.mark.parametrize("name", SCENES)
def test_they_are_what_the_light_itself_gives(name):
    renderer = renderer_of(SCENES[name])
    lights, scene = renderer.lights, renderer.stage.mi_scene
    assert lights is not None
    middles = middles_of(scene, lights.stratum, lights.share(lights.stratum), None, lights.sun)
    assert middles is not None
    points, strata = 1024, dr.width(lights.stratum)
    k = dr.arange(mi.UInt32, points * strata) % strata
    rng = np.random.default_rng(1)
    apart = 2 * 10 ** rng.uniform(-2, 0, points * strata)  # from the middle: also inside
    middle = PLACE[:3, 3:] - renderer.stage.origin[:, None]
    places = middle + apart * rng.normal(size=(3, len(apart)))
    si = dr.zeros(mi.SurfaceInteraction3f, points * strata)
    si.p = mi.Point3f(places.astype(np.float32))
    stratum = dr.gather(mi.UInt32, lights.stratum, k)
    emitter = dr.gather(mi.EmitterPtr, scene.emitters_dr(), stratum >> 8)
    sample, side = stratum_place(stratum, mi.Point2f(0.5))
    light, weight = emitter.sample_direction(si, sample)
    if lights.sun is not None:
        light, weight = lights.sun.told_apart(scene, si, stratum, sample, light, weight,
                                              mi.Bool(True))
    found = middles.at(k, si.p)
    assert (weight.numpy().max(0) > 0).mean() > 0.1
    for ours, theirs in ((found.d, light.d), (found.pdf, light.pdf), (found.light, weight),
                         (found.delta, light.delta), (found.square, dr.square(side))):
        np.testing.assert_array_equal(ours.numpy(), theirs.numpy())


def test_no_rows_where_a_light_is_of_another_kind():
    lights = under(None, Light({"type": "point", "intensity": 3.0}, translate((0, 2, 0))))
    renderer = renderer_of(lights)
    assert renderer.lights_now is not None
    assert renderer.lights_now.middles is None


@pytest.mark.parametrize("called", [0, resampling.MOST_CALLED])
@pytest.mark.parametrize("name", ["indoor", "glass", "foliage"])
def test_frames_are_the_same_to_the_bit_as_by_asking_the_lights(name, called, tmp_path: Path,
                                                              monkeypatch):
    monkeypatch.setattr(resampling, "MOST_CALLED", called)
    scene = onespp.load(str(xml_scenes.SCENES[name](tmp_path)))
    told = renderer_of(scene)
    now = told.lights_now
    assert now is not None
    assert now.middles is not None
    first = told.frame(0, 0, told.channels)
    monkeypatch.setattr(resampling, "middles_of", lambda *_: None)
    asked = renderer_of(scene)
    second = asked.frame(0, 0, asked.channels)
    for channel in told.channels:
        np.testing.assert_array_equal(first[channel], second[channel], err_msg=channel)
