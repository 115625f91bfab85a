"""`onespp compare`: changes, their noise, verdicts, thresholds and exit codes."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner

import onespp.cli
from onespp.denoise.score.compare import comparison, parse_thresholds, standard_error
from onespp.denoise.score.method_score import FrameScore, MethodScore
from onespp.denoise.score.scorecard import Scores
from onespp.render.errors import InputError

N = 40


def scores(psnr=None, ms=None, relmse=None, frames: int = N, method: str = "fine",
           **changes) -> Scores:
    """Scores of one method beside the input, from lists of its values a frame."""
    def rows(**columns) -> list[FrameScore]:
        return [FrameScore(frame=i, ms=None if ms is None or "ms" not in columns else float(ms[i]),
                           non_finite_pixels=0,
                           **{k: float(v[i]) for k, v in columns.items() if k != "ms"})
                for i in range(frames)]

    def entry(per_frame: list[FrameScore]) -> MethodScore:
        return MethodScore(ms_per_frame=None, first_ms=None, non_finite_pixels=0, device="llvm",
                           threads=1, parameters={}, versions={}, per_frame=per_frame)

    columns = {"psnr_srgb": np.full(frames, 30.0) if psnr is None else psnr, "ms": ms}
    if relmse is not None:
        columns["relmse"] = relmse
    values = {"scene": "made", "frames": list(range(frames)), "size": (4, 3), "seed": 0, "spp": 1,
              "reference_spp": 64, "reference_floor_db": None, "reference_floor_per_frame": {},
              "tone_map": "clipped sRGB", "versions": {}, "notes": [],
              "methods": {"input": entry(rows(psnr_srgb=np.full(frames, 15.0))),
                          method: entry(rows(**columns))}}
    return Scores(**{**values, **changes})


def change(a: Scores, b: Scores, measure: str = "psnr_srgb", method: str = "fine", *thresholds):
    found = comparison(a, b, None, parse_thresholds(thresholds))
    return next(c for c in found.changes if (c.method, c.measure) == (method, measure))


@pytest.fixture
def files(tmp_path):
    def write(a: Scores, b: Scores) -> list[str]:
        for name, s in (("A.json", a), ("B.json", b)):
            (tmp_path / name).write_text(s.json_text())
        return [str(tmp_path / "A.json"), str(tmp_path / "B.json")]
    return write


def noise(seed: int, size: int = N) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(size)


# The noise


def test_the_standard_error_is_that_of_independent_values():
    values = noise(0, 4000)
    assert standard_error(values) == pytest.approx(1 / math.sqrt(4000), rel=0.05)


def test_the_standard_error_covers_values_that_hang_together():
    """The mean of AR(1) noise spreads as the standard error of one run says."""
    r, n, means, errors = 0.7, 200, [], []
    for seed in range(300):
        steps, values = noise(seed, n + 50), np.zeros(n + 50)
        for t in range(1, n + 50):
            values[t] = r * values[t - 1] + steps[t]
        means.append(values[50:].mean())
        errors.append(standard_error(values[50:]))
    assert np.mean(errors) == pytest.approx(np.std(means), rel=0.15)


def test_one_value_has_no_standard_error():
    assert standard_error(np.array([1.0])) is None


def test_what_frames_have_in_common_cancels():
    hard = 5 * noise(1)  # some frames are harder, in both runs
    found = change(scores(30 + hard), scores(30.3 + hard + 0.05 * noise(2)))
    assert found.verdict == "better"
    assert found.change == pytest.approx(0.3, abs=0.05)
    assert found.error < 0.02


def test_no_change_is_found_in_noise_alone():
    verdicts = [change(scores(30 + noise(2 * s)), scores(30 + noise(2 * s + 1))).verdict
                for s in range(100)]
    assert verdicts.count("same") > 85


# Verdicts


@pytest.mark.parametrize(("measure", "values", "verdict"), [
    ("psnr_srgb", {"psnr": np.full(N, 29.0)}, "worse"),
    ("psnr_srgb", {"psnr": np.full(N, 31.0)}, "better"),
    ("relmse", {"relmse": np.full(N, 0.2)}, "worse"),
    ("relmse", {"relmse": np.full(N, 0.05)}, "better"),
    ("ms", {"ms": np.full(N, 20.0)}, "worse"),
    ("ms", {"ms": np.full(N, 5.0)}, "better"),
    ("ms", {"ms": np.full(N, 10.0)}, "same"),
])
def test_better_follows_the_measure(measure, values, verdict):
    base = {"psnr": np.full(N, 30.0), "relmse": np.full(N, 0.1), "ms": np.full(N, 10.0)}
    assert change(scores(**base), scores(**{**base, **values}), measure).verdict == verdict


def test_time_leaves_out_the_first_frame_and_is_a_ratio():
    slow_start = np.r_[1000.0, np.full(N - 1, 10.0)]
    found = change(scores(ms=np.full(N, 8.0)), scores(ms=slow_start), "ms")
    assert found.frames == N - 1
    assert found.change == pytest.approx(0.25)


def test_a_change_past_the_threshold_fails_and_one_below_does_not():
    a = scores(np.full(N, 30.0))
    assert change(a, scores(np.full(N, 29.85))).failed
    assert not change(a, scores(np.full(N, 29.95))).failed
    assert not change(a, scores(np.full(N, 29.85)), "psnr_srgb", "fine", "psnr_srgb=0.2").failed
    assert not change(a, scores(np.full(N, 35.0))).failed


def test_a_change_within_its_noise_never_fails():
    found = change(scores(30 + 3 * noise(3)), scores(29.6 + 3 * noise(4)))
    assert found.change < -0.1
    assert found.verdict == "same"
    assert not found.failed


def test_relative_thresholds_are_shares_of_what_was():
    a, b = scores(relmse=np.full(N, 0.1)), scores(relmse=np.full(N, 0.103))
    assert change(a, b, "relmse").failed
    assert not change(a, b, "relmse", "fine", "relmse=5%").failed


def test_time_fails_only_where_it_was_asked_to():
    a, b = scores(ms=np.full(N, 10.0)), scores(ms=np.full(N, 13.0))
    assert not change(a, b, "ms").failed
    assert change(a, b, "ms", "fine", "ms=20%").failed


def test_only_frames_that_both_have_are_compared():
    found = comparison(scores(), scores(frames=10))
    assert all(c.frames == 10 for c in found.changes)
    assert any("40 frames and B 10" in note for note in found.notes)


# What is refused


@pytest.mark.parametrize(("key", "value"), [("scene", "other"), ("size", (8, 8)),
                                            ("tone_map", "another")])
def test_scores_of_another_sequence_are_refused(key, value):
    with pytest.raises(InputError, match="not of one sequence"):
        comparison(scores(), scores(**{key: value}))


def test_a_difference_that_a_reader_must_know_is_noted():
    notes = comparison(scores(), scores(reference_spp=16, method="other")).notes
    assert any("references: 64 and 16" in note for note in notes)
    assert "Only A has fine." in notes
    assert "Only B has other." in notes


@pytest.mark.parametrize("text", ["psnr_srgb", "psnr_srgb=", "psnr_srgb=-1", "psnr=0.1", "ms=5",
                                  "relmse=x%"])
def test_a_threshold_that_is_none_is_refused(text):
    with pytest.raises(InputError, match="--threshold"):
        parse_thresholds((text,))


def test_an_unknown_method_is_refused():
    with pytest.raises(InputError, match="'nothing' is not in both"):
        comparison(scores(), scores(), ["nothing"])


# The command


def test_the_command_exits_1_past_a_threshold_and_says_what(files):
    paths = files(scores(np.full(N, 30.0)), scores(np.full(N, 29.0)))
    result = CliRunner().invoke(onespp.cli.app, ["compare", *paths])
    assert result.exit_code == 1
    assert "WORSE" in result.output
    assert "-1.0000" in result.output
    assert "Worse past the threshold: fine: PSNR." in result.output
    allowed = CliRunner().invoke(onespp.cli.app, ["compare", *paths, "--threshold", "psnr_srgb=2"])
    assert allowed.exit_code == 0


def test_the_command_exits_0_where_nothing_changed(files):
    result = CliRunner().invoke(onespp.cli.app, ["compare", *files(scores(), scores())])
    assert result.exit_code == 0
    assert "2 of 2 measures are the same" in result.output


def test_the_json_says_the_same_as_the_table(files, tmp_path):
    paths = files(scores(np.full(N, 30.0)), scores(np.full(N, 29.0)))
    result = CliRunner().invoke(onespp.cli.app, ["compare", *paths, "--json", "-"])
    assert result.exit_code == 1
    rows = {(c["method"], c["measure"]): c for c in json.loads(result.output)["changes"]}
    assert rows["fine", "psnr_srgb"]["change"] == -1
    assert rows["fine", "psnr_srgb"]["failed"] is True
    assert rows["input", "psnr_srgb"]["verdict"] == "same"
    CliRunner().invoke(onespp.cli.app, ["compare", *paths, "--json", str(tmp_path / "c.json")])
    assert json.loads((tmp_path / "c.json").read_text()) == json.loads(result.output)


@pytest.mark.parametrize("name", ["", "/"])
def test_the_json_needs_the_name_of_a_file(files, name):
    paths = files(scores(), scores())
    result = CliRunner().invoke(onespp.cli.app, ["compare", *paths, "--json", name])
    assert isinstance(result.exception, InputError)
    assert "no name for a file" in str(result.exception)
