"""The search of parameters finds better ones, goes on where it stopped, and refuses nonsense."""

from __future__ import annotations

import json

import numpy as np
import pytest

from onespp.denoise.catalog import build
from onespp.denoise.metrics.image import Target
from onespp.denoise.studies.tune import Case, Search, mean_psnr, neighbours, starting_point
from onespp.render.channels import FRAME
from onespp.render.files.manifest import Manifest
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.frame import Frame
from tests.support.frames import make_frame, noisy


@pytest.fixture(scope="module")
def case():
    truth = make_frame(24, 28)
    frames = [noisy(truth, seed=i) for i in range(3)]
    return Case("wall", frames, [Target(truth["color"])] * 3)


def test_it_finds_better_parameters_than_bad_ones(case):
    method = build("atrous", {"levels": "1", "sigma_luminance": "0.1"})
    start, search = starting_point(method), Search(method, [case])
    best, value = search.run(["levels", "sigma_luminance"], factors=(2.0,))
    assert value > search.value(start) + 3
    assert best["sigma_luminance"] > 0.1
    assert {k: v for k, v in best.items() if k not in ("levels", "sigma_luminance")} == {
        k: v for k, v in start.items() if k not in ("levels", "sigma_luminance")}
    method = build("atrous", {k: str(v) for k, v in best.items()})
    assert value == pytest.approx(mean_psnr(method, [case]))


def test_the_noise_of_references_has_no_part_in_the_choice():
    """A noisy reference in parts measures as the truth itself does."""
    truth = make_frame(48, 56)
    frames = [noisy(truth, seed=i) for i in range(3)]
    rng = np.random.default_rng(0)
    parts = [truth["color"] * rng.normal(1, 0.2, (4, 48, 56, 3)) for _ in frames]
    method = build("atrous")
    exact = mean_psnr(method, [Case("", frames, [Target(truth["color"])] * 3)])
    halves = mean_psnr(method, [Case("", frames, [Target(p.mean(0), p) for p in parts])])
    mean = mean_psnr(method, [Case("", frames, [Target(p.mean(0)) for p in parts])])
    assert halves == pytest.approx(exact, abs=0.1)
    assert mean < exact - 0.4


def test_it_goes_on_from_what_it_had_tried(case, tmp_path, monkeypatch):
    file = tmp_path / "tried.json"
    first = Search(build("temporal"), [case], file)
    result = first.run(["alpha"], factors=(2.0,))
    again = Search(build("temporal"), [case], file)
    monkeypatch.setattr("onespp.denoise.studies.tune.mean_psnr",
                        lambda *_: pytest.fail("measured twice"))
    assert again.run(["alpha"], factors=(2.0,)) == result
    assert len(json.loads(file.read_text())) == len(first.tried) > 2


def test_what_a_method_refuses_is_not_a_candidate(case):
    search = Search(build("temporal"), [case])
    assert search.try_value({**search.start, "alpha": 2.0}) is None
    best, _ = search.run(["alpha"], factors=(8.0,))
    assert best["alpha"] <= 1


@pytest.mark.parametrize(("value", "expected"), [
    (3, [4, 2]), (0.5, [1.0, 0.25]), (True, [False]), (0.0, []), ("fast", [])])
def test_neighbours_are_a_step_away(value, expected):
    assert list(neighbours(value, 2.0)) == expected


@pytest.fixture
def folder(tmp_path):
    truth = make_frame(16, 20)
    frames = [noisy(truth, seed=i) for i in range(2)]
    sequence = FrameSequence.create(tmp_path / "walls", Manifest(
        scene="walls", frames=(0, 1), width=20, height=16, seed=0, reference_spp=64,
        channels=tuple(k for k in truth.images if k in FRAME), objects=("wall", "board")))
    for i, frame in enumerate(frames):
        images = {k: v for k, v in frame.images.items() if k in FRAME}
        sequence.write_frame(Frame(i, images, frame.camera_from_world, frame.screen_from_world,
                                   frame.world_from_object))
        sequence.write_reference(i, Reference(truth["color"], 0 * truth["color"], 64))
    return sequence.folder


def test_the_command_prints_settings_that_denoise_takes(call, folder, tmp_path):
    kept = tmp_path / "tried.json"
    arguments = ("tune", folder, "--method", "temporal", "--out", kept)
    code, out, err = call(*arguments, "--parameter", "alpha", "--set", "alpha=0.9")
    assert code == 0, err
    assert "dB on clipped sRGB, mean over walls" in out
    setting = out.split()[-1]
    assert setting.startswith("alpha=0.")
    assert call("denoise", folder, "--method", "temporal", "--set", setting)[0] == 0
    code, _, err = call(*arguments, "--parameter", "beta")
    assert (code, "no parameter 'beta'" in err) == (2, True)
    for text in ("[1]", "[" * 100_000):
        kept.write_text(text)
        code, _, err = call(*arguments)
        assert (code, "earlier search" in err) == (2, True)


@pytest.mark.parametrize("out", ["/", "."])
def test_a_folder_is_no_file_to_keep_a_search_in(call, folder, out):
    code, _, err = call("tune", folder, "--method", "temporal", "--out", out)
    assert (code, err.strip()) == (2, f"onespp: {out} cannot be read: it is not a file")
