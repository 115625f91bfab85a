"""Where shadows were: against optics, against float64, and what the choice of history is worth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from onespp.denoise.history.shadow_motion import shadow_motion
from onespp.denoise.inputs.shadow_rays import read_shadow_rays, share_of_moving_lights
from onespp.denoise.inputs.surface import read_surface
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.filtered_innovation.method import FilteredInnovation
from onespp.denoise.oracles import filtered_innovation as innovation_oracle
from onespp.render.channels import FRAME, SHADOW, SPLIT
from onespp.render.errors import InputError
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Camera, Rectangle, Shape, Sphere
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.denoise.methods.test_filtered_innovation import run, split
from tests.render.tracer.test_renderer import gray, small_scene
from tests.support.frames import translation

HEIGHT, WIDTH = 48, 64
STEP = np.array([0.15, 0, 0.05])  # of ball or light, a frame


def shadow_scene(ball=0.0, light=0.0, camera=0.0):
    """A ball that glides over a floor under a small light; each may move by `STEP` a frame."""
    def at(x, y, z, share):
        return lambda f: translate(np.add((x, y, z), share * f * STEP))

    return small_scene(
        camera=Camera(lambda f: look_at((camera * f, 2, 5), (0, 0.4, 0))),
        shapes=(Shape("floor", Rectangle(), gray(), rotate((1, 0, 0), -90) @ scale(3)),
                Shape("ball", Sphere(), gray(0.8), lambda f: at(-0.4, 1, 0, ball)(f) @ scale(0.5)),
                Shape("light", Rectangle(), gray(0.0),
                      lambda f: at(0, 3, 0, light)(f) @ rotate((1, 0, 0), 90) @ scale(0.05),
                      (800.0,) * 3)))


def rendered(scene, count=2, size=(HEIGHT, WIDTH)):
    renderer = Renderer(scene, *size, direct="resampled", sampler="zsobol")
    return [renderer.frame(i, 3, (*FRAME, *SPLIT, *SHADOW)) for i in range(count)]


def motion_of(previous, frame):
    """(h, w) whether the kernel says that the shadow moves, and (h, w, 2) by how much."""
    stencil = Stencil(frame.height, frame.width, 1)
    surface, rays = read_surface(frame, stencil), read_shadow_rays(frame, previous, stencil)
    motion, rests = shadow_motion(stencil, rays, surface.sample, surface.position)
    image = stencil.image(motion)
    assert not (stencil.rows(rests.numpy()) * image[..., 0]).any()
    return image[..., 0] > 0, image[..., 1:]


def in_shadow(frame):
    return (frame["id"] == 1) & (frame["blocker_id"] == 0)  # ball, floor, light


@pytest.mark.parametrize(("ball", "light"), [(1.0, 0.0), (0.0, 1.0), (1.0, -0.5)])
def test_a_shadow_moves_as_optics_says(ball, light):
    """On a floor at height 0, from a light at height 3 past a point at height b, with similar
    triangles: its shadow moves by (3 ball - b light) / (3 - b)."""
    before, frame = rendered(shadow_scene(ball, light))
    moves, shift = motion_of(before, frame)
    here = in_shadow(frame)
    assert here.sum() > 80
    share = frame["blocker_distance"][here] / np.linalg.norm(frame["light"][here], axis=1)
    b = 3 * share[:, None]
    was = frame["position"][here] - STEP * (3 * ball - b * light) / (3 - b)
    screen = np.column_stack([was, np.ones(len(was))]) @ frame.screen_from_world.T
    y, x = np.nonzero(here)
    expected = screen[:, :2] / screen[:, 3:] - np.column_stack([x, y]) - 0.5
    assert moves[here].all()
    np.testing.assert_allclose(shift[here], expected, atol=2e-3)
    assert not moves[(frame["blocker_id"] < 0)].any()


def test_no_shadow_moves_where_only_the_camera_does_or_nothing():
    for camera in (0.0, 0.3):
        before, frame = rendered(shadow_scene(camera=camera))
        assert in_shadow(frame).sum() > 80
        moves, shift = motion_of(before, frame)
        assert not moves.any()
        assert not shift.any()


def test_the_kernel_is_the_oracle():
    """With lights that are an object's, and one that is nobody's, and all objects moving."""
    before, frame = split(19, 26, 2)
    rng = np.random.default_rng(5)
    matrices = frame.world_from_object @ [translation(0.1 * i, -0.05, 0.02) for i in (1, 2, 3)]
    lights = rng.integers(-1, 3, frame["light_id"].shape).astype(np.int32)
    frame = replace(frame, world_from_object=matrices, images={**frame.images, "light_id": lights})
    moves, shift = motion_of(before, frame)
    expected = innovation_oracle.shadow_shift(before, frame)
    np.testing.assert_array_equal(moves, np.isfinite(expected).all(-1))
    np.testing.assert_allclose(shift[moves], expected[moves], rtol=1e-4, atol=1e-4)
    assert moves.mean() > 0.2


def test_following_shadows_lowers_the_error_of_visibility():
    """A gliding shadow, against the same frames' visibility with many samples."""
    scene, size = shadow_scene(0.6), (96, 128)
    frames = rendered(scene, 8, size)
    renderer = Renderer(scene, *size, direct="resampled")
    truth = np.mean([renderer.frame(7, 100 + i, ("direct",))["direct"] for i in range(64)], 0)
    still = np.zeros(truth.shape, np.float32)
    frames = [replace(f, images={**f.images, "indirect": still, "emission": still,
                                 "color": f["direct"]}) for f in frames]
    floor = frames[-1]["id"] == 1
    error = [np.square(run(FilteredInnovation(follow_shadows=follow), frames)[0]
                       - truth)[floor].mean() for follow in (False, True)]
    assert error[1] < 0.75 * error[0]


@pytest.mark.parametrize("halfway", [True, False])
def test_frames_with_and_without_shadow_rays_do_not_follow_one_another(halfway):
    frames = split(8, 8, 2)
    without = [replace(f, images={k: v for k, v in f.images.items() if k not in SHADOW})
               for f in frames]
    method = FilteredInnovation()
    _, state = method((frames if halfway else without)[0], method.init(8, 8))
    with pytest.raises(InputError, match="other channels"):
        method((without if halfway else frames)[1], state)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e30, 1e9])
def test_broken_shadow_rays_leave_images_finite(value):
    frames = split(16, 20, 3)
    for name in ("light", "blocker_distance"):
        broken = [replace(f, images={**f.images, name: np.full_like(f[name], value)})
                  for f in frames]
        assert np.isfinite(run(FilteredInnovation(), broken)[0]).all()


@pytest.mark.parametrize("value", [-5, 2, 10**6, 2**31 - 128])
@pytest.mark.parametrize("names", [("id",), ("blocker_id",), ("light_id",),
                                   ("blocker_id", "light_id")])
def test_objects_that_do_not_exist_leave_images_finite(names, value):
    """As float32 too, which frames made by hand may have."""
    for dtype in (np.int32, np.float32):
        frames = split(16, 20, 3)
        for frame in frames:
            for name in names:
                frame.images[name][4:9, 5:12] = value
        frames = [replace(f, images={**f.images, **{
            name: f[name].astype(dtype) for name in ("blocker_id", "light_id")}}) for f in frames]
        assert np.isfinite(run(FilteredInnovation(), frames)[0]).all()


def test_the_share_of_lights_that_move_is_that_of_the_rays_to_them():
    previous, frame = rendered(shadow_scene(light=1.0, ball=1.0))
    assert share_of_moving_lights(previous, frame) == 1
    assert share_of_moving_lights(*rendered(shadow_scene(ball=1.0, camera=0.1))) == 0
    ids = frame["light_id"].copy()
    ids[:, ::2] = -1  # to an environment
    half = replace(frame, images={**frame.images, "light_id": ids})
    assert share_of_moving_lights(previous, half) == pytest.approx(0.5, abs=0.02)
    nowhere = replace(frame, images={**frame.images, "light": 0 * frame["light"]})
    assert share_of_moving_lights(previous, nowhere) == 0
    broken = replace(frame, images={**frame.images, "light_id": np.full_like(ids, 10**6)})
    assert share_of_moving_lights(previous, broken) == 0
