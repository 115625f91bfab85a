import drjit as dr
import numpy as np
import pytest

from onespp.denoise.filters.color_box import RowPass, window_moments
from onespp.denoise.jit.arrays import Color
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.temporal import Temporal
from onespp.denoise.oracles import filters as oracles
from onespp.render.errors import InputError
from tests.support.frames import make_frame, noisy, translation, turn, with_images
from tests.support.recordings import compiled, taking_turns


def run(method, frames):
    state = method.init(frames[0].height, frames[0].width)
    for frame in frames:
        image, state = method(frame, state)
    return image


def moments(color, radius):
    height, width, _ = color.shape
    stencil = Stencil(height, width, radius)
    lanes = [x + 0 for x in stencil.load(color.astype(np.float32))]
    dr.eval(lanes)
    along_rows = RowPass.make(stencil, radius)
    mean, sigma = window_moments(stencil, along_rows.rows_around(along_rows(Color(*lanes))))
    return stencil.image(mean), stencil.image(sigma)


@pytest.mark.parametrize(("height", "width", "radius"),
                         [(1, 1, 3), (1, 7, 3), (5, 1, 3), (13, 17, 3), (12, 9, 1), (10, 11, 5)])
@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_window_moments_count_only_what_is_inside_and_keep_digits(height, width, radius, offset):
    color = np.random.default_rng(0).random((height, width, 3)).astype(np.float32) + offset
    color = color.astype(np.float32)
    mean, sigma = moments(color, radius)
    low, high = oracles.clamp_box(color, radius, 1.0)
    np.testing.assert_allclose(mean, (low + high) / 2, rtol=3e-7, atol=1e-6)
    np.testing.assert_allclose(sigma, (high - low) / 2, rtol=5e-3 if offset else 1e-5, atol=1e-6)


@pytest.mark.parametrize("parameters",
                         [{}, {"alpha": 0.5}, {"color_box": 0.2}, {"clamp_radius": 1}])
def test_two_frames_agree_with_the_formula_in_float64(parameters):
    first = noisy(make_frame(19, 23), seed=1)
    second = noisy(make_frame(19, 23, index=1, camera=translation(0.1, 0, 0.1) @ turn(0.02),
                              board=translation(0.2, 0, 0)), seed=2)
    result = run(Temporal(**parameters), [first, second])
    history = oracles.reproject_bilinear(first, second, first["color"])
    names = {"color_box": "k", "clamp_radius": "radius"}
    expected = oracles.accumulate(second["color"], history,
                                  **{names.get(k, k): v for k, v in parameters.items()})
    close = np.isclose(result, expected, atol=2e-3).all(-1)
    assert close.mean() > 0.995  # a tap right at a test's limit may fall either way


def test_a_tap_is_tested_at_its_own_pixel():
    """On a board that is not frontal, neighbours lie on the tangent plane, at other depths."""
    board = turn(0.3)
    first = noisy(make_frame(19, 23, board=board), seed=1)
    second = noisy(make_frame(19, 23, index=1, camera=translation(0.1, 0.05, 0), board=board),
                   seed=2)
    history = oracles.reproject_bilinear(first, second, first["color"], plane_tolerance=1e-4)
    result = run(Temporal(plane_tolerance=1e-4), [first, second])
    on_board = second["id"] == 1
    assert np.isfinite(history[on_board]).all(-1).mean() > 0.5
    close = np.asarray(np.isclose(result, oracles.accumulate(second["color"], history), atol=2e-3))
    assert close[on_board].all(-1).mean() > 0.98


def test_the_first_frame_comes_out_as_it_is():
    frame = noisy(make_frame(9, 11))
    np.testing.assert_array_equal(run(Temporal(), [frame]), frame["color"])


def test_a_constant_wall_stays_constant_up_to_the_border():
    frames = [with_images(make_frame(12, 15, index=i), color=np.full((12, 15, 3), 0.7))
              for i in range(6)]
    np.testing.assert_allclose(run(Temporal(), frames), 0.7, rtol=1e-6)


def test_variance_of_a_still_scene_falls_to_its_limit():
    """An average with weight alpha keeps alpha / (2 - alpha) of the variance."""
    still = make_frame(40, 40, wall_end=1e9)
    generator = np.random.default_rng(5)
    frames = [with_images(still, color=1 + generator.normal(0, 0.1, (40, 40, 3)))
              for _ in range(30)]
    result = run(Temporal(color_box=100.0), frames)
    assert result.var() == pytest.approx(0.01 * 0.2 / 1.8, rel=0.1)


def test_history_is_clamped_to_the_current_neighbourhood():
    bright, dark = (with_images(make_frame(9, 9, index=i), color=np.full((9, 9, 3), v))
                    for i, v in enumerate((1.0, 0.25)))
    np.testing.assert_allclose(run(Temporal(), [bright, dark]), 0.25, rtol=1e-6)


def test_a_disocclusion_starts_again():
    first = make_frame(24, 32)
    second = noisy(make_frame(24, 32, index=1, board=translation(1.0, 0, 0)))
    uncovered = (first["id"] == 1) & (second["id"] == 0)
    assert uncovered.any()
    result = run(Temporal(), [first, second])
    np.testing.assert_array_equal(result[uncovered], second["color"][uncovered])


def test_five_frames_one_recording():
    method = Temporal()
    state = method.init(9, 11)
    for i in range(6):
        frame = noisy(make_frame(9, 11, index=i, camera=translation(0.1 * i, 0, 0)), seed=i)
        _, state = method(frame, state)
    assert state.clamp_and_blend.recordings == 1


def test_changed_parameters_compile_nothing():
    frames = [noisy(make_frame(9, 11, index=i), seed=i) for i in range(2)]
    run(Temporal(), frames)
    changed = Temporal(alpha=0.4, color_box=2.0, min_cosine=0.5, plane_tolerance=0.1)
    assert compiled(lambda: run(changed, frames)) == 0


def test_one_and_two_threads_give_the_same():
    frames = [noisy(make_frame(40, 50, index=i, camera=translation(0.1 * i, 0, 0)), seed=i)
              for i in range(3)]
    one, two = taking_turns(lambda: run(Temporal(), frames))
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("parameters", [{"alpha": 0.0}, {"alpha": 1.5}, {"clamp_radius": 0},
                                        {"color_box": -1.0}, {"min_cosine": 2.0},
                                        {"plane_tolerance": 0.0}])
def test_bad_parameters_are_refused(parameters):
    with pytest.raises(InputError, match=next(iter(parameters))):
        Temporal(**parameters)


def test_a_frame_of_another_sequence_is_refused():
    frame = make_frame(9, 9)
    other = make_frame(9, 9, index=1)
    object.__setattr__(other, "world_from_object", np.stack([np.eye(4)] * 3))
    method = Temporal()
    _, state = method(frame, method.init(9, 9))
    with pytest.raises(InputError, match="3 objects"):
        method(other, state)
