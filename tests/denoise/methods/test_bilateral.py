import numpy as np
import pytest

from onespp.denoise.methods.bilateral import ACOS2, Bilateral
from onespp.denoise.oracles import filters as oracles
from onespp.render.errors import InputError
from tests.support.frames import make_frame, noisy, with_images
from tests.support.recordings import compiled, taking_turns


def run(method, frame):
    return method(frame, method.init(frame.height, frame.width))[0]


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 7), (5, 1), (13, 17), (24, 31)])
def test_agrees_with_the_formula_in_float64(height, width):
    frame = noisy(make_frame(height, width))
    np.testing.assert_allclose(run(Bilateral(), frame), oracles.bilateral(frame), atol=2e-4)


@pytest.mark.parametrize("parameters", [
    {"radius": 2}, {"sigma_color": 5.0}, {"sigma_normal": 1.0}, {"sigma_plane": 2.0},
    {"sigma_coord": 1.5}, {"sigma_normal": 0.02, "sigma_plane": 0.02, "sigma_color": 0.05}])
def test_each_parameter_does_what_the_formula_says(parameters):
    frame = noisy(make_frame(17, 19))
    result = run(Bilateral(**parameters), frame)
    np.testing.assert_allclose(result, oracles.bilateral(frame, **parameters), atol=5e-4)


def test_curved_normals_agree_with_the_formula():
    frame = make_frame(16, 16, wall_end=1e9)
    y, x = np.mgrid[:16, :16]
    normal = np.stack([0.1 * (x - 8), 0.07 * (y - 8), -np.ones_like(x)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    frame = noisy(with_images(frame, normal=normal))
    for sigma in (0.1, 0.5, 1.0):
        result = run(Bilateral(sigma_normal=sigma, sigma_plane=1.0), frame)
        expected = oracles.bilateral(frame, sigma_normal=sigma, sigma_plane=1.0)
        np.testing.assert_allclose(result, expected, atol=5e-4)


def test_error_of_the_squared_angle_is_as_stated():
    t = np.linspace(1e-4, 1, 10001)
    fitted = t * np.polynomial.polynomial.polyval(t, ACOS2)
    assert (np.abs(fitted / np.arccos(1 - t)**2 - 1) < 0.0026 * (t + 0.02)).all()


def test_bright_pixels_keep_their_digits():
    """Differences of colours are taken before squares, so a radiance of 1e4 weighs as it should."""
    frame = make_frame(12, 12)
    bright = with_images(frame, color=frame["color"] + 1e4)
    result = run(Bilateral(), bright)
    np.testing.assert_allclose(result - 1e4, oracles.bilateral(bright) - 1e4, atol=0.02)


def test_huge_but_finite_radiance_gives_finite_output():
    color = np.array(make_frame(9, 9)["color"])
    color[4, 4] = 3e37
    color[5, 5] = 1e17
    assert np.isfinite(run(Bilateral(), with_images(make_frame(9, 9), color=color))).all()


def test_background_neither_gives_nor_takes():
    frame = make_frame(16, 24, wall_end=0.0)
    background = frame["id"] < 0
    color = np.where(background[..., None], [1.0] * 3, 0.2)
    result = run(Bilateral(sigma_color=100.0, sigma_normal=5.0, sigma_plane=5.0),
                 with_images(frame, color=color))
    assert background.any()
    np.testing.assert_allclose(result, color, atol=1e-6)


def test_background_takes_from_all_when_not_isolated():
    frame = make_frame(16, 24, wall_end=0.0)
    background = frame["id"] < 0
    color = np.where(background[..., None], [1.0] * 3, 0.2)
    result = run(Bilateral(sigma_color=100.0, isolate_background=False),
                 with_images(frame, color=color))
    assert result[background].min() < 0.9
    np.testing.assert_allclose(result[~background], 0.2, atol=1e-6)


def test_demodulated_filter_keeps_a_texture():
    frame = make_frame(16, 16, wall_end=1e9)
    y, x = np.mgrid[:16, :16]
    albedo = np.repeat((0.2 + 0.6 * ((x + y) % 2))[..., None], 3, axis=2)
    frame = with_images(frame, color=0.7 * albedo, albedo=albedo)
    np.testing.assert_allclose(run(Bilateral(demodulate=True), frame), 0.7 * albedo, rtol=1e-5)
    assert np.abs(run(Bilateral(), frame) - 0.7 * albedo).max() > 0.05


def test_five_frames_one_recording():
    method = Bilateral(radius=3)
    state = method.init(9, 11)
    for i in range(5):
        _, state = method(noisy(make_frame(9, 11), seed=i), state)
    assert {line.step.recordings for line in state.lines} == {1}


def test_changed_parameters_compile_nothing():
    frame = noisy(make_frame(9, 11))
    run(Bilateral(radius=3), frame)
    run(Bilateral(radius=3), frame)
    changed = Bilateral(radius=3, sigma_coord=7.0, sigma_color=0.1, sigma_normal=0.3,
                        sigma_plane=0.2)
    assert compiled(lambda: run(changed, frame)) == 0
    assert compiled(lambda: run(Bilateral(radius=7), frame)) > 0


def test_one_and_two_threads_give_the_same():
    frame = noisy(make_frame(40, 50))
    one, two = taking_turns(lambda: run(Bilateral(radius=4), frame))
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("parameters", [{"radius": 0}, {"radius": 2.5}, {"sigma_color": 0.0},
                                        {"sigma_plane": -1.0}, {"sigma_normal": float("nan")}])
def test_bad_parameters_are_refused(parameters):
    with pytest.raises(InputError, match=next(iter(parameters))):
        Bilateral(**parameters)


def test_state_of_another_size_is_refused():
    method = Bilateral(radius=2)
    with pytest.raises(InputError, match=r"is 11x9, .* made for 12x9"):
        method(make_frame(9, 11), method.init(9, 12))
