"""Bias and variance over seeds, of errors that are known."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from onespp.denoise.metrics.tonemap import linear_from_srgb
from onespp.denoise.report.terminal import print_splits
from onespp.denoise.score.bias_variance import split_errors
from onespp.denoise.score.scorecard import INPUT, read_scores
from onespp.denoise.score.sequence import score
from onespp.render.errors import InputError
from onespp.render.files.manifest import Manifest, Run
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.frame import Frame

H, W, FRAMES = 40, 50, 2
BIAS, SIGMA, NOISE = 0.03, 0.05, 0.02  # display values


def display(i: int) -> np.ndarray:
    return np.random.default_rng(i).uniform(0.4, 0.6, (H, W, 3))


def linear(image: np.ndarray) -> np.ndarray:
    return linear_from_srgb(image).astype(np.float32)


def render(folder: Path, seed: int, bias: float = BIAS, noise: float = 0.0,
           method: str = "mine") -> FrameSequence:
    """Results that are `bias` too bright and have noise of SIGMA; so does the input, unbiased."""
    rng = np.random.default_rng([9, seed])
    sequence = FrameSequence.create(folder, Manifest(
        scene="made", frames=tuple(range(FRAMES)), width=W, height=H, seed=seed, reference_spp=64,
        channels=("color",), objects=("all",)))
    for i in range(FRAMES):
        noisy = [linear(display(i) + b + SIGMA * rng.standard_normal((H, W, 3)))
                 for b in (bias, 0.0)]
        sequence.write_result(method, i, noisy[0])
        sequence.write_frame(Frame(i, {"color": noisy[1]}, np.eye(4), np.eye(4), np.eye(4)[None]))
        truth = linear(display(i))
        slope = (linear(display(i) + 1e-3) - truth) / 1e-3
        error = noise * slope * np.random.default_rng([7, i]).standard_normal((H, W, 3))
        sequence.write_reference(i, Reference(
            (truth + error).astype(np.float32), ((noise * slope)**2).astype(np.float32), 64))
    sequence.write_run(method, Run(method=method))
    return sequence


@pytest.fixture(scope="module")
def renders(tmp_path_factory):
    folder = tmp_path_factory.mktemp("seeds")
    return [render(folder / str(seed), seed) for seed in range(4)]


def test_a_known_bias_and_variance_are_found(renders):
    split = split_errors(renders, ["mine", INPUT])
    assert split["mine"].bias_squared == pytest.approx(BIAS**2, rel=0.05)
    assert split["mine"].variance == pytest.approx(SIGMA**2, rel=0.05)
    assert split[INPUT].bias_squared == pytest.approx(0, abs=0.05 * BIAS**2)
    assert split["mine"].renders == 4
    assert split["mine"].frames == FRAMES


def test_the_parts_add_up_to_the_squared_error(renders):
    for count in (2, 4):
        s = split_errors(renders[:count], ["mine"])["mine"]
        assert s.mse == pytest.approx(s.bias_squared + s.variance, rel=1e-6)


def test_the_split_does_not_depend_on_how_many_renders_there_are(renders):
    two, four = (split_errors(renders[:n], ["mine"])["mine"] for n in (2, 4))
    assert two.bias_squared == pytest.approx(four.bias_squared, rel=0.1)
    assert two.variance == pytest.approx(four.variance, rel=0.1)


def test_the_noise_of_the_reference_is_not_taken_for_bias(tmp_path):
    noisy = [render(tmp_path / str(seed), seed, bias=0.0, noise=NOISE) for seed in range(2)]
    s = split_errors(noisy, ["mine"])["mine"]
    assert abs(s.bias_squared) < 0.1 * NOISE**2
    assert s.mse == pytest.approx(SIGMA**2 + NOISE**2, rel=0.05)


def test_a_score_with_seeds_has_the_split_in_its_file_and_table(renders):
    scores = score(renders[0], seeds=renders[1:])
    assert scores.methods["mine"].split == split_errors(renders, ["mine"])["mine"]
    assert read_scores(renders[0].folder / "scores.json") == scores
    console = Console(width=100, file=io.StringIO(), color_system=None)
    print_splits(scores, console)
    line = next(x for x in console.file.getvalue().splitlines() if "mine" in x)
    assert "0.0499" in line or "0.0500" in line or "0.0501" in line
    assert score(renders[0]).methods["mine"].split is None


def test_a_method_that_one_render_lacks_is_left_out(renders, tmp_path):
    other = render(tmp_path / "other", 9, method="another")
    assert set(split_errors([renders[0], other], ["mine", INPUT])) == {INPUT}


def test_renders_of_one_seed_or_of_something_else_are_refused(renders, tmp_path):
    same = render(tmp_path / "same", 0)
    with pytest.raises(InputError, match=r"seeds are 0, 0.*--seed"):
        split_errors([renders[0], same], ["mine"])
    manifest = renders[1].manifest.model_copy(update={"scene": "else"})
    other = FrameSequence.create(tmp_path / "else", manifest)
    with pytest.raises(InputError, match="has another scene"):
        split_errors([renders[0], other], ["mine"])


def test_renders_that_do_not_fit_are_told_before_anything_is_scored(renders, tmp_path):
    def progress(*what):
        raise AssertionError(f"scored already: {what}")

    same = render(tmp_path / "same", 0)
    with pytest.raises(InputError, match="seeds are 0, 0"):
        score(renders[0], progress=progress, seeds=[same])
