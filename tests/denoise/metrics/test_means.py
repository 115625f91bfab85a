"""Frames that are identical to their reference, and references with holes."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from rich.console import Console

from onespp.denoise.metrics.errors import PSNR_CAP, psnr
from onespp.denoise.metrics.means import mean_decibels, mean_over_frames
from onespp.denoise.metrics.table import MEASURES, METRICS
from onespp.denoise.metrics.tonemap import srgb_from_linear
from onespp.denoise.report.contact_sheets import display_error
from onespp.denoise.report.terminal import cells, print_scores
from onespp.denoise.score.compare import comparison
from onespp.denoise.score.scorecard import INPUT, read_scores
from onespp.denoise.score.sequence import score
from onespp.render.errors import InputError
from onespp.render.files.manifest import Run
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.frame import Frame
from tests.support.made_sequence import (
    COUNT,
    HEIGHT,
    SPP,
    WIDTH,
    make_sequence,
    truth,
    write_method,
)

BLACK = np.zeros((HEIGHT, WIDTH, 3), np.float32)


def blacken(sequence: FrameSequence, i: int, *methods: str) -> None:
    """A frame before the light goes on."""
    frame = sequence.read_frame(i)
    sequence.write_frame(Frame(i, {"color": BLACK}, frame.camera_from_world,
                               frame.screen_from_world, frame.world_from_object))
    sequence.write_reference(i, Reference(BLACK, BLACK, SPP))
    for name in methods:
        sequence.write_result(name, i, BLACK)


def decibels(scores, name: str) -> list[float]:
    return [row["psnr_srgb"] for row in scores.methods[name].per_frame]


def shown(scores) -> str:
    console = Console(width=300, file=io.StringIO(), color_system=None)
    print_scores(scores, console)
    return console.file.getvalue()


def test_a_black_frame_is_in_no_mean_of_decibels(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    blacken(sequence, 1, "rough", "fine")
    scores = score(sequence)
    for name in (INPUT, "rough", "fine"):
        values = decibels(scores, name)
        assert values[1] == PSNR_CAP
        assert scores.methods[name]["psnr_srgb"] == pytest.approx(np.mean(values[:1] + values[2:]))
        assert scores.methods[name].identical_frames == [1]
        assert scores.methods[name]["relmse"] == pytest.approx(
            np.mean([row["relmse"] for row in scores.methods[name].per_frame]))
    assert scores.reference_floor_db == pytest.approx(np.mean(
        [db for i, db in scores.reference_floor_per_frame.items() if i != 1]))
    data = json.loads((sequence.folder / "scores.json").read_text())
    assert data["methods"]["fine"]["identical_frames"] == [1]
    assert read_scores(sequence.folder / "scores.json") == scores
    assert ("The input is identical to the reference on 1 frame (1): means in dB are without."
            in shown(scores))
    gain = np.subtract(decibels(scores, "fine"), decibels(scores, INPUT))[[0, 2, 3]].mean()
    assert cells(scores, "fine")["gain (dB)"] == f"{gain:+.2f}"


def test_what_a_method_leaves_in_a_black_frame_does_not_help_it_and_is_told(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    blacken(sequence, 1, "rough", "fine")
    clean = score(sequence).methods["fine"]["psnr_srgb"]
    sequence.write_result("fine", 1, BLACK + np.float32(2e-4))  # a trace: many dB, no merit
    scores = score(sequence)
    left = decibels(scores, "fine")[1]
    assert left > clean
    assert scores.methods["fine"]["psnr_srgb"] == clean
    assert f"though fine has {left:.1f} dB there." in shown(scores)


def test_a_method_that_is_identical_on_one_frame_is_judged_on_the_others(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    sequence.write_result("fine", 2, sequence.read_reference(2).color)
    scores = score(sequence)
    values = decibels(scores, "fine")
    assert scores.methods["fine"]["psnr_srgb"] == pytest.approx(np.mean(
        [values[0], values[1], values[3]]))
    assert "fine is identical to the reference on 1 frame (2)" in shown(scores)
    assert scores.methods[INPUT]["psnr_srgb"] == pytest.approx(np.mean(decibels(scores, INPUT)))


def test_a_method_that_is_identical_throughout_has_the_cap(tmp_path):
    sequence = make_sequence(tmp_path / "made", methods=False)
    for i in sequence.frames:
        sequence.write_result("copy", i, sequence.read_reference(i).color)
    sequence.write_run("copy", Run(method="files"))
    assert score(sequence).methods["copy"]["psnr_srgb"] == PSNR_CAP


@pytest.mark.parametrize(("values", "untouched", "mean"), [
    ({0: 30.0, 1: 150.0, 2: 32.0}, (), 31.0),
    ({0: 30.0, 1: 60.0, 2: 32.0}, (1,), 31.0),
    ({0: 150.0, 1: 150.0}, (), 150.0),
    ({0: 150.0, 1: 60.0}, (0, 1), 60.0),
    ({0: None, 1: 30.0}, (), 30.0),
    ({0: None}, (), None),
])
def test_the_frames_that_count(values, untouched, mean):
    for row in (r for r in MEASURES.values() if r.unit == "dB"):
        assert mean_over_frames(row, values, untouched) == mean
    plain = [v for v in values.values() if v is not None]
    for row in (r for r in MEASURES.values() if r.unit != "dB"):
        assert mean_over_frames(row, values, untouched) == (np.mean(plain) if plain else None)


def test_decibels_alone():
    assert mean_decibels([30.0, 150.0, 40.0]) == 35.0
    assert mean_decibels([150.0]) == 150.0


def test_a_comparison_is_not_decided_by_a_frame_that_became_identical(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    before = score(sequence)
    sequence.write_result("fine", 1, sequence.read_reference(1).color)
    after = score(sequence)
    found = comparison(before, after, ["fine"])
    change = next(c for c in found.changes if c.measure == "psnr_srgb")
    assert change.frames == COUNT - 1
    assert change.change == 0
    assert any("fine is identical to the reference on 1 frame of B" in n for n in found.notes)


# References with holes


def hole(sequence: FrameSequence, i: int, pixels: int, value: float = np.nan) -> np.ndarray:
    reference = sequence.read_reference(i)
    color = reference.color.copy()
    color.reshape(-1, 3)[:pixels, 1] = value
    sequence.write_reference(i, Reference(color, reference.variance, SPP))
    return color


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_holes_in_a_reference_are_counted_and_told(tmp_path, value):
    sequence = make_sequence(tmp_path / "made")
    for i, count in ((0, 2), (3, 3)):
        hole(sequence, i, count, value)
    scores = score(sequence)
    assert scores.reference_non_finite_pixels == 5
    assert ("References have 5 pixels that are not finite (frames 0,3), which were not judged"
            in shown(scores))
    assert json.loads((sequence.folder / "scores.json").read_text())[
        "reference_non_finite_pixels"] == 5


def test_a_whole_reference_has_no_note(tmp_path):
    scores = score(make_sequence(tmp_path / "made"))
    assert scores.reference_non_finite_pixels == 0
    assert "finite" not in shown(scores)


def test_a_reference_that_is_mostly_holes_is_refused(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    hole(sequence, 2, HEIGHT * WIDTH)
    with pytest.raises(InputError) as error:
        score(sequence)
    assert f"frame 2 in {sequence.folder} has {HEIGHT * WIDTH} of {HEIGHT * WIDTH} pixels" in str(
        error.value)


def test_the_error_picture_is_black_where_nothing_was_judged(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    write_method(sequence, "fine", 0.05, 1.0)
    error = display_error(sequence.read_result("fine", 1), hole(sequence, 1, 4))
    assert (error.ravel()[:4] == 0).all()
    assert error.ravel()[4] > 0


def test_psnr_itself_still_has_its_cap():
    image = srgb_from_linear(truth(0).astype(np.float32))
    assert psnr(image, image) == PSNR_CAP
    assert "without those identical to the reference" in METRICS["psnr_srgb"].about
