"""Scores of sequences whose references have halves: no floor, errors, bounds, pairs, notes."""

from __future__ import annotations

import csv
import io
import math

import numpy as np
import pytest

from onespp.denoise.geometry.correspondence import GUIDES
from onespp.denoise.metrics.errors import PSNR_CAP, psnr
from onespp.denoise.metrics.table import ESTIMATED, HEADLINE
from onespp.denoise.metrics.tonemap import srgb_from_linear
from onespp.denoise.report import contact_sheets
from onespp.denoise.report.page_data import page_data, table_data
from onespp.denoise.report.terminal import caption, cells
from onespp.denoise.score.causes import CAUSES
from onespp.denoise.score.compare import comparison
from onespp.denoise.score.scorecard import INPUT, Scores, read_scores
from onespp.denoise.score.sequence import measure_sequence, score
from onespp.render.files.manifest import Run
from tests.support.halved import halved
from tests.support.made_sequence import COUNT, METHODS, make_sequence, truth
from tests.support.report_sequence import make_report_sequence


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    return make_sequence(tmp_path_factory.mktemp("halved") / "made")


@pytest.fixture(scope="module")
def scores(sequence):
    return score(halved(sequence, truth))


def true_psnr(sequence, name: str) -> float:
    return float(np.mean([psnr(*(srgb_from_linear(x) for x in (
        sequence.read_result(name, i), truth(i)))) for i in sequence.frames]))


@pytest.mark.parametrize("name", METHODS)
def test_the_headline_is_that_against_the_truth(sequence, scores, name):
    method, wanted = scores.methods[name], true_psnr(sequence, name)
    assert method["psnr_srgb"] == pytest.approx(wanted, abs=4 * method.errors["psnr_srgb"])
    assert method.errors["psnr_srgb"] < 0.2
    assert not method.bounds


def test_against_the_mean_the_floor_stays(sequence, scores):
    fine = scores.methods["fine"]
    assert fine["psnr_plain"] < fine["psnr_srgb"] - 0.3
    assert fine["psnr_plain"] < scores.reference_floor_db
    assert "psnr_plain" not in fine.errors


def test_what_is_quadratic_has_an_error_and_the_rest_has_none(scores):
    fine = scores.methods["fine"]
    assert set(fine.errors) | set(fine.bounds) == {m for m in ESTIMATED if m != "flicker"}
    assert not set(fine.errors) & set(fine.bounds)


def test_the_files_hold_what_was_scored(sequence, scores):
    assert read_scores(sequence.folder / "scores.json") == scores
    rows = list(csv.DictReader(io.StringIO(scores.csv_text())))
    first = next(r for r in rows if r["method"] == "fine")
    assert float(first["psnr_srgb_error"]) == scores.methods["fine"].per_frame[0].errors[
        "psnr_srgb"]


def test_methods_are_paired(sequence):
    """The interval of a difference holds the true one, over references; far below either's."""
    hits, wanted = [], true_psnr(sequence, "fine") - true_psnr(sequence, "rough")
    for seed in range(25):
        found = measure_sequence(halved(sequence, truth, 0.01, seed), ["rough", "fine"])
        difference = (found.methods["fine"]["psnr_srgb"] - found.methods["rough"]["psnr_srgb"])
        error = found.paired_errors["fine"]["rough"]
        assert error == found.paired_errors["rough"]["fine"]
        hits.append(abs(difference - wanted) < 1.96 * error)
    assert np.mean(hits) >= 0.8
    assert set(found.paired_errors) == {INPUT, "rough", "fine"}


def test_two_methods_alike_differ_by_less_than_either_is_known(sequence):
    fine = METHODS["fine"][0]
    other = halved(sequence, truth, 0.05)
    for i in sequence.frames:
        sequence.write_result("twin", i, (0.999 * sequence.read_result("fine", i)))
    sequence.write_run("twin", Run(method="twin", parameters={"sigma": fine}))
    try:
        found = measure_sequence(other, ["fine", "twin"])
    finally:
        sequence.remove_results("twin")
    assert found.paired_errors["fine"]["twin"] < 0.1 * found.methods["fine"].errors["psnr_srgb"]


def test_what_is_too_good_for_the_reference_is_a_bound_and_says_so(tmp_path):
    perfect = make_sequence(tmp_path / "made", methods=False)
    for i in perfect.frames:
        perfect.write_result("perfect", i, truth(i).astype(np.float32))
    perfect.write_run("perfect", Run(method="perfect"))
    for seed in range(5):
        scores = measure_sequence(halved(perfect, truth, 0.02, seed))
        method = scores.methods["perfect"]
        assert "psnr_srgb" in method.bounds
        assert method["psnr_srgb"] > scores.reference_floor_db + 5
        assert any("beyond what the reference can tell" in note for note in scores.notes)
        assert cells(scores, "perfect")["PSNR (dB)"].startswith("≥ ")


def test_a_copy_of_the_reference_is_identical_to_it(sequence):
    other = halved(sequence, truth)
    for i in sequence.frames:
        sequence.write_result("copy", i, other.read_reference(i).color)
    sequence.write_run("copy", Run(method="copy"))
    try:
        method = measure_sequence(other, ["copy"]).methods["copy"]
    finally:
        sequence.remove_results("copy")
    assert method["psnr_srgb"] == method["psnr_plain"] == PSNR_CAP
    assert method.identical_frames == list(sequence.frames)


def test_old_references_are_scored_the_old_way_and_a_note_says_so(sequence):
    found = measure_sequence(sequence)
    assert any("have no halves" in note for note in found.notes)
    for method in found.methods.values():
        assert method["psnr_srgb"] == method["psnr_plain"]
        assert method.errors == {}
    some = measure_sequence(halved(sequence, truth, without=(1,)))
    assert any(f"{COUNT - 1} of {COUNT} references have halves" in note for note in some.notes)
    row = some.methods["fine"].per_frame[1]
    assert row["psnr_srgb"] == row["psnr_plain"]
    assert not row.errors
    assert not some.reference_halves


def test_the_floors_of_flip_and_ssim_are_those_of_a_perfect_image(tmp_path):
    perfect = make_sequence(tmp_path / "made", methods=False)
    for i in perfect.frames:
        perfect.write_result("perfect", i, truth(i).astype(np.float32))
    perfect.write_run("perfect", Run(method="perfect"))
    scores = measure_sequence(halved(perfect, truth, 0.03))
    method = scores.methods["perfect"]
    assert scores.flip_floor == pytest.approx(method["flip"], rel=0.15)
    assert 1 - scores.ssim_floor == pytest.approx(1 - method["ssim"], rel=0.3)


def test_tables_and_page_show_the_error(sequence, scores):
    fine = scores.methods["fine"]
    text = f"{fine['psnr_srgb']:.2f} ±{fine.errors['psnr_srgb']:.2f}"
    assert cells(scores, "fine")["PSNR (dB)"] == text
    assert "two halves" in caption(scores)
    columns, rows = table_data(scores)
    at = [heading for heading, _ in columns].index(f"{HEADLINE.label} ({HEADLINE.unit})")
    assert dict(rows)["fine"][at] == text
    data = page_data(sequence, scores, [], {}, {}, np.array([0.0, 1.0]))
    found = next(m for m in data["methods"] if m["name"] == "fine")
    assert found["errors"] == fine.errors
    assert data["floor"] is None


def test_a_sheet_tells_the_floor_of_references_without_halves_alone(sequence, scores):
    """By halves a result may be better than the mean of the reference."""
    plain = measure_sequence(sequence)
    assert scores.reference_floor_db is not None
    assert (scores.headline_floor, scores.headline_floors) == (None, {})
    assert (plain.headline_floor, plain.headline_floors) == (
        plain.reference_floor_db, plain.reference_floor_per_frame)
    for made, found, told in ((halved(sequence, truth), scores, False), (sequence, plain, True)):
        *_, (name, label, _) = contact_sheets._images(made, found, 0, [])
        assert (name, "noise floor" in label) == ("reference", told)


def test_a_single_frame_is_compared_by_the_errors_of_its_reference(scores):
    def one(change: float) -> Scores:
        data = scores.model_dump()
        for method in data["methods"].values():
            method["per_frame"] = method["per_frame"][:1]
            method["per_frame"][0]["psnr_srgb"] += change
        return Scores.model_validate_json(scores.model_validate(data).json_text())

    error = math.sqrt(2) * scores.methods["fine"].per_frame[0].errors["psnr_srgb"]
    for change, verdict in ((1.0 * error, "same"), (-3.0 * error, "worse")):
        found = next(c for c in comparison(one(0.0), one(change)).changes
                     if (c.method, c.measure) == ("fine", "psnr_srgb"))
        assert found.error == pytest.approx(error)
        assert found.verdict == verdict


def test_the_error_by_cause_has_no_floor(tmp_path):
    sequence = make_report_sequence(tmp_path / "made", 3)
    clean = {i: sequence.read_reference(i).color.astype(np.float64) for i in sequence.frames}
    for name, found in measure_sequence(halved(sequence, clean.__getitem__, 0.05),
                                        ["rough", "fine"]).methods.items():
        squares, pixels = {}, {}
        exact = measure_sequence(halved(sequence, clean.__getitem__, 0.0), ["rough", "fine"])
        for cause in CAUSES:
            wanted, row = exact.methods[name].by_cause[cause], found.by_cause[cause]
            squares[cause], pixels[cause] = row.mse_share, row.pixels
            if row.psnr_srgb is not None:
                assert row.error is not None
                assert row.psnr_srgb == pytest.approx(wanted.psnr_srgb, abs=5 * row.error + 0.1)
        assert sum(pixels.values()) == pytest.approx(1)
        assert sum(squares.values()) == pytest.approx(1)
    assert set(GUIDES) <= set(sequence.manifest.channels)
