"""Temporal anti-aliasing: its formulas, and that it is one, on rendered frames."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from onespp.denoise.catalog import build
from onespp.denoise.jit.arrays import Color
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.antialiasing.catmull_rom import catmull_rom, pack_image
from onespp.denoise.methods.antialiasing.taa import Taa, change_of_jitter
from onespp.denoise.oracles import taa as oracles
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.box import box
from tests.support.frames import make_frame, noisy, translation, with_images
from tests.support.recordings import compiled, taking_turns


def run(method, frames):
    state = method.init(frames[0].height, frames[0].width)
    for frame in frames:
        image, state = method(frame, state)
    return image


def moving(height, width, count=4, camera=0.03, board=0.15, jitter=None):
    """Noisy frames of a camera and a board that move; jitter: (x, y) of each, pixels."""
    frames = [noisy(make_frame(height, width, index=i, camera=translation(camera * i, 0, 0),
                               board=translation(board * i, 0.05 * i, 0)), seed=i)
              for i in range(count)]
    return [moved(f, *j) for f, j in zip(frames, jitter or [(0, 0)] * count)]


def moved(frame, x, y):
    """The frame with matrices that contain a jitter, and positions that agree with them."""
    shift, depth = np.eye(4), frame["depth"]
    shift[:2, 3] = -x, -y
    screen_from_world = shift @ frame.screen_from_world
    row, column = np.mgrid[:frame.height, :frame.width] + 0.5
    seen = np.stack([column * depth, row * depth, np.ones_like(row), depth], -1)
    position = (seen @ np.linalg.inv(screen_from_world).T)[..., :3]
    images = with_images(frame, position=position).images
    return Frame(frame.index, images, frame.camera_from_world, screen_from_world,
                 frame.world_from_object)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 7), (5, 1), (13, 17), (24, 31)])
def test_agrees_with_the_formula_in_float64(height, width):
    frames = moving(height, width)
    np.testing.assert_allclose(run(Taa(), frames), oracles.taa(frames), atol=1e-5)


@pytest.mark.parametrize("parameters", [{"alpha": 0.5}, {"color_box": 0.3}, {"color_box": 1e5},
                                        {"color_box": 0.0}])
def test_each_parameter_does_what_the_formula_says(parameters):
    frames = moving(15, 19)
    expected = oracles.taa(frames, alpha=parameters.get("alpha", 0.2),
                           k=parameters.get("color_box", 1.0))
    np.testing.assert_allclose(run(Taa(**parameters), frames), expected, atol=1e-5)


def test_jitter_is_taken_out_of_the_motion():
    jitter = [(0.25, -0.4), (-0.3, 0.1), (0.45, 0.2)]
    frames = moving(15, 19, 3, jitter=jitter)
    change = change_of_jitter(frames[0], frames[1])
    np.testing.assert_allclose(change, (0.25 + 0.3, -0.4 - 0.1), atol=1e-9)
    np.testing.assert_allclose(run(Taa(), frames), oracles.taa(frames), atol=1e-5)


def test_after_onespp_it_is_the_same_on_what_that_gives():
    frames = moving(15, 19)
    method, images = build("onespp"), []
    state = method.init(15, 19)
    for frame in frames:
        image, state = method(frame, state)
        images.append(image)
    expected = oracles.taa(frames, images)
    np.testing.assert_allclose(run(build("onespp-taa"), frames), expected, atol=1e-5)


def test_an_image_is_looked_up_between_its_pixels():
    """Exact at pixels, exact for a ramp, clamped at the border, and never beyond its neighbours."""
    stencil = Stencil(9, 11, 1)
    image = np.random.default_rng(0).random((9, 11, 3), np.float32)
    y, x = (np.random.default_rng(seed).uniform(0, size, (9, 11)).astype(np.float32)
            for seed, size in ((1, 9), (2, 11)))
    y[0], x[0] = 2.5, np.arange(11) + 0.5

    def looked_up(image):
        packed = pack_image(stencil, Color(*stencil.load(image)))
        return stencil.image(catmull_rom(stencil, packed, *stencil.load(x), *stencil.load(y)))

    found = looked_up(image)
    np.testing.assert_allclose(found[0], image[2], atol=1e-6)
    expected = [[oracles.catmull_rom(image.astype(np.float64), *at) for at in zip(*row)]
                for row in zip(x.astype(np.float64), y.astype(np.float64))]
    np.testing.assert_allclose(found, expected, atol=3e-6)
    ramp = np.broadcast_to((np.arange(11) + 0.5)[:, None], (9, 11, 3)).astype(np.float32)
    inner = (x > 1.5) & (x < 9.5)
    np.testing.assert_allclose(looked_up(ramp)[inner], x[inner][:, None].repeat(3, 1), atol=1e-5)


def test_a_silhouette_moves_with_what_is_in_front():
    """The pixels beside a board that moves by one take their history from one pixel beside."""
    colors = np.random.default_rng(0).random((24, 32, 3))  # so that the clip is wide everywhere
    before, frame = (with_images(make_frame(24, 32, index=i, board=translation(0.15625 * i, 0, 0)),
                                 color=colors) for i in range(2))
    columns = with_images(before, color=np.arange(32.0)[None, :, None] * np.ones((24, 1, 3)))
    image = run(Taa(alpha=1e-6, color_box=1e6), [columns, frame])[12, :, 0]
    left, right = np.flatnonzero(frame["id"][12] == 1)[[0, -1]]
    beside = [left - 1, right + 1]
    np.testing.assert_allclose(image[beside], [left - 2, right], atol=1e-3)
    np.testing.assert_allclose(image[[left - 3, right + 3]], [left - 3, right + 3], atol=1e-3)


SIZE = 64


@cache
def still_box():
    """Plain and jittered frames of a box that stands still, and the mean over each pixel.

    Albedo stands for light, so that there is no noise: edges alone are left.
    """
    scene = box()
    still = replace(scene, shapes=tuple(
        replace(s, world_from_object=s.world_from_object_at(0)) for s in scene.shapes))
    found = {}
    for jitter in ("none", "halton"):
        renderer = Renderer(still, SIZE, SIZE, jitter=jitter)
        frames = [renderer.frame(i, 0, ("color", "albedo", "normal", "depth", "id"))
                  for i in range(32)]
        found[jitter] = [with_images(f, color=f["albedo"]) for f in frames]
    return found, np.mean([f["color"] for f in found["halton"]], axis=0)


def test_jittered_frames_of_a_still_scene_become_its_anti_aliased_image():
    found, expected = still_box()
    edges = np.ptp([f["color"] for f in found["halton"]], axis=0).max(-1) > 0.05

    def error(image):
        return np.sqrt(np.mean((image - expected)[edges]**2))

    centres, jittered = (run(Taa(alpha=0.1), found[j]) for j in ("none", "halton"))
    assert edges.mean() > 0.03
    assert error(jittered) < 0.35 * error(centres)


def test_five_frames_one_recording_and_changed_parameters_compile_nothing():
    method, frames = Taa(), moving(9, 11, 5)
    state = method.init(9, 11)
    for frame in frames:
        _, state = method(frame, state)
    assert (state.find_motion.recordings, state.resolve.recordings) == (1, 1)
    run(method, frames)
    assert compiled(lambda: run(Taa(alpha=0.3, color_box=2.0), frames)) == 0


def test_one_and_two_threads_give_the_same():
    frames = moving(40, 50, 3)
    one, two = taking_turns(lambda: run(Taa(), frames))
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("parameters", [{"alpha": 0.0}, {"alpha": 1.5}, {"color_box": -1.0}])
def test_bad_parameters_are_refused(parameters):
    with pytest.raises(InputError, match=next(iter(parameters))):
        Taa(**parameters)
