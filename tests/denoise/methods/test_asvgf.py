from typing import Any

import numpy as np
import pytest

from onespp.denoise.methods.asvgf import Asvgf, gather_strata
from onespp.denoise.methods.svgf import Svgf
from onespp.denoise.oracles import svgf as svgf_oracle
from onespp.render.errors import InputError
from tests.support.frames import make_frame, with_images
from tests.support.made_sequence import make_sequence

from .test_svgf import moving, records, run, run_and_keep, still

H, W = 24, 28
PLAIN: dict[str, Any] = {"demodulate": False, "feedback": False, "levels": 1}


def with_change(frame, direct=1.0, indirect=1.0):
    """The frame with one sample in each stratum, whose lights changed by these factors."""
    before = np.full((frame.height, frame.width, 2), -1.0)
    before[1::3, 1::3] = 0.7, 0.4
    now = np.where(before < 0, -1, before * [direct, indirect])
    return with_images(frame, replay=now, replay_before=before)


def test_without_a_change_it_is_svgf_with_its_alphas():
    frames = moving(13, 17, count=5)
    unchanged = [with_change(f) for f in frames]
    same: dict[str, Any] = {"alpha": 0.2, "alpha_indirect": 0.2, "max_history_length": 32.0}
    np.testing.assert_allclose(run(Asvgf(**same), unchanged), run(Svgf(), frames), rtol=2e-4)
    np.testing.assert_allclose(run(Asvgf(**same), frames), run(Svgf(), frames), rtol=2e-4)


@pytest.mark.parametrize("parameters", [{}, {"gradient_levels": 1}, {"gradient_scale": 3.0},
                                        {"alpha_indirect": 0.6}, {"max_history_length": 2.0}])
def test_agrees_with_the_formula_in_float64(parameters):
    rng, frames = np.random.default_rng(5), []
    for frame in moving(14, 19, count=5):
        before = np.where(rng.random((14, 19, 1)) < 0.15, rng.gamma(2, 0.5, (14, 19, 2)), -1)
        now = np.where(before < 0, -1, before * rng.uniform(0.85, 1.15, before.shape))
        frames.append(with_images(frame, replay=now, replay_before=before))
    close = np.isclose(run(Asvgf(**parameters), frames),
                       svgf_oracle.asvgf(frames, **parameters), atol=4e-3).all(-1)
    assert close.mean() > 0.98  # a tap right at a test's limit may fall either way


def test_a_change_in_full_starts_the_history_of_that_light_again():
    *first, last = still(4, H, W)
    _, state = run_and_keep(Asvgf(**PLAIN), [*first, with_change(last, direct=1e-4)])
    kept = records(state)
    assert kept[..., 0].max() < 1.001          # direct: as on the first frame
    assert kept[..., 1].min() == 4             # indirect goes on
    np.testing.assert_allclose(kept[..., 2], last["direct"][..., 0], atol=1e-3)
    assert kept[..., 7].var() == pytest.approx(0.04 / 4, rel=0.25)


@pytest.mark.parametrize(("factor", "scale"), [(0.8, 1.0), (1.25, 1.0), (0.9, 2.0)])
def test_lengths_shrink_by_the_tenth_power(factor, scale):
    """The relative change is 0.2 in each case here."""
    *first, last = still(4, H, W)
    method = Asvgf(gradient_scale=scale, **PLAIN)
    _, state = run_and_keep(method, [*first, with_change(last, direct=factor)])
    np.testing.assert_allclose(records(state)[..., 0], 3 * 0.8**10 + 1, rtol=1e-4)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_change_stays_where_it_is(axis):
    *first, last = still(4, 90, 90)
    changed = with_change(last, direct=0.01)
    there = (np.mgrid[:90, :90][axis] < 30)[..., None]
    now = np.where(there, changed["replay"], changed["replay_before"])
    method = Asvgf(gradient_levels=2, **PLAIN)
    length = records(run_and_keep(method, [*first, with_images(changed, replay=now)])[1])[..., 0]
    length = np.moveaxis(length, axis, 0)
    assert length[:9, 9:81].max() < 1.1
    assert length[51:].min() == 4              # farther than 2 (1 + 2) strata


def test_it_follows_a_lamp_that_is_switched_off():
    frames = still(8, H, W, sigma=0.05)
    dark = [with_images(f, direct=0.1 * f["direct"], indirect=0.1 * f["indirect"],
                        color=0.1 * f["color"]) for f in frames[4:]]
    dark[0] = with_change(dark[0], 0.1, 0.1)
    sequence = [with_change(f) for f in frames[:4]] + [dark[0]]
    adaptive = run(Asvgf(demodulate=False), sequence)
    plain = run(Svgf(demodulate=False, alpha=0.02), sequence)
    assert adaptive.mean() == pytest.approx(0.2, rel=0.1)
    assert plain.mean() > 0.4


def test_strata_add_up_samples_and_skip_what_is_none():
    now, before = np.full((4, 5, 2), -1.0), np.full((4, 5, 2), -1.0)
    now[0, 0], before[0, 0] = (1, 4), (3, 2)
    now[2, 1], before[2, 1] = (5, 1), (4, 1)
    now[3, 4], before[3, 4] = (np.nan, 1), (1, 1)
    sums = gather_strata(now, before, 2)
    assert sums.shape == (2, 2, 4)
    np.testing.assert_array_equal(sums[0, 0], [-1, 2, 8, 5])
    assert (sums.reshape(-1, 4)[1:] == 0).all()
    np.testing.assert_array_equal(gather_strata(now, before, 1)[0, 0], [1, 1, 11, 11])


def test_five_frames_one_recording_a_step():
    frames = [with_change(f, 0.9) for f in moving(9, 11, count=5)]
    _, state = run_and_keep(Asvgf(levels=2), frames)
    steps = [*state.gradients.steps, state.gradients.spread, state.passes.accumulate,
             state.passes.estimate_variances, state.passes.pack]
    assert [step.recordings for step in steps] == [1] * 7


def test_frames_without_the_samples_are_refused_with_what_to_do(tmp_path, call):
    folder = make_sequence(tmp_path / "made").folder
    code, _, err = call("denoise", folder, "--method", "asvgf")
    assert (code, "render it with --channels +gradient" in err) == (2, True)


@pytest.mark.parametrize("options", [{"alpha_indirect": 0.0}, {"gradient_levels": 9},
                                     {"gradient_scale": 0.0}, {"levels": 0}])
def test_bad_parameters_are_refused(options):
    with pytest.raises(InputError, match=next(iter(options))):
        Asvgf(**options)


def test_an_import_is_one_signal():
    frame = make_frame(9, 11)
    result = run(Asvgf(), [with_change(frame), with_change(frame, 0.5, 0.5)])
    assert result.shape == (9, 11, 3)
    assert np.isfinite(result).all()


def test_samples_that_rise_and_fall_alike_change_nothing():
    """Noise of the gradients: F filters differences with their sign, of which none is left."""
    *first, last = still(4, 48, 48)
    changed = with_change(last, direct=1.4)
    rises = (np.mgrid[:48, :48].sum(0) // 3 % 2 == 0)[..., None]
    falls = np.where(changed["replay_before"] < 0, -1, changed["replay_before"] * [0.6, 1])
    noisy = with_images(changed, replay=np.where(rises, changed["replay"], falls))
    length = records(run_and_keep(Asvgf(**PLAIN), [*first, noisy])[1])[12:36, 12:36, 0]
    assert length.min() > 3.9
