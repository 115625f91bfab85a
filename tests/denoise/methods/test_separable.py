import numpy as np
import pytest

from onespp.denoise.methods.separable import BilateralSeparable
from onespp.denoise.oracles import filters as oracles
from tests.support.frames import make_frame, noisy
from tests.support.recordings import compiled, taking_turns


def run(method, frame):
    return method(frame, method.init(frame.height, frame.width))[0]


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 7), (5, 1), (13, 17), (24, 41)])
def test_agrees_with_the_formula_in_float64(height, width):
    frame = noisy(make_frame(height, width))
    expected = oracles.bilateral_separable(frame)
    np.testing.assert_allclose(run(BilateralSeparable(), frame), expected, atol=2e-4)


@pytest.mark.parametrize("parameters", [
    {"radius": 2}, {"sigma_color": 5.0}, {"sigma_plane": 2.0}, {"sigma_coord": 1.5},
    {"sigma_normal": 2.0, "sigma_color": 5.0, "sigma_plane": 5.0}])
def test_each_parameter_does_what_the_formula_says(parameters):
    frame = noisy(make_frame(17, 19))
    expected = oracles.bilateral_separable(frame, **parameters)
    np.testing.assert_allclose(run(BilateralSeparable(**parameters), frame), expected, atol=5e-4)


def test_five_frames_one_recording_a_pass():
    method = BilateralSeparable(radius=3)
    state = method.init(9, 11)
    for i in range(5):
        _, state = method(noisy(make_frame(9, 11), seed=i), state)
    assert [line.step.recordings for line in state.lines] == [1, 1]


def test_changed_parameters_compile_nothing():
    frame = noisy(make_frame(9, 11))
    for _ in range(2):
        run(BilateralSeparable(radius=3), frame)
    changed = BilateralSeparable(radius=3, sigma_coord=7.0, sigma_color=0.1, sigma_normal=0.3,
                                 sigma_plane=0.2)
    assert compiled(lambda: run(changed, frame)) == 0


def test_one_and_two_threads_give_the_same():
    frame = noisy(make_frame(40, 50))
    one, two = taking_turns(lambda: run(BilateralSeparable(), frame))
    np.testing.assert_array_equal(one, two)
