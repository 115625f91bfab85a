import numpy as np
import pytest

from onespp.denoise.history.records import WORDS
from onespp.denoise.methods.svgf import Svgf
from onespp.denoise.oracles import svgf as svgf_oracle
from onespp.render.errors import InputError
from tests.support.frames import make_frame, translation, turn, with_images
from tests.support.recordings import compiled, taking_turns

PARTS = ("demodulate", "split", "accumulate", "fallback", "temporal_variance", "feedback")


def moving(height, width, count=3):
    """Frames in which camera and board move, with noisy normals, direct and indirect light."""
    frames = []
    for i in range(count):
        frame = make_frame(height, width, index=i, board=translation(0.3 * i, 0.1 * i, 0),
                           camera=translation(0.05 * i, 0, 0.1 * i) @ turn(0.01 * i))
        rng = np.random.default_rng(i)
        there = frame["id"][..., None] >= 0
        albedo = np.where(there, 0.3 + 0.5 * rng.random((height, width, 3)), 0)
        light = [scale * rng.gamma(2, 0.5, (height, width, 3)) for scale in (1.0, 0.4)]
        emission = np.where(rng.random((height, width, 1)) < 0.1, [2.0, 1.0, 0.5], 0)
        direct, indirect = (a * np.where(albedo > 0, albedo, 1) for a in light)
        normal = frame["normal"] + 0.02 * rng.normal(size=frame["normal"].shape)
        normal = np.where(there, normal, 0)
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
        frames.append(with_images(
            frame, normal=normal, albedo=albedo, emission=emission, direct=direct,
            indirect=indirect, color=emission + direct + indirect))
    return frames


def run(method, frames):
    return run_and_keep(method, frames)[0]


def run_and_keep(method, frames):
    image, state = method(frames[0], method.init(frames[0].height, frames[0].width))
    for frame in frames[1:]:
        image, state = method(frame, state)
    return image, state


def records(state):
    """(h, w, 12) of the history: length, then r, l, b, m1, m2 of each signal."""
    stencil = state.stencil
    words = state.records.numpy().reshape(stencil.height, stencil.stride, WORDS)
    return words[:, :stencil.width, 4:]


def still(count, height=24, width=28, sigma=0.2):
    """A plain wall under constant light with additive noise."""
    wall = make_frame(height, width, wall_end=1e9)
    frames = []
    for i in range(count):
        noise = np.random.default_rng(i).normal(0, sigma, (2, height, width, 1)) * [1, 1, 1]
        frames.append(with_images(wall, direct=1 + noise[0], indirect=1 + noise[1],
                                  color=2 + noise.sum(0)))
    return frames


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 7), (5, 1), (13, 17)])
def test_agrees_with_the_formula_in_float64(height, width):
    frames = moving(height, width)
    np.testing.assert_allclose(run(Svgf(), frames), svgf_oracle.svgf(frames), atol=4e-3)


@pytest.mark.parametrize("parameters", [
    *({part: False} for part in PARTS), {"levels": 2}, {"alpha": 0.6}, {"alpha_moments": 0.5},
    {"max_history_length": 1.0}, {"sigma_luminance": 3.0}, {"sigma_depth": 5.0},
    {"normal_power": 8.0}, {"min_cosine": 0.999}, {"plane_tolerance": 1e-3}])
def test_each_parameter_does_what_the_formula_says(parameters):
    frames, base = moving(14, 19, count=5), {"levels": 3, "sigma_luminance": 1.0}
    parameters = base | parameters
    result = run(Svgf(**parameters), frames)
    expected = svgf_oracle.svgf(frames, **parameters)
    close = np.isclose(result, expected, atol=4e-3).all(-1)
    assert close.mean() > 0.98  # a tap right at a test's limit may fall either way
    assert not np.allclose(result, run(Svgf(**base), frames), atol=8e-3)


def test_variance_of_the_history_falls_as_one_over_n_until_alpha_is_reached():
    """Plain mean while 1/n > alpha; after that alpha / (2 - alpha) of one frame's variance."""
    method = Svgf(feedback=False, demodulate=False, levels=1)
    state, seen = method.init(24, 28), {}
    for n, frame in enumerate(still(40), 1):
        _, state = method(frame, state)
        seen[n] = records(state)[..., 2].var()
    for n in (2, 3, 5):
        assert seen[n] == pytest.approx(0.04 / n, rel=0.15)
    assert seen[40] == pytest.approx(0.04 * 0.2 / 1.8, rel=0.15)
    assert records(state)[..., 0].max() == 32


def test_moments_become_those_of_the_light():
    method = Svgf(alpha_moments=0.02, max_history_length=100.0, demodulate=False, levels=1)
    moments = records(run_and_keep(method, still(60))[1])[..., 4:6]
    variance = moments[..., 1] - moments[..., 0]**2
    assert moments[..., 0].mean() == pytest.approx(1, abs=0.01)
    assert variance.mean() == pytest.approx(0.04, rel=0.1)


def test_a_disocclusion_starts_again():
    first, second = (make_frame(24, 32, index=i, board=translation(1.0 * i, 0, 0))
                     for i in range(2))
    uncovered = (first["id"] == 1) & (second["id"] == 0)
    inner = uncovered.copy()  # without what the 3x3 fallback reaches
    for shift, axis in ((2, 1), (-2, 1), (2, 0), (-2, 0)):
        inner &= np.roll(uncovered, shift, axis)
    assert inner.any()
    length = records(run_and_keep(Svgf(), [first, second])[1])[..., 0]
    assert (length[inner] == 1).all()
    assert (length[second["id"] == 1] == 2).mean() > 0.9
    assert (length[second["id"] < 0] == 1).all()


def test_where_no_tap_passes_the_pixels_around_give_the_history():
    """Nothing moves, so one tap has all the weight; that one shows another object."""
    previous = make_frame(12, 14, wall_end=1e9, board=translation(100, 0, 0))
    id_ = np.array(previous["id"])
    id_[5, 6] = 1
    light = np.random.default_rng(3).random((12, 14, 3))
    previous = with_images(previous, id=id_, color=light)
    frame = make_frame(12, 14, index=1, wall_end=1e9, board=translation(100, 0, 0))
    options = {"alpha": 1e-6, "feedback": False, "demodulate": False}
    with_fallback = records(run_and_keep(Svgf(**options), [previous, frame])[1])
    without = records(run_and_keep(Svgf(fallback=False, **options), [previous, frame])[1])
    assert (with_fallback[5, 6, 0], without[5, 6, 0]) == (2, 1)
    around = np.delete(light[4:7, 5:8].reshape(-1, 3), 4, axis=0).mean(0)
    np.testing.assert_allclose(with_fallback[5, 6, 1], (around[0] + frame["color"][5, 6, 0]) / 2,
                               rtol=1e-5)
    others = np.ones((12, 14), bool)
    others[5, 6] = False
    np.testing.assert_array_equal(with_fallback[others], without[others])


@pytest.mark.parametrize("signal", ["direct", "indirect", "emission"])
def test_a_bad_pixel_of_a_part_stays_one_pixel(signal):
    wall = make_frame(15, 15, wall_end=1e9)
    flat = np.full((15, 15, 3), 0.4)
    frame = with_images(wall, direct=flat, indirect=flat, emission=flat, color=3 * flat)
    bad = np.array(frame[signal])
    bad[7, 7, 1] = np.nan
    result = run(Svgf(demodulate=False), [frame, with_images(frame, **{signal: bad}), frame])
    np.testing.assert_allclose(result, 1.2, rtol=1e-5)


@pytest.mark.parametrize("options", [{}, {"demodulate": False}, {"split": False}])
def test_texture_and_emission_come_back_as_they_were(options):
    y, x = np.mgrid[:16, :16]
    albedo = np.repeat((0.2 + 0.6 * ((x + y) % 2))[..., None], 3, axis=2)
    albedo = np.full_like(albedo, 0.5) if options.get("demodulate") is False else albedo
    emission = np.repeat(np.where(x == 8, 5.0, 0.0)[..., None], 3, axis=2)
    frame = with_images(make_frame(16, 16, wall_end=1e9), direct=0.7 * albedo,
                        indirect=0.2 * albedo, albedo=albedo, emission=emission,
                        color=0.9 * albedo + emission)
    np.testing.assert_allclose(run(Svgf(**options), [frame] * 3), frame["color"], rtol=1e-5)


def test_five_frames_one_recording_a_step():
    _, state = run_and_keep(Svgf(levels=3), moving(9, 11, count=6))
    passes = state.passes
    steps = [passes.accumulate, passes.estimate_variances, passes.pack]
    for part in passes.filters:
        steps += [step for level in part.levels for step in (level.scale, level.filter)]
    assert len(passes.filters) == 2
    assert [step.recordings for step in steps] == [1] * 15


def test_changed_parameters_compile_nothing():
    frames = moving(9, 11)
    run(Svgf(levels=2), frames)
    changed = Svgf(levels=2, alpha=0.1, alpha_moments=0.3, max_history_length=8.0,
                   sigma_luminance=2.0, sigma_depth=2.0, normal_power=64.0, min_cosine=0.5,
                   plane_tolerance=0.1, temporal_variance=False)
    assert compiled(lambda: run(changed, frames)) == 0


def test_one_and_two_threads_give_the_same():
    frames = moving(40, 50)
    one, two = taking_turns(lambda: run(Svgf(), frames))
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("parameters", [
    {"levels": 0}, {"alpha": 0.0}, {"alpha_moments": 1.5}, {"max_history_length": 0.5},
    {"sigma_luminance": 0.0}, {"sigma_depth": -1.0}, {"normal_power": float("inf")},
    {"min_cosine": 2.0}, {"plane_tolerance": 0.0}])
def test_bad_parameters_are_refused(parameters):
    with pytest.raises(InputError, match=next(iter(parameters))):
        Svgf(**parameters)


def test_a_frame_of_another_sequence_is_refused():
    frame, other = make_frame(9, 9), make_frame(9, 9, index=1)
    object.__setattr__(other, "world_from_object", np.stack([np.eye(4)] * 3))
    with pytest.raises(InputError, match="3 objects"):
        run(Svgf(), [frame, other])
