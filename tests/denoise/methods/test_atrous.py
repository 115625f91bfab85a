import drjit as dr
import numpy as np
import pytest

from onespp.denoise.filters.atrous import estimate_variance
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.atrous import Atrous
from onespp.denoise.oracles import filters as oracles
from onespp.render.errors import InputError
from tests.support.frames import make_frame, noisy, with_images
from tests.support.recordings import compiled, taking_turns


def run(method, frame):
    return method(frame, method.init(frame.height, frame.width))[0]


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 7), (5, 1), (13, 17), (31, 40)])
def test_agrees_with_the_formula_in_float64(height, width):
    frame = noisy(make_frame(height, width))
    result = run(Atrous(demodulate=False), frame)
    np.testing.assert_allclose(result, oracles.atrous(frame), atol=2e-3)


@pytest.mark.parametrize("parameters", [
    {"levels": 1}, {"levels": 3}, {"sigma_luminance": 1.0}, {"sigma_plane": 0.05},
    {"normal_power": 8.0}])
def test_each_parameter_does_what_the_formula_says(parameters):
    frame = noisy(make_frame(21, 26))
    result = run(Atrous(demodulate=False, **parameters), frame)
    np.testing.assert_allclose(result, oracles.atrous(frame, **parameters), atol=2e-3)


def test_the_distance_from_the_tangent_plane_counts_as_the_formula_says():
    """Normals that lean this way and that, so that neighbours lie off each other's planes."""
    frame = noisy(make_frame(21, 26))
    normal = frame["normal"] + np.random.default_rng(4).normal(0, 0.15, frame["normal"].shape)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    frame = with_images(frame, normal=np.where(frame["id"][..., None] >= 0, normal, 0))
    settings = {"normal_power": 2.0, "sigma_plane": 0.003, "sigma_luminance": 40.0}
    result = run(Atrous(demodulate=False, **settings), frame)
    np.testing.assert_allclose(result, oracles.atrous(frame, **settings), atol=2e-3)


def test_one_level_on_a_plain_wall_is_the_b3_spline():
    """Without edges, and with luminance differences that do not count, only h is left."""
    frame = make_frame(11, 11, wall_end=1e9, board=np.diag([1, 1, -1.0, 1]))
    color = np.zeros((11, 11, 3))
    color[5, 5] = 1.0
    result = run(Atrous(levels=1, sigma_luminance=1e9, demodulate=False),
                 with_images(frame, color=color))
    h = np.array([1, 4, 6, 4, 1]) / 16
    np.testing.assert_allclose(result[3:8, 3:8, 1], np.outer(h, h), atol=1e-4)
    assert np.abs(result[:3]).max() < 1e-6


def test_each_level_filters_the_last_ones_output():
    """On a plain wall two levels are the spline convolved with itself spread out by two."""
    frame = make_frame(19, 19, wall_end=1e9, board=np.diag([1, 1, -1.0, 1]))
    color = np.zeros((19, 19, 3))
    color[9, 9] = 1.0
    result = run(Atrous(levels=2, sigma_luminance=1e9, demodulate=False),
                 with_images(frame, color=color))
    h = np.array([1, 4, 6, 4, 1]) / 16
    spread = np.zeros(9)
    spread[::2] = h
    both = np.convolve(h, spread)
    np.testing.assert_allclose(result[3:16, 3:16, 0], np.outer(both, both), atol=1e-4)


def test_variance_of_a_window_is_that_of_the_pixels_on_the_plane():
    frame = noisy(make_frame(16, 18))
    method = Atrous()
    state = method.init(16, 18)
    seen = {}

    def spy(*arguments):
        seen["variance"] = estimate_variance(*arguments)
        dr.eval(seen["variance"])
        return seen["variance"]

    object.__setattr__(state, "variance_step", spy)
    Atrous(demodulate=False)(frame, state)
    stencil: Stencil = state.stencil
    expected = oracles.window_variance(frame, oracles.luminance(frame["color"]), 0.01)
    np.testing.assert_allclose(stencil.image([seen["variance"]]), expected, rtol=1e-3, atol=1e-5)


def test_noise_falls_and_edges_stay():
    clean = make_frame(48, 64)
    frame = noisy(clean)
    result = run(Atrous(demodulate=False), frame)
    before = np.mean((frame["color"] - clean["color"])**2)
    assert np.mean((result - clean["color"])**2) < before / 4


def test_demodulated_filter_keeps_texture_and_emission():
    frame = make_frame(16, 16, wall_end=1e9)
    y, x = np.mgrid[:16, :16]
    albedo = np.repeat((0.2 + 0.6 * ((x + y) % 2))[..., None], 3, axis=2)
    emission = np.repeat(np.where(x == 8, 5.0, 0.0)[..., None], 3, axis=2)
    frame = with_images(frame, color=0.7 * albedo + emission, albedo=albedo, emission=emission)
    np.testing.assert_allclose(run(Atrous(), frame), frame["color"], rtol=1e-5)


def test_five_frames_one_recording_a_step():
    method = Atrous(levels=3)
    state = method.init(9, 11)
    for i in range(5):
        _, state = method(noisy(make_frame(9, 11), seed=i), state)
    steps = [state.variance_step, *(level.step for level in state.levels)]
    assert [step.recordings for step in steps] == [1] * 4


def test_changed_parameters_and_further_levels_compile_nothing():
    frame = noisy(make_frame(9, 11))
    run(Atrous(levels=2), frame)
    changed = Atrous(levels=2, sigma_luminance=2.0, sigma_plane=0.03, normal_power=64.0)
    assert compiled(lambda: run(changed, frame)) == 0
    state = Atrous(levels=2).init(9, 11)
    assert compiled(lambda: Atrous(levels=2)(frame, state)) == 0


def test_one_and_two_threads_give_the_same():
    frame = noisy(make_frame(40, 50))
    one, two = taking_turns(lambda: run(Atrous(), frame))
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("parameters", [{"levels": 0}, {"levels": 9}, {"levels": 1.5},
                                        {"sigma_luminance": 0.0}, {"normal_power": float("inf")}])
def test_bad_parameters_are_refused(parameters):
    with pytest.raises(InputError, match=next(iter(parameters))):
        Atrous(**parameters)
