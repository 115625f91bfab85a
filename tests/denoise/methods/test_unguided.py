import numpy as np
import pytest

from onespp.denoise.methods.bilateral import Bilateral
from onespp.denoise.methods.unguided.bilateral_color import BilateralColor
from onespp.denoise.methods.unguided.gaussian import Gaussian
from onespp.denoise.methods.unguided.gaussian_separable import GaussianSeparable
from onespp.denoise.oracles import filters as oracles
from onespp.render.errors import InputError
from tests.support.frames import make_frame, noisy, with_images
from tests.support.recordings import compiled, taking_turns

SIZES = pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 7), (5, 1), (13, 17), (24, 31)])
gaussians = pytest.mark.parametrize("kind", [Gaussian, GaussianSeparable])
filters = pytest.mark.parametrize("kind", [Gaussian, GaussianSeparable, BilateralColor])


def run(method, frame):
    return method(frame, method.init(frame.height, frame.width))[0]


@gaussians
@SIZES
def test_a_gaussian_agrees_with_the_formula_in_float64(kind, height, width):
    frame = noisy(make_frame(height, width))
    np.testing.assert_allclose(run(kind(), frame), oracles.gaussian(frame), rtol=2e-6)


@SIZES
def test_the_bilateral_filter_agrees_with_the_formula_in_float64(height, width):
    frame = noisy(make_frame(height, width))
    expected = oracles.bilateral_color(frame)
    np.testing.assert_allclose(run(BilateralColor(), frame), expected, atol=2e-4)


@gaussians
@pytest.mark.parametrize("parameters", [{"radius": 2}, {"sigma_coord": 0.7}, {"sigma_coord": 50.0},
                                        {"radius": 20, "sigma_coord": 9.0}])
def test_each_parameter_of_a_gaussian_does_what_the_formula_says(kind, parameters):
    frame = noisy(make_frame(17, 19))
    expected = oracles.gaussian(frame, **parameters)
    np.testing.assert_allclose(run(kind(**parameters), frame), expected, rtol=2e-6)


@pytest.mark.parametrize("parameters", [{"radius": 2}, {"sigma_color": 5.0}, {"sigma_coord": 1.5},
                                        {"sigma_color": 0.05}])
def test_each_parameter_of_the_bilateral_filter_does_what_the_formula_says(parameters):
    frame = noisy(make_frame(17, 19))
    expected = oracles.bilateral_color(frame, **parameters)
    np.testing.assert_allclose(run(BilateralColor(**parameters), frame), expected, atol=5e-4)


@pytest.mark.parametrize("radius", [1, 12, 30])
def test_two_passes_equal_the_window_to_rounding(radius):
    """Also where the window is larger than the image, and for colours of 1e-3 to 1e4."""
    frame = noisy(make_frame(25, 33), sigma=1.5)
    frame = with_images(frame, color=frame["color"] * np.geomspace(1e-3, 1e4, 33)[:, None])
    sizes = {"radius": radius, "sigma_coord": radius / 3}
    np.testing.assert_allclose(run(GaussianSeparable(**sizes), frame),
                               run(Gaussian(**sizes), frame), rtol=3e-6)


def test_with_any_colour_alike_the_bilateral_filter_is_the_gaussian():
    frame, sizes = noisy(make_frame(17, 19)), {"radius": 5, "sigma_coord": 2.0}
    np.testing.assert_allclose(run(BilateralColor(**sizes, sigma_color=1e6), frame),
                               run(Gaussian(**sizes), frame), rtol=2e-4)


def test_without_guides_that_differ_the_joint_filter_is_the_bilateral():
    frame = noisy(make_frame(15, 18))
    flat = with_images(frame, id=np.full((15, 18), -1))
    np.testing.assert_allclose(run(Bilateral(), flat), run(BilateralColor(), frame), atol=1e-4)


def test_a_gaussian_blurs_an_edge_that_the_bilateral_filter_keeps_until_noise_hides_it():
    color = np.where(np.arange(24)[None, :, None] < 12, [0.1] * 3, 2.1) * np.ones((20, 1, 1))
    clean = with_images(make_frame(20, 24), color=color)
    sizes = {"radius": 6, "sigma_coord": 3.0}

    def step_left(method, frame):
        image = run(method, frame)[..., 1].mean(0)
        return (image[12] - image[11]) / 2

    assert step_left(Gaussian(**sizes), clean) < 0.2
    assert step_left(BilateralColor(**sizes), clean) > 0.95
    faint = with_images(clean, color=0.1 * color)
    assert step_left(BilateralColor(**sizes), faint) < 0.1 * 0.3


@filters
def test_huge_but_finite_radiance_gives_finite_output(kind):
    color = np.array(make_frame(9, 9)["color"])
    color[4, 4], color[5, 5] = 3e37, 1e17
    assert np.isfinite(run(kind(), with_images(make_frame(9, 9), color=color))).all()


@filters
def test_five_frames_one_recording_a_pass(kind):
    method = kind(radius=3)
    state = method.init(9, 11)
    for i in range(5):
        _, state = method(noisy(make_frame(9, 11), seed=i), state)
    steps = [line.step for line in state.lines]
    assert {step.recordings for step in steps} == {1}


@filters
def test_changed_parameters_compile_nothing(kind):
    frame = noisy(make_frame(9, 11))
    for _ in range(2):
        run(kind(radius=3), frame)
    color = {"sigma_color": 0.1} if kind is BilateralColor else {}
    assert compiled(lambda: run(kind(radius=3, sigma_coord=7.0, **color), frame)) == 0


@filters
def test_one_and_two_threads_give_the_same(kind):
    frame = noisy(make_frame(40, 50))
    one, two = taking_turns(lambda: run(kind(radius=4), frame))
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize(("kind", "parameters"), [
    (Gaussian, {"radius": 0}), (Gaussian, {"sigma_coord": 0.0}),
    (GaussianSeparable, {"radius": 65}), (BilateralColor, {"radius": 2.5}),
    (BilateralColor, {"sigma_color": -1.0}), (BilateralColor, {"sigma_coord": float("nan")})])
def test_bad_parameters_are_refused(kind, parameters):
    with pytest.raises(InputError, match=next(iter(parameters))):
        kind(**parameters)
