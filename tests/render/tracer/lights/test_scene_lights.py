"""Lights in strata and groups, and what a shadow ray tells of the group that it went to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from onespp.render.channels import GROUPED, UNSHADOWED
from onespp.render.errors import InputError
from onespp.render.tracer.lights.scene_lights import MOST_STRATA, cut, share_out
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog
from onespp.scenes.description import Camera, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance

LUMINANCE = np.array([0.212671, 0.715160, 0.072169])


def lamps(count: int, sky: bool = False) -> Scene:
    """A ball on a floor under lamps in a row."""
    ball = translate((0, 0.7, 0)) @ scale(0.5)
    shapes = [Shape("floor", Rectangle(), diffuse((0.6, 0.6, 0.6)),
                    rotate((1, 0, 0), -90) @ scale(6)),
              Shape("ball", Sphere(), diffuse((0.6, 0.3, 0.2)), ball)]
    shapes += [Shape(f"lamp{i}", Sphere(), diffuse((0.0, 0.0, 0.0)),
                     translate((2.0 * i - count + 1, 1.5, 0.4)) @ scale(0.1), (40.0, 30.0, 20.0))
               for i in range(count)]
    return Scene(name="lamps", about="", shapes=tuple(shapes), frames=4, width=24, height=16,
                 max_depth=3, environment=(0.5, 0.6, 0.8) if sky else None,
                 camera=Camera(look_at((0.3, 1.9, 6.5), (0, 0.5, 0)), fov=40))


def render(scene: Scene, seed: int = 0, **options):
    renderer = Renderer(scene, 16, 24, direct="resampled", **options)
    return renderer.frame(1, seed, renderer.channels)


@pytest.mark.parametrize(("count", "sky", "sizes"), [
    (1, False, ()), (2, False, (16, 16)), (1, True, (16, 16)), (4, False, (16,) * 4)])
def test_as_many_as_the_scene_needs(count, sky, sizes):
    renderer = Renderer(lamps(count, sky), 8, 8, direct="resampled")
    assert renderer.lights is not None
    assert renderer.lights.sizes == sizes
    there = [c for c in renderer.channels if c in GROUPED]
    assert there == (["group", "group_sample", *UNSHADOWED[:len(sizes)]] if sizes else [])


def test_lights_far_apart_share_a_group():
    """Eight lamps in a row: neighbours, which shine on the same floor, are told apart."""
    lights = Renderer(lamps(8), 8, 8, direct="resampled").lights
    assert lights is not None
    assert lights.sizes == (32, 32, 32, 32)
    group = lights.group.numpy().astype(int).reshape(8, 16)
    assert (group == group[:, :1]).all()
    assert (np.diff(group[:, 0]) != 0).all()


def test_many_lights_share_a_bounded_number_of_strata():
    """Twelve lamps and a sky: the sky, which gives most, is cut as finely as ever."""
    lights = Renderer(lamps(12, True), 8, 8, direct="resampled").lights
    assert lights is not None
    emitter = lights.stratum.numpy() >> 8
    assert len(emitter) <= MOST_STRATA
    strata = np.bincount(emitter)
    assert strata[-1] == 16
    assert set(strata) <= {1, 4, 16}
    assert sum(lights.sizes) == len(emitter)


def test_strata_go_to_the_lights_that_give_most():
    luminances = np.ones((60, 5))
    luminances[7], luminances[9], luminances[11] = 1000, 100, 500
    halvings = cut(luminances, np.arange(60) == 11)
    assert halvings[7] == halvings[9] == 2
    assert halvings[11] == 0  # at a point
    assert 60 < (4**halvings).sum() <= MOST_STRATA


def test_sharing_out_keeps_together_what_never_meets():
    luminances = np.eye(3).repeat(5, 1)  # three places of five points
    luminances = np.concatenate([luminances, 0.5 * luminances, 0.2 * luminances])
    groups = share_out(luminances, 3)
    for place in range(3):
        assert len({*groups[place::3]}) == 3  # the three lights of a place are apart


@pytest.mark.parametrize("scene", [lamps(3), lamps(6), lamps(1, True), "room"],
                         ids=["three", "six", "sky", "room"])
def test_what_the_ray_tells_is_what_arrived(scene):
    """Direct light is what the ray tells of its group, and what the BSDF's sample found."""
    frame = render(scene if isinstance(scene, Scene) else catalog.load(scene))
    y, omega, chance = np.moveaxis(frame["group_sample"].astype(float), -1, 0)
    group = frame["group"]
    names = [c for c in UNSHADOWED if c in frame]
    assert set(np.unique(group)) == {-1, *range(len(names))}
    of_group = np.select([group == g for g in range(len(names))],
                         [frame[name] @ LUMINANCE for name in names])
    told = np.divide(y * of_group, chance, out=np.zeros_like(y), where=chance > 0)
    direct = frame["direct"] @ LUMINANCE
    assert (told <= direct * (1 + 1e-4) + 1e-6).all()
    shot = group >= 0
    stopped = shot & (frame["blocker_distance"] > 0)
    assert stopped.any()
    assert not y[stopped].any()
    assert (omega[shot] > 0).mean() > 0.9
    assert not omega[~shot].any()


def test_weights_have_the_mean_one_and_chances_add_up():
    scene = lamps(3)
    frames = [render(scene, seed) for seed in range(60)]
    chances = np.zeros((3, 16, 24))
    for g in range(3):
        here = np.stack([f["group"] == g for f in frames])
        omega = np.stack([f["group_sample"][..., 1] for f in frames])
        assert omega[here].mean() == pytest.approx(1, abs=0.02)
        for f in frames:
            chances[g] = np.where(f["group"] == g, f["group_sample"][..., 2], chances[g])
        often = here.mean(0)
        assert often.mean() == pytest.approx(chances[g].mean(), abs=0.02)
    lit = frames[0]["group"] >= 0
    np.testing.assert_allclose(chances.sum(0)[lit & (chances > 0).all(0)], 1, atol=1e-3)


def test_groups_and_the_rest_are_all_of_unshadowed_light():
    frame = render(lamps(3))
    total = sum(frame[name] for name in UNSHADOWED[:3])
    assert (total <= frame["unshadowed"] * (1 + 1e-4) + 1e-6).all()
    assert total.sum() == pytest.approx(frame["unshadowed"].sum(), rel=0.01)  # lamps are small


def test_lamps_close_to_a_floor_are_told_by_groups_as_few_far_ones_are():
    """Light that the BSDF's sample ran into would be in no group, and noise."""
    scene = lamps(12)
    place = {f"lamp{i}": translate((0.5 * i - 3, 0.12, 0.8)) @ scale(0.1) for i in range(12)}
    scene = replace(scene, shapes=tuple(
        replace(shape, world_from_object=place.get(shape.name, shape.world_from_object))
        for shape in scene.shapes))
    renderer = Renderer(scene, 16, 24, direct="resampled")
    frames = [renderer.frame(1, seed, renderer.channels) for seed in range(8)]
    told = sum(frames[0][name].sum() for name in UNSHADOWED)
    assert told > 0.8 * frames[0]["unshadowed"].sum()  # by densities over twelve lamps 0.3
    assert np.var([f["direct"] for f in frames], axis=0).mean() < 0.5  # 1.5


@pytest.mark.parametrize("scene", [lamps(6), lamps(11, True)], ids=["six", "sky"])
def test_picking_by_groups_keeps_the_mean_of_direct_light(scene):
    direct = {}
    for estimator in ("mis", "resampled"):
        renderer = Renderer(scene, 32, 48, direct=estimator)
        frames = [renderer.frame(1, seed, ("direct",))["direct"] for seed in range(40)]
        direct[estimator] = mean_and_variance([blocks(f, 8).mean(-1) for f in frames])
    assert_same_mean(*direct["resampled"], *direct["mis"])


def test_frames_without_groups_have_no_such_channels():
    with pytest.raises(InputError, match="group need --direct resampled and a scene of more"):
        Renderer(lamps(1), 4, 4, direct="resampled").frame(0, channels=("group",))
    with pytest.raises(InputError, match="unshadowed3"):
        Renderer(lamps(2), 4, 4, direct="resampled").frame(0, channels=("unshadowed3",))
