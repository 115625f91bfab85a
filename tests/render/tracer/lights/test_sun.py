"""The sun of a sky as a light of its own."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.render.channels import SUN
from onespp.render.tracer.lights.sun import find_sun, spot
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Camera, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse, varnish
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance

SIZE = 16, 24


def sky(brightness: float, side: int = 2) -> np.ndarray:
    """48x96, with a square spot 45 degrees high."""
    image = np.full((48, 96, 3), (0.2, 0.3, 0.5))
    image[11:11 + side, 20:20 + side] = brightness
    return image


def ground(environment: np.ndarray | tuple[float, float, float]) -> Scene:
    """A ball on a varnished floor, a lamp above."""
    shapes = (Shape("floor", Rectangle(), varnish((0.6, 0.6, 0.6), 0.2),
                    rotate((1, 0, 0), -90) @ scale(6)),
              Shape("ball", Sphere(), diffuse((0.6, 0.3, 0.2)),
                    translate((0, 0.7, 0)) @ scale(0.7)),
              Shape("lamp", Sphere(), diffuse((0.0, 0.0, 0.0)),
                    translate((1.5, 1.5, 0)) @ scale(0.2), (6.0, 5.0, 4.0)))
    return Scene(name="ground", about="", shapes=shapes, frames=1, width=24, height=16,
                 max_depth=3, environment=environment,
                 camera=Camera(look_at((0.3, 1.9, 6.5), (0, 0.5, 0)), fov=40))


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    return Renderer(ground(sky(60.0)), *SIZE, direct="resampled", sampler="zsobol")


def test_rays_to_the_sun_go_to_the_bright_spot_and_others_elsewhere(renderer):
    frame = renderer.frame(0, 1, ("light", "light_id", "group"))
    assert renderer.lights.sizes == (16, 16, 16)  # the sky, the lamp, the sun
    sun = renderer.lights.sun
    axis, chord = sun.axis.numpy().ravel(), np.sqrt(sun.square.numpy()[0])
    assert 0.05 < chord < 0.15  # 7.5 degrees across, and what is interpolated around
    toward = frame["light"] / np.maximum(np.linalg.norm(frame["light"], axis=-1), 1e-9)[..., None]
    inside = np.linalg.norm(toward - axis, axis=-1) < chord
    to_sun = frame["light_id"] == SUN
    assert to_sun.sum() > 50
    assert inside[to_sun].all()
    to_sky = (frame["light_id"] == -1) & frame["light"].any(-1)
    assert to_sky.sum() > 20
    assert np.mean(inside[to_sky]) < 0.1  # those picked from all strata alike
    assert len({*frame["group"][to_sun]}) == 1
    assert not {*frame["group"][to_sun]} & {*frame["group"][to_sky]}


def test_frames_keep_the_mean_of_the_reference(renderer):
    frames = [blocks(renderer.frame(0, seed, ("color",))["color"], 8) for seed in range(64)]
    truth = [blocks(renderer.sample_sum(0, 5, 64 * i, 64, False) / 64, 8) for i in range(8)]
    assert_same_mean(*mean_and_variance(frames), *mean_and_variance(truth))


def test_a_ray_that_arrives_at_the_sun_tells_that_all_of_its_light_arrives(renderer):
    """Whatever part of the sun it went to: parts are picked by how bright they are."""
    frame = renderer.frame(0, 2, ("group_sample", "light_id", "blocker_distance", "normal"))
    y, weight, _ = np.moveaxis(frame["group_sample"], -1, 0)
    arrived = ((frame["light_id"] == SUN) & (frame["blocker_distance"] == 0)
               & (frame["normal"][..., 1] > 0.9))
    assert arrived.sum() > 30
    share = y[arrived] / weight[arrived]
    assert share.mean() == pytest.approx(1, abs=0.15)
    assert share.std() < 0.3


@pytest.mark.parametrize("environment", [
    (0.3, 0.4, 0.5), sky(1.0), sky(4.0, 12), sky(60.0, 16)])
def test_a_sky_without_a_small_bright_spot_has_no_sun(environment):
    lights = Renderer(ground(environment), *SIZE, direct="resampled").lights
    assert lights is not None
    assert lights.sun is None
    assert lights.sizes == (16, 16)


def test_a_spot_is_found_wherever_it_is():
    random = np.random.default_rng(1)
    directions = random.normal(size=(40000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for _ in range(5):
        axis = random.normal(size=3)
        axis /= np.linalg.norm(axis)
        light = np.where(directions @ axis > np.cos(0.12), 500.0, 1.0)
        found = spot(light, directions, np.ones(len(light)))
        assert found is not None
        assert found[0] @ axis > np.cos(0.02)
        assert 0.1 < np.sqrt(found[1]) < 0.15
    glow = 500 * np.maximum(directions @ axis, 0) ** 40  # 14 degrees to half of it
    assert spot(glow, directions, np.ones(len(glow))) is None


def test_a_scene_without_an_environment_has_no_sun():
    scene = Renderer(ground(sky(60.0)), *SIZE).stage.mi_scene
    assert find_sun(scene) is not None
    assert find_sun(Renderer(ground((0.0, 0.0, 0.0)), *SIZE).stage.mi_scene) is None
