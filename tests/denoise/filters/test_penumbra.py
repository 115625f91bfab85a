"""Widths of penumbras: against geometry, against bad input, and what they are worth."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

from onespp.denoise.filters import penumbra
from onespp.denoise.filters.penumbra import PenumbraSample, footprint_falloff, footprint_falloffs
from onespp.denoise.inputs.shadow_rays import light_sizes, read_shadow_rays
from onespp.denoise.inputs.surface import read_surface
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.filtered_innovation.method import FilteredInnovation
from onespp.denoise.methods.filtered_innovation.shadows import follow_shadows
from onespp.render.channels import SUN
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Camera, Rectangle, Shape
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.denoise.history.test_shadow_motion import in_shadow, rendered, shadow_scene
from tests.denoise.methods.test_filtered_innovation import run
from tests.render.tracer.test_renderer import gray, small_scene

SIDE, LIGHT, EDGE = 0.8, 3.0, 1.0  # side of the light; heights of light and of a board below it


def soft_scene(side=SIDE, camera=0.0, standing=False):
    """A board over a floor, or standing on it, in the way of a square light."""
    stands = translate((-0.8, 0.6, 0)) @ rotate((0, 1, 0), 90) @ scale(0.6)
    flat = rotate((1, 0, 0), -90)
    return small_scene(
        camera=Camera(look_at((camera, 2, 6), (0, 0.5, 0))),
        shapes=(Shape("floor", Rectangle(), gray(), flat @ scale(4)),
                Shape("board", Rectangle(), gray(0.8), stands if standing else
                      translate((-1.5, EDGE, 0)) @ flat @ scale(1.5)),
                Shape("light", Rectangle(), gray(0.0), translate((0, LIGHT, 0))
                      @ rotate((1, 0, 0), 90) @ scale(side / 2), (30.0,) * 3)))


def sharpness_of(frame):
    """(h, w) whether the ray was stopped, and q."""
    stencil = Stencil(frame.height, frame.width, 1)
    surface, rays = read_surface(frame, stencil), read_shadow_rays(frame, frame, stencil)
    _, _, (blocked, q) = follow_shadows(stencil, rays, surface.sample, surface.position)
    return stencil.image([blocked]) > 0, stencil.image([q])


@pytest.mark.parametrize("camera", [0.0, 2.0])
@pytest.mark.parametrize("side", [0.2, 0.8])
def test_a_light_is_as_large_as_its_points_lie_apart(side, camera):
    """A square's points have a variance of side^2 / 12 along either side."""
    (frame,) = rendered(soft_scene(side, camera), 1)
    sizes = light_sizes(frame)
    assert sizes.shape == (5,)
    assert np.isinf(sizes[[0, 1, 3, 4]]).all()  # board, floor, no sun and no sky send light
    assert sizes[2] == pytest.approx(2 * side * np.sqrt(2 / 12), rel=0.1)


def test_a_penumbra_is_as_wide_as_similar_triangles_say():
    (frame,) = rendered(soft_scene(), 1)
    blocked, q = sharpness_of(frame)
    here = (frame["id"] == 1) & (frame["blocker_id"] == 0)  # board, floor, light
    assert here.sum() > 100
    np.testing.assert_array_equal(blocked[here], True)
    assert not blocked[frame["blocker_id"] < 0].any()
    assert not q[~blocked].any()
    toward = frame["light"][here]
    cosine = toward[:, 1] / np.linalg.norm(toward, axis=1)
    width = light_sizes(frame)[2] * EDGE / (LIGHT - EDGE) / cosine
    focal = (frame.screen_from_world @ np.linalg.inv(frame.camera_from_world))[0, 0]
    pixels = np.sqrt(1 / q[here] - 1)
    np.testing.assert_allclose(pixels, width * abs(focal) / frame["depth"][here], rtol=5e-3)


def test_a_hard_shadow_is_as_narrow_as_a_pixel():
    (frame,) = rendered(shadow_scene(), 1)
    points = (frame["position"] + frame["light"])[frame["light_id"] >= 0].mean(0)
    there = (frame["light_id"] >= 0)[..., None]
    point_light = np.where(there, points - frame["position"], 0)
    frame = replace(frame, images={**frame.images, "light": point_light.astype(np.float32)})
    _, q = sharpness_of(frame)
    np.testing.assert_allclose(q[in_shadow(frame)], 1, atol=1e-3)


def test_where_nothing_was_stopped_a_filter_is_as_wide_as_ever():
    stencil = Stencil(1, 4, 1)
    share, q = stencil.Float([0, 5e-4, 0.5, 1]), stencil.Float([0, 1e-4, 0.2, 1])
    falloff = footprint_falloff(PenumbraSample(share, q), dr.opaque(stencil.Float, 2.0), 1e-3)
    np.testing.assert_allclose(falloff.numpy(), [0, 0, 0.8, 2], rtol=1e-6)


def test_what_stands_in_the_way_of_one_group_of_lights_is_somewhat_in_that_of_another():
    stencil = Stencil(1, 3, 1)
    groups = [PenumbraSample(stencil.Float([0, 0.25, 0]), stencil.Float([0, 0.05, 0])),
              PenumbraSample(stencil.Float([0.5, 0.25, 0]), stencil.Float([0.4, 0.25, 0]))]
    scale = dr.opaque(stencil.Float, 2.0)
    first, second = (f.numpy() for f in footprint_falloffs(groups, scale, 1e-3))
    np.testing.assert_allclose(first, [0.3 * 1.6, 0.4, 0], rtol=1e-6)
    np.testing.assert_allclose(second, [1.6, 2, 0], rtol=1e-6)
    (alone,) = footprint_falloffs(groups[1:], scale, 1e-3)
    np.testing.assert_allclose(alone.numpy(), second, rtol=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e38, 0.0])
def test_broken_points_are_no_part_of_a_light(value):
    (frame,) = rendered(soft_scene(), 1)
    light = frame["light"].copy()
    light[::3] = value
    broken = replace(frame, images={**frame.images, "light": light})
    assert light_sizes(broken)[2] == pytest.approx(light_sizes(frame)[2], rel=0.1)
    blocked, q = sharpness_of(broken)
    assert np.isfinite(q).all()
    assert (q[~blocked] == 0).all()


def test_a_light_of_few_points_has_no_size():
    (frame,) = rendered(soft_scene(), 1)
    lights = frame["light_id"].copy()
    y, x = np.argwhere((lights == 2) & (frame["blocker_id"] == 0))[0]
    lights[y, x] = 0
    one = replace(frame, images={**frame.images, "light_id": lights})
    assert np.isinf(light_sizes(one)[0])
    blocked, q = sharpness_of(one)
    assert blocked[y, x]
    assert q[y, x] == 0  # wide, for all that is known


def test_the_sun_is_as_small_as_it_is_and_the_sky_around_it_is_not():
    (frame,) = rendered(soft_scene(), 1)
    ids = frame["light_id"].copy()
    ids[ids == 2] = np.where(np.arange((ids == 2).sum()) % 2, SUN, -1)
    light = np.where((ids == SUN)[..., None], frame["light"] * 0 + (0, 9, 0), frame["light"])
    light = light - np.where((ids == SUN)[..., None], frame["position"], 0)
    frame = replace(frame, images={**frame.images, "light_id": ids,
                                   "light": light.astype(np.float32)})
    sizes = light_sizes(frame)
    assert sizes[SUN] == pytest.approx(0, abs=1e-3)
    assert sizes[-1] > 0.3
    blocked, q = sharpness_of(frame)
    for id_, width in ((SUN, 1), (-1, 2)):
        there = blocked & (ids == id_)
        assert there.sum() > 30
        assert (q[there] > 0.9).all() == (width == 1)


def test_knowing_the_penumbra_lowers_the_error_of_a_first_frame(monkeypatch):
    """Where a board stands on the floor its shadow is sharp, farther away soft; against the same
    frame's direct light with many samples."""
    monkeypatch.setattr(penumbra, "IN_HARD_SHADOW", 0.0)  # of the filter alone
    scene, size = soft_scene(0.4, standing=True), (96, 128)
    (frame,) = rendered(scene, 1, size)
    renderer = Renderer(scene, *size, direct="resampled")
    truth = np.mean([renderer.frame(0, 100 + i, ("direct",))["direct"] for i in range(64)], 0)
    still = np.zeros(truth.shape, np.float32)
    frame = replace(frame, images={**frame.images, "indirect": still, "emission": still,
                                   "color": frame["direct"]})
    floor = frame["id"] == 1
    error = [np.square(run(FilteredInnovation(penumbra=width), [frame])[0] - truth)[floor].mean()
             for width in (1e6, FilteredInnovation().penumbra)]
    assert error[1] < 0.85 * error[0]
