"""What a frame says about its shadow rays: the light's point, and what stopped the ray."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.render.channels import FRAME, GLOSS, SHADOW, SPLIT, UNSHADOWED
from onespp.render.errors import InputError
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog

from .test_renderer import small_scene

FRAME_NUMBER = 3


@pytest.fixture(scope="module")
def frame():
    renderer = Renderer(small_scene(), 48, 64, direct="resampled")
    return renderer.frame(FRAME_NUMBER, 5, (*FRAME, *SPLIT, *SHADOW))


def ids(*names: str) -> list[int]:
    return [small_scene().object_names.index(name) for name in names]


def test_the_ray_goes_to_a_point_of_the_light(frame):
    floor, light = ids("floor", "light")
    asked = (frame["id"] == floor) & (frame["light_id"] == light)
    assert asked.sum() > 0.9 * (frame["id"] == floor).sum()
    point = (frame["position"] + frame["light"])[asked]
    np.testing.assert_allclose(point[:, 1], 3, atol=1e-4)
    assert np.abs(point[:, [0, 2]]).max() <= 1 + 1e-4
    assert np.abs(point[:, [0, 2]]).max() > 0.9


def test_what_stopped_it_lies_on_the_ball(frame):
    floor, ball = ids("floor", "ball")
    stopped = (frame["id"] == floor) & (frame["blocker_id"] == ball)
    assert stopped.sum() > 30
    light = frame["light"][stopped].astype(float)
    along = frame["blocker_distance"][stopped] / np.linalg.norm(light, axis=1)
    assert (along < 1).all()
    point = frame["position"][stopped] + along[:, None] * light
    center = frame.world_from_object[ball][:3, 3]
    np.testing.assert_allclose(np.linalg.norm(point - center, axis=1), 0.5, atol=2e-3)


def test_a_pixel_is_dark_where_something_stopped_its_ray_and_lit_where_nothing_did(frame):
    (floor,) = ids("floor")
    on_floor = (frame["id"] == floor) & (np.abs(frame["light"]).sum(-1) > 0)
    stopped = frame["blocker_distance"] > 0
    np.testing.assert_array_equal(stopped, frame["blocker_id"] >= 0)
    assert 0.02 < stopped[on_floor].mean() < 0.5
    assert (frame["visibility"][on_floor & ~stopped] > 0).all()
    # What is left is light that the BSDF's own sample ran into.
    assert (frame["visibility"][on_floor & stopped] == 0).mean() > 0.9


def test_pixels_without_a_surface_or_on_the_light_have_no_ray(frame):
    (light,) = ids("light")
    none = (frame["id"] < 0) | (frame["id"] == light)
    assert none.any()
    assert not frame["light"][none].any()
    assert (frame["light_id"][none] == -1).all()
    assert (frame["blocker_id"][none] == -1).all()


def test_they_are_scene_units_wherever_the_scene_is():
    here, there = (Renderer(small_scene(at), 24, 32, direct="resampled").frame(1, 0, SHADOW)
                   for at in ((0, 0, 0), (5e4, 0, 0)))
    for name in SHADOW:
        same = np.isclose(here[name], there[name], atol=2e-2)
        assert same.mean() > 0.97, name  # a ray may meet the ball's edge on the other side


def test_they_need_resampled_light_and_come_with_it():
    with pytest.raises(InputError, match=r"light_id.* need --direct resampled"):
        Renderer(small_scene(), 4, 4).frame(0, channels=SHADOW)
    for name, more in (("box", ()), ("room", ("group", "group_sample", *UNSHADOWED[:2], *GLOSS))):
        channels = Renderer(catalog.load(name), 8, 8, direct="resampled").channels
        assert channels == FRAME + SPLIT + SHADOW + more
