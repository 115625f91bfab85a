"""Laws of keyframed animation, on hand-picked and on random keys."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onespp.scenes import quaternions
from onespp.scenes.animation import (
    compose,
    orientation,
    rotation,
    scaling,
    spin,
    swing,
    track,
    translation,
)
from onespp.scenes.cameras import dolly, looking, orbit
from onespp.scenes.description import SceneError
from onespp.scenes.transforms import look_at, rotate, scale, translate

EASES = ("linear", "smooth", "spline")
UNEVEN = {0: (0, 0, 1), 3: (1, 2, 0), 10: (-1, 2, 5), 14: (0, 0, 1)}
TURNS = {0: ((0, 1, 0), 0), 4: ((1, 0, 0), 100), 11: ((1, 2, 3), 170), 15: ((0, 1, 0), 360)}

keyframes = st.lists(
    st.tuples(st.floats(-50, 50).map(lambda x: round(x, 1)), st.floats(-9, 9)),
    min_size=1, max_size=7, unique_by=lambda key: key[0]).map(lambda keys: dict(sorted(keys)))


def velocity(function, frame, side, step=1e-5):
    """One-sided derivative, second order."""
    a, b, c = (np.asarray(function(frame + side * k * step)) for k in range(3))
    return side * (4 * b - 3 * a - c) / (2 * step)


@pytest.mark.parametrize("ease", EASES)
@given(keyframes)
@settings(max_examples=40)
def test_track_passes_through_its_keys_and_holds_outside(ease, keys):
    value = track(keys, ease)
    for frame, key in keys.items():
        np.testing.assert_allclose(value(frame), key, atol=1e-12)
    first, last = min(keys), max(keys)
    assert value(first - 100) == value(first)
    assert value(last + 100) == value(last)


@given(keyframes, st.floats(0, 1))
@settings(max_examples=40)
def test_linear_track_equals_interpolation(keys, u):
    frame = min(keys) + u * (max(keys) - min(keys))
    expected = np.interp(frame, list(keys), list(keys.values()))
    np.testing.assert_allclose(track(keys, "linear")(frame), expected, atol=1e-9)


def test_smooth_track_rests_at_keys_and_stays_between_them():
    value = track(UNEVEN, "smooth")
    for frame in UNEVEN:
        for side in (-1, 1):
            np.testing.assert_allclose(velocity(value, frame, side), 0, atol=1e-3)
    between = np.array([value(frame) for frame in np.linspace(3, 10, 50)])
    assert (np.diff(between, axis=0) * (np.array(UNEVEN[10]) - UNEVEN[3]) >= 0).all()


@pytest.mark.parametrize("loop", [False, True])
def test_spline_track_has_continuous_velocity(loop):
    value = track(UNEVEN, "spline", loop)
    joints = [3, 10] + ([0, 14, 28, -14] if loop else [])
    for frame in joints:
        before, after = velocity(value, frame, -1), velocity(value, frame, 1)
        np.testing.assert_allclose(before, after, atol=1e-4)
        assert np.linalg.norm(after) > 0.1  # moving: the law is not met by resting


def test_spline_track_reproduces_a_parabola_on_uneven_frames():
    keys = {frame: 3 * frame**2 - frame + 2 for frame in (-2, 0, 1, 5, 6)}
    for frame in np.linspace(-2, 6, 30):
        assert track(keys, "spline")(frame) == pytest.approx(3 * frame**2 - frame + 2)


@pytest.mark.parametrize("ease", EASES)
def test_loop_repeats_for_ever(ease):
    value = track(UNEVEN, ease, loop=True)
    for frame in (0, 2.5, 9.75, 13.5):
        np.testing.assert_allclose(value(frame + 3 * 14), value(frame), atol=1e-12)
        np.testing.assert_allclose(value(frame - 2 * 14), value(frame), atol=1e-12)


def test_spline_loop_does_not_depend_on_the_key_that_it_starts_with():
    value = track(UNEVEN, "spline", loop=True)
    later = track({frame: UNEVEN[frame % 14] for frame in (3, 10, 14, 17)}, "spline", loop=True)
    for frame in np.linspace(0, 20, 33):
        np.testing.assert_allclose(later(frame), value(frame), atol=1e-12)


def test_rotation_counts_more_than_half_a_turn():
    turn = rotation((0, 0, 1), {0: 0, 10: 540}, "linear")
    np.testing.assert_allclose(turn(5), rotate((0, 0, 1), 270), atol=1e-12)
    np.testing.assert_allclose(turn(7.5), rotate((0, 0, 1), 405), atol=1e-12)
    np.testing.assert_allclose(turn(10), rotate((0, 0, 1), 180), atol=1e-12)


@pytest.mark.parametrize("ease", EASES)
def test_orientation_passes_through_its_keys_as_a_rotation(ease):
    turn = orientation(TURNS, ease)
    for frame, (axis, angle) in TURNS.items():
        np.testing.assert_allclose(turn(frame), rotate(axis, angle), atol=1e-12)
    for frame in np.linspace(-1, 16, 40):
        linear = turn(frame)[:3, :3]
        np.testing.assert_allclose(linear @ linear.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(linear) == pytest.approx(1)


def test_linear_orientation_turns_the_short_way_at_constant_speed():
    turn = orientation({0: ((0, 0, 1), 10), 10: ((0, 0, 1), 350)}, "linear")
    np.testing.assert_allclose(turn(2.5), rotate((0, 0, 1), 5), atol=1e-12)
    np.testing.assert_allclose(turn(7.5), rotate((0, 0, 1), -5), atol=1e-12)


@pytest.mark.parametrize("loop", [False, True])
def test_spline_orientation_has_continuous_velocity(loop):
    turn = orientation(TURNS, "spline", loop)
    for frame in (4, 11, *((0, 15) if loop else ())):
        before, after = velocity(turn, frame, -1), velocity(turn, frame, 1)
        np.testing.assert_allclose(before, after, atol=1e-5)
        assert np.linalg.norm(after) > 0.05


@given(st.lists(st.floats(-1.8, 1.8), min_size=3, max_size=3))
@settings(max_examples=50)
def test_quaternion_log_inverts_exp_and_agrees_with_rodrigues(vector):
    vector = np.array(vector)  # at most 3.12 long: less than half a turn
    q = quaternions.exp(vector)
    assert np.linalg.norm(q) == pytest.approx(1)
    np.testing.assert_allclose(quaternions.log(q), vector, atol=1e-9)
    np.testing.assert_allclose(quaternions.log(-q), vector, atol=1e-9)
    angle = np.linalg.norm(vector)
    if angle > 1e-6:
        np.testing.assert_allclose(quaternions.to_matrix(q), rotate(vector, np.degrees(angle)),
                                   atol=1e-9)


def test_quaternion_product_is_the_product_of_matrices():
    a, b = (quaternions.from_axis_angle(*key) for key in (TURNS[4], TURNS[11]))
    np.testing.assert_allclose(quaternions.to_matrix(quaternions.multiply(a, b)),
                               quaternions.to_matrix(a) @ quaternions.to_matrix(b), atol=1e-12)


def test_motions_compose_with_matrices_on_either_side():
    move, turn = translation({0: (0, 0, 0), 8: (4, 0, 2)}), spin((0, 1, 0), 7)
    grow, still = scaling({0: 1, 8: (1, 2, 3)} | {0: (1, 1, 1)}, "linear"), translate((1, 2, 3))
    for motion in (still @ move @ turn @ grow, compose(still, move, turn, grow),
                   still @ (move @ (turn @ grow)), still @ move @ turn @ (lambda f: grow(f))):
        expected = still @ translate((2, 0, 1)) @ rotate((0, 1, 0), 28) @ scale((1, 1.5, 2))
        np.testing.assert_allclose(motion(4), expected, atol=1e-12)
    np.testing.assert_allclose((turn @ still)(4), rotate((0, 1, 0), 28) @ still, atol=1e-12)


def test_swing_is_periodic_and_reaches_its_amplitude():
    pendulum = swing((0, 0, 1), 15, period=20)
    np.testing.assert_allclose(pendulum(5), rotate((0, 0, 1), 15), atol=1e-12)
    np.testing.assert_allclose(pendulum(15), rotate((0, 0, 1), -15), atol=1e-12)
    np.testing.assert_allclose(pendulum(3), pendulum(43), atol=1e-12)


@pytest.mark.parametrize("ease", EASES)
def test_orbit_keeps_its_radius_and_looks_at_the_target(ease):
    target = np.array((1.0, 2.0, 3.0))
    camera = orbit(target, 4, {0: 0, 10: 250, 30: 720}, elevation=30, ease=ease)
    for frame in np.linspace(0, 30, 13):
        matrix = camera(frame)
        np.testing.assert_allclose(np.linalg.inv(matrix) @ (*target, 1), (0, 0, 4, 1), atol=1e-12)
        assert matrix[1, 3] == pytest.approx(2 + 4 * 0.5)
    np.testing.assert_allclose(camera(0)[:3, 3], target + np.array((0, 2, 12**0.5)), atol=1e-12)


def test_dolly_moves_along_the_view_and_keeps_the_orientation():
    start = look_at((0, 1, 5), (0, 0, 0))
    camera = dolly(start, {0: 0, 10: 2})
    np.testing.assert_allclose(np.linalg.inv(start) @ camera(10), translate((0, 0, 2)), atol=1e-12)
    truck = dolly(start, {0: 0, 10: 2}, direction=(1, 0, 0))
    np.testing.assert_allclose(truck(10)[:3, 3] - start[:3, 3], 2 * start[:3, 0], atol=1e-12)


def test_looking_follows_both_paths():
    camera = looking(origin={0: (0, 1, 5), 10: (2, 1, 5)}, target={0: (0, 0, 0), 10: (1, 0, 0)},
                     ease="linear")
    np.testing.assert_allclose(camera(5), look_at((1, 1, 5), (0.5, 0, 0)), atol=1e-12)
    still = looking(origin=(0, 1, 5), target={0: (0, 0, 0), 10: (1, 0, 0)})
    np.testing.assert_allclose(still(10), look_at((0, 1, 5), (1, 0, 0)), atol=1e-12)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: track({}), "no keyframes"),
    (lambda: track([(0, 1)]), "no keyframes"),
    (lambda: track({0: 1, 10: 2, 5: 3}), "out of order"),
    (lambda: track({0: (1, 2), 10: (1, 2, 3)}), "different shapes"),
    (lambda: track({0: 1, 10: float("nan")}), "not finite"),
    (lambda: track({0: 1, 10: 2}, "bouncy"), "linear, smooth or spline"),
    (lambda: track({0: 1, 10: 2}, loop=True), "loops"),
    (lambda: track({0: 1}, loop=True), "loops"),
    (lambda: translation({0: (1, 2)}), "use 3 numbers"),
    (lambda: rotation((0, 0, 0), {0: 1}), "axis"),
    (lambda: rotation((0, 0, 1), {0: (1, 2, 3)}), "use one number"),
    (lambda: scaling({0: (1, 2)}), "use 3 numbers"),
    (lambda: orientation({0: 90}), "orientation key"),
    (lambda: orientation({}), "no keyframes"),
    (lambda: orientation({0: ((0, 0, 1), 0), 5: ((0, 0, 1), 90)}, loop=True), "loops"),
    (lambda: orbit((0, 0, 0), 0, {0: 0}), "positive radius"),
    (lambda: orbit((0, 0, 0), 1, {0: 0}, elevation=90), "-90 to 90"),
    (lambda: looking((0, 0), (1, 1, 1)), "camera origin"),
    (lambda: looking((1, 1, 1), (1, 1, 1))(0), "cannot be aimed"),
])
def test_impossible_animation_is_refused_in_one_sentence(make, words):
    with pytest.raises(SceneError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)
