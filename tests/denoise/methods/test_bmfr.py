"""BMFR: its formulas in float64, and that a fit is one."""

import numpy as np
import pytest

from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.regression.bmfr import SHIFTS, Bmfr, shift_of
from onespp.denoise.oracles import bmfr as oracles
from onespp.render.errors import InputError
from tests.support.frames import make_frame, noisy, translation, turn, with_images
from tests.support.recordings import compiled, taking_turns


def run(method, frames):
    state = method.init(frames[0].height, frames[0].width)
    for frame in frames:
        image, state = method(frame, state)
    return image


def moving(height, width, count=3):
    """Noisy frames of a camera that turns and a board that moves."""
    albedo = 0.1 + 0.8 * np.random.default_rng(9).random((height, width, 3))
    frames = [make_frame(height, width, index=i, board=translation(0.15 * i, 0.05 * i, 0),
                         camera=turn(0.3 + 0.01 * i) @ translation(0.03 * i, 0, 0))
              for i in range(count)]
    return [noisy(with_images(frame, albedo=albedo), seed=i) for i, frame in enumerate(frames)]


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 7), (5, 1), (13, 17), (35, 50)])
def test_agrees_with_the_formula_in_float64(height, width):
    frames = moving(height, width)
    np.testing.assert_allclose(run(Bmfr(), frames), oracles.bmfr(frames), atol=5e-5)


@pytest.mark.parametrize("parameters", [
    {"alpha": 0.6}, {"alpha_fitted": 0.9}, {"block_size": 7}, {"feature_noise": 0.3},
    {"feature_noise": 0.003}, {"demodulate": False}])
def test_each_parameter_does_what_the_formula_says(parameters):
    frames = moving(20, 27)
    expected = oracles.bmfr(frames, **parameters)
    np.testing.assert_allclose(run(Bmfr(**parameters), frames), expected, atol=1e-4)
    assert np.abs(expected - oracles.bmfr(frames)).max() > 1e-3


def test_light_that_features_make_is_found():
    """A constant, normals, positions and their squares; of one object, so that all of it is one
    sum, far away from the world's origin."""
    frame = make_frame(40, 48, wall_end=1e9, origin=(3e3, -2e3, 1e3))
    x = frame["position"].astype(np.float64) - [3e3, -2e3, 1e3]
    truth = np.stack([1 + 0.1 * x[..., 0] + 0.02 * x[..., 1]**2, 2 + frame["normal"][..., 0],
                      0.5 + 0.01 * x[..., 2]**2], -1)
    image = run(Bmfr(demodulate=False, feature_noise=0.003), [with_images(frame, color=truth)])
    np.testing.assert_allclose(image, truth, rtol=2e-3)


def test_noise_in_a_block_goes_as_the_number_of_features_over_that_of_pixels():
    """On a wall, where three of the nine say something, and squares three more: 7 of 1024 at most
    of the variance stays."""
    wall = make_frame(32, 32, wall_end=1e9, board=translation(1e3, 0, 0),
                      color=np.ones((32, 32, 3)))
    error = np.mean([(run(Bmfr(demodulate=False), [noisy(wall, i, 0.3)]) - 1)**2
                     for i in range(8)])
    assert 0.09 / 1024 < error < 1.3 * 7 * 0.09 / 1024


def test_sixteen_shifts_of_which_none_comes_twice():
    stencil = Stencil(3, 3, 1)
    shifts = [tuple(int(d.numpy()[0]) for d in shift_of(i, 32, stencil)) for i in range(SHIFTS)]
    assert len(set(shifts)) == SHIFTS
    assert all(0 <= d < 32 for shift in shifts for d in shift)
    assert len({dy for dy, _ in shifts}) == len({dx for _, dx in shifts}) == SHIFTS
    again = [int(d.numpy()[0]) for d in shift_of(SHIFTS, 32, stencil)]
    assert tuple(again) == shifts[0]


def test_background_and_lamps_come_out_as_they_are():
    frame = noisy(make_frame(24, 30), seed=0)
    lamp = np.zeros((24, 30), bool)
    lamp[3:6, 4:9] = True
    images = {"albedo": np.where(lamp[..., None], 0, frame["albedo"]),
              "emission": np.where(lamp[..., None], [5.0] * 3, 0),
              "color": np.where(lamp[..., None], 5.0, frame["color"])}
    frame = with_images(frame, **images)
    image = run(Bmfr(), [frame])
    apart = lamp | (frame["id"] < 0)
    assert (frame["id"] < 0).any()
    np.testing.assert_array_equal(image[apart], frame["color"][apart])
    dark = with_images(frame, emission=0 * frame["color"], color=np.where(
        lamp[..., None], 0, frame["color"]))
    assert np.abs(image - run(Bmfr(), [dark]))[~apart].max() > 0.01  # the lamp is no black wall


def test_a_fit_goes_not_beyond_the_light_that_came():
    """Where a step of light makes the sum overshoot, and an outlier is all there is."""
    frame = make_frame(32, 32, wall_end=1e9)
    step = np.zeros((32, 32, 3))
    step[:, :4] = 1
    image = run(Bmfr(demodulate=False), [with_images(frame, color=step)])
    assert image.min() == 0
    assert 0.5 < image.max() <= 1


def test_five_frames_one_recording_and_changed_parameters_compile_nothing():
    method, frames = Bmfr(block_size=8), moving(9, 11, 5)
    state = method.init(9, 11)
    for frame in frames:
        _, state = method(frame, state)
    assert (state.accumulate.recordings, state.regress.recordings) == (1, 1)
    changed = Bmfr(0.3, 0.2, 8, 0.02, 0.8, 0.03)
    assert compiled(lambda: run(changed, frames)) == 0


def test_one_and_two_threads_give_the_same():
    frames = moving(40, 50)
    one, two = taking_turns(lambda: run(Bmfr(), frames))
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("parameters", [
    {"alpha": 0.0}, {"alpha_fitted": 1.5}, {"block_size": 3}, {"block_size": 65},
    {"feature_noise": 0.0}, {"min_cosine": 2.0}, {"plane_tolerance": 0.0}])
def test_bad_parameters_are_refused(parameters):
    with pytest.raises(InputError, match=next(iter(parameters))):
        Bmfr(**parameters)
