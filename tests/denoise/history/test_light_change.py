"""What unshadowed light tells of the lights, in frames whose light is known."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.inputs.light_change import LightChange, change_of_lights, sample_light
from tests.support.frames import make_frame, translation, with_images

HEIGHT, WIDTH = 48, 64
ALBEDO = np.array([0.5, 0.4, 0.3])


def lit(light, *, shadows=0.5, direct=None, seed=0, **more):
    """A frame of a textured wall and a board in a light, a function of (h, w, 3) positions; of
    `direct`, by default of `light`, a share arrives at pixels by chance."""
    frame = make_frame(HEIGHT, WIDTH, wall_end=1e9, **more)
    albedo = ALBEDO * (1 + 0.5 * np.sin(5 * frame["position"][..., :1]))
    arrives = np.random.default_rng(seed).random((HEIGHT, WIDTH, 1)) < shadows
    unshadowed, direct = (albedo * each(frame["position"]) for each in (light, direct or light))
    return with_images(frame, albedo=albedo, unshadowed=unshadowed, direct=direct * arrives)


def lamp(x, power=1.0):
    """The light of a lamp, by position."""
    return lambda p: power / (1 + np.square(p - [x, 0, 7]).sum(-1, keepdims=True)) * np.ones(3)


def both(*lamps):
    return lambda p: sum(each(p) for each in lamps)


def change(before, after):
    return change_of_lights(sample_light(before), before, after)


@pytest.mark.parametrize("camera", [np.eye(4), translation(0.3, 0.1, 0.2)])
def test_lights_that_all_change_alike_tell_by_how_much(camera):
    factor = np.array([0.25, 0.6, 1.7])
    before = lit(lamp(-2))
    found = change(before, lit(lambda p: factor * lamp(-2)(p), camera=camera, seed=1))
    np.testing.assert_allclose(found.ratio, factor, rtol=0.02)
    assert found.left == pytest.approx(0, abs=0.02)
    assert found.renewal == 0
    assert not found.rests


@pytest.mark.parametrize("camera", [np.eye(4), translation(0.3, 0.1, 0.2)])
def test_lights_at_rest_are_told_from_slow_ones(camera):
    before = lit(lamp(-2))
    assert change(before, lit(lamp(-2), camera=camera, seed=1)).rests
    fades = change(before, lit(lamp(-2, 0.97), camera=camera, seed=1))
    np.testing.assert_allclose(fades.ratio, 0.97, atol=0.005)
    assert not fades.rests
    assert not change(before, lit(lamp(-1), camera=camera, seed=1)).rests


def test_one_of_several_that_goes_off_leaves_a_change():
    one, other = lamp(-2), lamp(2)
    before, after = lit(both(one, other)), lit(other)
    share = [frame["unshadowed"][..., 1] / frame["albedo"][..., 1] for frame in (before, after)]
    found = change(before, after)
    assert found.ratio == (1, 1, 1)
    assert found.left == pytest.approx(share[0].sum() / share[1].sum() - 1, abs=0.02)
    x = found.left - 0.25
    assert found.renewal == pytest.approx(x**2 / (x**2 + 1))
    assert 0.1 < found.renewal < 0.9


def test_of_light_that_goes_off_nothing_is_left_and_what_goes_on_was_dark():
    dark, one = lit(lambda p: 0 * p), lit(lamp(-2))
    assert change(one, dark).renewal > 1 - 1e-9
    assert change(dark, one) == LightChange(left=1.0)
    assert change(one, lit(lamp(-2, 0.02))).ratio == pytest.approx([0.02] * 3, rel=0.02)


def test_of_lights_behind_walls_nothing_is_known():
    here, there = lamp(-2), lamp(2, 3.0)
    before, after = lit(both(here, there), direct=here), lit(here, seed=1)
    assert change(before, after) == LightChange()
    assert not change(before, after).rests
    assert change(before, after).renewal == 0


def test_objects_that_move_do_not_count():
    before = lit(lamp(-2))
    after = lit(lamp(-2), board=translation(0.2, 0, 0))
    bright = np.where((after["id"] == 1)[..., None], 9, 1)
    assert change(before, with_images(after, unshadowed=bright * after["unshadowed"])).rests


def test_nothing_is_known_of_places_that_are_not_seen_again():
    before = lit(lamp(-2))
    assert change(before, lit(lamp(-2), camera=translation(40, 0, 0))) == LightChange()
    assert change_of_lights(None, before, before) == LightChange()
    dark = with_images(before, unshadowed=0 * before["unshadowed"])
    assert change(dark, dark) == LightChange()
    nowhere = with_images(before, id=np.full((HEIGHT, WIDTH), -1))
    assert change(nowhere, before) == change(before, nowhere) == LightChange()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1e30])
@pytest.mark.parametrize("name", ["unshadowed", "direct", "albedo", "depth"])
def test_broken_values_are_left_out(name, value):
    before, after = lit(lamp(-2)), lit(lambda p: 2 * lamp(-2)(p))
    broken = after[name].copy()
    broken[::2] = value
    broken = with_images(after, **{name: broken})
    for found, expected in ((change(before, broken), 2.0), (change(broken, before), 0.5)):
        assert np.isfinite(found.ratio).all()
        if found.left is not None and value != -1e30:
            np.testing.assert_allclose(found.ratio, expected, rtol=0.1)
