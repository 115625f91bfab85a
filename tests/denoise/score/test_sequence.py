"""Scores of a sequence: the numbers, the files, and what is missing or broken."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from onespp.denoise.metrics.noise_floor import reference_floor
from onespp.denoise.metrics.table import METRICS, measure
from onespp.denoise.report.terminal import caption, print_scores
from onespp.denoise.score.scorecard import INPUT, read_scores
from onespp.denoise.score.sequence import score
from onespp.render.errors import InputError
from onespp.render.files.manifest import Run
from onespp.render.files.sequence import FrameSequence
from tests.support.made_sequence import COUNT, HEIGHT, METHODS, SPP, WIDTH, make_sequence, truth

EVERY_FRAME = [m for m, row in METRICS.items() if (row.most_frames or COUNT) >= COUNT]


@pytest.fixture(scope="module")
def scored(tmp_path_factory):
    sequence = make_sequence(tmp_path_factory.mktemp("scored") / "made")
    return sequence, score(sequence)


def strict_json(text: str):
    """Refuses NaN and Infinity, which are no JSON."""
    def refuse(word):
        raise ValueError(f"{word} is not JSON")
    return json.loads(text, parse_constant=refuse)


def shown(scores, width: int = 100) -> str:
    console = Console(width=width, file=io.StringIO(), color_system=None)
    print_scores(scores, console)
    return console.file.getvalue()


# Numbers


def test_each_frame_is_scored_against_its_own_reference(scored):
    sequence, scores = scored
    for name in METHODS:
        for i, row in enumerate(scores.methods[name].per_frame):
            expected = measure(sequence.read_result(name, i), sequence.read_reference(i).color)
            assert row.frame == i
            assert {m: row[m] for m in EVERY_FRAME} == {m: expected[m] for m in EVERY_FRAME}


def test_the_noisy_input_is_a_method_without_a_time(scored):
    sequence, scores = scored
    noisy = scores.methods[INPUT]
    assert noisy.ms_per_frame is None
    assert noisy.first_ms is None
    expected = measure(sequence.read_frame(2, ("color",))["color"],
                       sequence.read_reference(2).color)
    assert noisy.per_frame[2]["psnr_srgb"] == expected["psnr_srgb"]


@pytest.mark.parametrize("metric", METRICS)
def test_the_number_of_a_sequence_is_the_mean_of_its_frames(scored, metric):
    for method in scored[1].methods.values():
        values = [row[metric] for row in method.per_frame if row[metric] is not None]
        assert len(values) == min(COUNT, METRICS[metric].most_frames or COUNT)
        assert method[metric] == pytest.approx(np.mean(values))


def test_less_noise_scores_better(scored):
    methods = scored[1].methods
    psnr = [methods[name]["psnr_srgb"] for name in (INPUT, "rough", "fine")]
    assert psnr == sorted(psnr)
    relmse = [methods[name]["relmse"] for name in (INPUT, "rough", "fine")]
    assert relmse == sorted(relmse, reverse=True)


def test_the_time_is_the_median_after_the_first_frame(scored):
    fine = scored[1].methods["fine"]
    assert fine.ms_per_frame == 42.0  # of 41, 42, 43; the first took 400
    assert fine.first_ms == 400.0
    assert [row.ms for row in fine.per_frame] == [400.0, 41.0, 42.0, 43.0]


def test_a_perfect_method_scores_the_reference_floor(tmp_path):
    sequence = make_sequence(tmp_path / "made", methods=False)
    for i in sequence.frames:
        sequence.write_result("perfect", i, truth(i).astype(np.float32))
    sequence.write_run("perfect", Run(method="perfect"))
    scores = score(sequence)
    assert scores.reference_floor_db is not None
    assert scores.methods["perfect"]["psnr_srgb"] == pytest.approx(
        scores.reference_floor_db, abs=0.3)
    reference = sequence.read_reference(3)
    assert scores.reference_floor_per_frame[3] == reference_floor(
        reference.color, reference.variance)


# Files


def test_the_json_holds_what_is_promised(scored):
    sequence, _ = scored
    data = strict_json((sequence.folder / "scores.json").read_text())
    assert data["scene"] == "made"
    assert data["frames"] == list(range(COUNT))
    assert data["size"] == [WIDTH, HEIGHT]
    assert data["reference_spp"] == SPP
    assert data["seed"] == 7
    assert data["tone_map"] == "clipped sRGB"
    assert data["versions"] == {"maker": "1.0"}
    assert set(data["methods"]) == {INPUT, *METHODS}
    for method in data["methods"].values():
        assert {"psnr_srgb", "relmse", "ms_per_frame", "per_frame"} <= set(method)
        assert len(method["per_frame"]) == COUNT
        assert {"frame", "psnr_srgb", "relmse", "ms"} <= set(method["per_frame"][0])
    assert data["methods"]["fine"]["parameters"] == {"sigma": METHODS["fine"][0]}


def test_the_json_reads_back_as_the_same_scores(scored):
    sequence, scores = scored
    assert read_scores(sequence.folder / "scores.json") == scores


def test_the_csv_has_a_row_for_each_method_and_frame(scored):
    sequence, scores = scored
    rows = list(csv.DictReader((sequence.folder / "scores.csv").open()))
    assert len(rows) == 3 * COUNT
    by_key = {(row["method"], int(row["frame"])): row for row in rows}
    row = by_key["fine", 2]
    assert float(row["psnr_srgb"]) == scores.methods["fine"].per_frame[2]["psnr_srgb"]
    assert float(row["relmse"]) == scores.methods["fine"].per_frame[2]["relmse"]
    assert float(row["ms"]) == 42.0
    assert float(row["reference_floor_db"]) == scores.reference_floor_per_frame[2]
    assert by_key[INPUT, 0]["ms"] == ""


def test_the_same_sequence_gives_the_same_files(scored):
    sequence, _ = scored
    before = [(sequence.folder / name).read_bytes() for name in ("scores.json", "scores.csv")]
    score(FrameSequence.open(sequence.folder))
    assert [(sequence.folder / n).read_bytes() for n in ("scores.json", "scores.csv")] == before


def test_a_scores_file_with_nan_or_nonsense_is_refused_in_one_sentence(scored, tmp_path):
    path = tmp_path / "scores.json"
    for text in ('{"scene": "made"}', "not json", scored[1].json_text().replace(
            f'"reference_floor_db": {scored[1].reference_floor_db}', '"reference_floor_db": NaN')):
        path.write_text(text)
        with pytest.raises(InputError, match=r"scores\.json") as error:
            read_scores(path)
        assert "\n" not in str(error.value)


def test_progress_is_told_to_the_end(tmp_path):
    told = []
    sequence = make_sequence(tmp_path / "made", methods=False)
    score(sequence, progress=lambda *what: told.append(what))
    assert told == [(i + 1, COUNT, "score") for i in range(COUNT)]


# What is missing or broken


def test_without_a_reference_all_but_the_error_is_reported(tmp_path):
    sequence = make_sequence(tmp_path / "made", reference=False)
    scores = score(sequence)
    data = strict_json((sequence.folder / "scores.json").read_text())
    assert data["reference_spp"] is None
    assert data["reference_floor_db"] is None
    fine = data["methods"]["fine"]
    assert fine["psnr_srgb"] is None
    assert fine["relmse"] is None
    assert fine["ms_per_frame"] == 42.0
    assert len(fine["per_frame"]) == COUNT
    assert any("no reference" in note for note in scores.notes)
    assert "no reference" in shown(scores)
    assert read_scores(sequence.folder / "scores.json") == scores


def test_a_method_with_some_frames_is_scored_on_those_and_says_so(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    for i in (2, 3):
        (sequence.folder / "denoised/fine" / f"{i:04d}.exr").unlink()
    scores = score(sequence)
    assert [row.frame for row in scores.methods["fine"].per_frame] == [0, 1]
    assert any("fine has 2 of 4 frames" in note for note in scores.notes)
    text = shown(scores)
    assert "2/4" in text
    rows = {i: (scores.methods["fine"].per_frame[i]["psnr_srgb"],
                scores.methods[INPUT].per_frame[i]["psnr_srgb"]) for i in (0, 1)}
    gain = np.mean([a - b for a, b in rows.values()])
    assert f"{gain:+.2f}" in text  # over the input on the same frames


def test_a_method_that_began_and_has_no_frame_yet_is_listed_without_numbers(tmp_path):
    sequence = make_sequence(tmp_path / "made", methods=False)
    sequence.write_run("begun", Run(method="begun"))
    scores = score(sequence)
    assert scores.methods["begun"]["psnr_srgb"] is None
    assert "0/4" in shown(scores)


def test_frames_without_a_reference_have_no_error_and_a_note(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    (sequence.folder / "reference/0003.exr").unlink()
    scores = score(sequence)
    fine = scores.methods["fine"]
    assert fine.per_frame[3]["psnr_srgb"] is None
    assert fine["psnr_srgb"] == pytest.approx(
        np.mean([row["psnr_srgb"] for row in fine.per_frame[:3]]))
    assert any("3 of 4 frames have a reference" in note for note in scores.notes)


def test_a_sequence_that_is_half_rendered_is_scored_as_far_as_it_is(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    for path in (sequence.folder / "frames").glob("0003.*"):
        path.unlink()
    scores = score(sequence)
    assert scores.frames == [0, 1, 2]
    assert any("3 of 4 frames are rendered" in note for note in scores.notes)


def test_non_finite_pixels_are_counted_reported_and_scored_as_black(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    broken = sequence.read_result("fine", 1)
    broken[3, 4, 0], broken[3, 5, 2] = np.nan, np.inf
    sequence.write_result("fine", 1, broken)
    broken[3, 4:6] = 0
    expected = measure(broken, sequence.read_reference(1).color)
    scores = score(sequence)
    fine = scores.methods["fine"]
    assert {m: fine.per_frame[1][m] for m in EVERY_FRAME} == {m: expected[m] for m in EVERY_FRAME}
    assert [row.non_finite_pixels for row in fine.per_frame] == [0, 2, 0, 0]
    assert any("fine has 2 non-finite pixels" in note for note in scores.notes)
    strict_json((sequence.folder / "scores.json").read_text())


def test_a_reference_of_unknown_variance_has_no_floor(tmp_path):
    sequence = make_sequence(tmp_path / "made", methods=False)
    for i in sequence.frames:
        reference = sequence.read_reference(i)
        sequence.write_reference(i, replace(
            reference, variance=np.full_like(reference.variance, np.nan)))
    scores = score(sequence)
    assert scores.reference_floor_db is None
    assert scores.methods[INPUT]["psnr_srgb"] is not None
    assert scores.has_reference
    assert "256 spp" in caption(scores)


def test_an_unknown_method_is_refused_with_what_there_is(scored):
    with pytest.raises(InputError, match=r"'blur'.*fine, rough.*onespp denoise"):
        score(scored[0], methods=["blur"])


def test_chosen_methods_alone_are_scored(tmp_path):
    scores = score(make_sequence(tmp_path / "made"), methods=["rough", INPUT])
    assert list(scores.methods) == [INPUT, "rough"]


def test_a_sequence_without_frames_is_refused(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    for path in (sequence.folder / "frames").iterdir():
        path.unlink()
    with pytest.raises(InputError, match="no frames"):
        score(sequence)


def test_a_damaged_result_ends_in_an_error_and_keeps_older_scores(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    score(sequence)
    before = (sequence.folder / "scores.json").read_bytes()
    path = sequence.folder / "denoised/fine/0002.exr"
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(InputError, match=r"0002\.exr"):
        score(sequence)
    assert (sequence.folder / "scores.json").read_bytes() == before


# The table


def test_the_table_shows_input_first_then_fast_to_slow_with_their_numbers(scored):
    scores = scored[1]
    text = shown(scores)
    assert text.index("input") < text.index("rough") < text.index("fine")
    fine = scores.methods["fine"]
    line = next(line for line in text.splitlines() if "fine" in line)
    gain = fine["psnr_srgb"] - scores.methods[INPUT]["psnr_srgb"]
    for number in (f"{fine['psnr_srgb']:.2f}", f"{gain:+.2f}", f"{fine['relmse']:.4f}", "42.0"):
        assert number in line
    for said in ("PSNR (dB)", "relMSE", "clipped sRGB", "4 frames of 33x21", "reference 256 spp",
                 f"{scores.reference_floor_db:.1f} dB"):
        assert said in " ".join(text.split())


def test_the_table_is_plain_text_of_100_columns_when_piped(scored, capsys):
    print_scores(scored[1])
    out = capsys.readouterr().out
    assert "\x1b" not in out
    assert max(map(len, out.splitlines())) <= 100
