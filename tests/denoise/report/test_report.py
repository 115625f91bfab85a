"""The report's folder: packed images, what the page says, and that old files go."""

from __future__ import annotations

import base64
import json
import re
import zlib

import numpy as np
import pytest
from click.testing import CliRunner

import onespp.cli
from onespp.denoise.report.contact_sheets import display_error
from onespp.denoise.report.html import EDGES, render_page, write_report
from onespp.denoise.report.page_images import GUIDE, RADIANCE, WHOLE, pack
from onespp.denoise.score.sequence import score
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from tests.support.report_sequence import CHANNELS, COUNT, METHODS, make_report_sequence
from tests.support.small_sequence import contents


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    sequence = make_report_sequence(tmp_path_factory.mktemp("report") / "made")
    scores = score(sequence)
    return sequence, scores, write_report(sequence, scores)


def unpack(text: str) -> tuple[str, np.ndarray]:
    """Key and (planes, h, w) image of a packed image, as page/pixels.js does it."""
    call = re.fullmatch(r'onesppImage\((".*?"),(\{.*?\}),"(.*?)"\);\n', text)
    assert call
    key, head = json.loads(call[1]), json.loads(call[2])
    data = np.frombuffer(zlib.decompress(base64.b64decode(call[3])), np.uint8)
    high, low = data.astype(np.uint16).reshape(2, head["planes"], head["height"], head["width"])
    words = 256 * high + low
    words[:, :, 0] = np.cumsum(words[:, :, 0], axis=1, dtype=np.uint16)
    words = np.cumsum(words, axis=2, dtype=np.uint16)
    if head["color"]:
        words[0] += words[1]
        words[2] += words[1]
    if head["whole"]:
        return key, words.astype(np.int64) - 1
    return key, (words << head["drop"]).astype(np.uint16).view(np.float16).astype(np.float64)


def page_data(page) -> dict:
    text = re.search(r'<script type="application/json" id="data">(.*?)</script>',
                     page.read_text(), re.DOTALL)
    assert text
    return json.loads(text[1], parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))


# Packed images


@pytest.mark.parametrize(("kind", "off"), [(RADIANCE, 2 ** -9), (GUIDE, 2 ** -11)])
def test_packing_rounds_the_mantissa_and_nothing_else(kind, off):
    image = np.random.default_rng(0).lognormal(0, 3, (7, 5, 3)) * [1, -1, 1]
    key, back = unpack(pack("a/0001", image, kind))
    assert key == "a/0001"
    np.testing.assert_allclose(np.moveaxis(back, 0, 2), image, rtol=1.01 * off)


def test_an_error_map_of_packed_images_is_that_of_the_originals_to_half_a_step_of_a_display():
    rng = np.random.default_rng(1)
    a, b = rng.gamma(0.5, 1.0, (2, 40, 40, 3))
    packed = [np.moveaxis(unpack(pack("k", image, RADIANCE))[1], 0, 2) for image in (a, b)]
    assert np.abs(display_error(*packed) - display_error(a, b)).max() < 0.5 / 255


@pytest.mark.parametrize("kind", [RADIANCE, GUIDE])
def test_packing_keeps_what_is_not_finite_and_clips_what_is_too_large(kind):
    image = np.array([[0.0, np.nan, np.inf], [1e9, -1e9, 65504.0]])
    _, back = unpack(pack("k", image, kind))
    assert back[0, 0, 0] == 0
    assert np.isnan(back[0, 0, 1])
    assert back[0, 0, 2] == np.inf
    assert (np.isfinite(back[0, 1]) & (np.abs(back[0, 1]) > 65000)).all()


def test_packing_keeps_object_ids_exactly():
    ids = np.random.default_rng(2).integers(-1, 60000, (9, 4)).astype(np.int32)
    _, back = unpack(pack("k", ids, WHOLE))
    np.testing.assert_array_equal(back[0], ids)


# The folder


def test_the_folder_has_one_file_an_image(reported):
    sequence, _, page = reported
    files = {p.relative_to(page.parent).as_posix() for p in page.parent.rglob("*") if p.is_file()}
    kinds = [*(f"frame/{c}" for c in CHANNELS), "reference", *(f"denoised/{m}" for m in METHODS)]
    assert files == {"index.html", "scores.json", "scores.csv",
                     *(f"data/{kind}/{i:04d}.js" for kind in kinds for i in range(COUNT))}
    for kind in ("denoised/rough", "frame/id"):
        key, image = unpack((page.parent / f"data/{kind}/0002.js").read_text())
        assert key == f"{kind}/0002"
        name = kind.split("/")[1]
        original = (sequence.read_frame(2)["id"] if name == "id" else
                    sequence.read_result(name, 2))
        np.testing.assert_allclose(np.moveaxis(image, 0, 2), np.atleast_3d(original), rtol=0.002)


def test_nothing_in_the_page_comes_from_elsewhere(reported):
    text = reported[2].read_text()
    assert not re.search(r'(src|href)="(?!#|data:|scores\.(json|csv))', text)
    assert set(re.findall(r"https?://[^\"' ]+", text)) == {"http://www.w3.org/2000/svg"}


def test_files_that_the_report_no_longer_has_go_and_others_stay(tmp_path):
    sequence = make_report_sequence(tmp_path / "made", frames=2)
    scores = score(sequence)
    folder = write_report(sequence, scores).parent
    (folder / "mine.txt").write_text("kept")
    write_report(sequence, scores, ["albedo"])
    assert (folder / "mine.txt").exists()
    assert (folder / "data/frame/albedo/0001.js").exists()
    assert not (folder / "data/frame/normal/0001.js").exists()


def test_an_overwritten_sequence_loses_its_report(tmp_path):
    sequence = make_report_sequence(tmp_path / "made", frames=1)
    write_report(sequence, score(sequence))
    FrameSequence.create(sequence.folder, sequence.manifest, overwrite=True)
    assert set(contents(sequence.folder)) == {"manifest.json"}


def test_equal_input_gives_an_equal_report(tmp_path):
    sequence = make_report_sequence(tmp_path / "made", frames=2)
    scores = score(sequence)
    folder = write_report(sequence, scores).parent
    first = contents(folder)
    write_report(sequence, scores)
    assert contents(folder) == first


# What it says


def test_the_histogram_counts_pixels_by_their_error(reported):
    sequence, _, page = reported
    for method in page_data(page)["methods"]:
        images = [(sequence.read_frame(i)["color"] if method["name"] == "input" else
                   sequence.read_result(method["name"], i), sequence.read_reference(i).color)
                  for i in range(COUNT)]
        errors = np.concatenate([display_error(*pair).ravel() for pair in images])
        assert sum(method["histogram"]) == pytest.approx(1, abs=1e-3)
        above = sum(method["histogram"][24:])
        assert above == pytest.approx(np.mean(errors >= EDGES[24]), abs=1e-3)


def test_the_data_holds_every_measure_of_every_frame(reported):
    _, scores, page = reported
    data = page_data(page)
    assert [m["name"] for m in data["methods"]] == scores.ordered()
    for method in data["methods"]:
        scored = scores.methods[method["name"]]
        for metric in data["metrics"]:
            name = metric["name"]
            assert method["values"][name] == scored[name]
            assert method["perFrame"][name] == [row[name] for row in scored.per_frame]


def test_the_front_turns_round_where_less_is_better(reported):
    fronts = {m["name"]: m["front"] for m in page_data(reported[2])["metrics"]}
    assert fronts["psnr_srgb"] == ["rough", "fine"]
    assert fronts["relmse"] == ["rough", "fine"]


def test_the_table_has_every_method_and_marks_the_best(reported):
    _, scores, page = reported
    text = page.read_text()
    for name in scores.methods:
        assert f'data-method="{name}"' in text
    best = scores.methods["fine"]["psnr_srgb"]
    assert f'<td class="best">{best:.2f}</td>' in text


def test_names_from_files_cannot_become_markup(tmp_path):
    evil = "</script><script>alert(1)</script>"
    sequence = make_report_sequence(tmp_path / "made", frames=1, scene=evil, about=evil,
                                    objects=("wall", evil))
    text = write_report(sequence, score(sequence)).read_text()
    assert evil not in text
    assert text.count("</script>") == 2


def test_times_measured_in_turns_are_told_apart(reported):
    sequence, scores, _ = reported
    def said(*in_turns: str) -> tuple[str, list[bool]]:
        methods = {name: method.model_copy(update={"interleaved": name in in_turns})
                   for name, method in scores.methods.items()}
        data = page_data(write_report(sequence, scores.model_copy(update={"methods": methods}), []))
        return data["timesAre"], [m["inTurns"] for m in data["methods"]]

    assert said() == ("medians after the first, of each method's own run", [False] * 3)
    assert said("rough", "fine") == ("medians of times measured in turns", [False, True, True])
    assert said("fine") == ("measured in turns (filled) or medians of their own runs (hollow)",
                            [False, False, True])


def test_the_page_says_where_glossy_pixels_cannot_be_told(reported, tmp_path):
    assert "no pixel counts as glossy" in reported[2].read_text()
    sequence = FrameSequence(reported[0].folder, reported[0].manifest.model_copy(
        update={"channels": (*CHANNELS, "roughness")}))
    assert "no pixel counts as glossy" not in render_page(sequence, reported[1], {})


# What is missing or wrong


def test_without_references_there_are_still_pictures(tmp_path):
    sequence = make_report_sequence(tmp_path / "made", frames=1)
    (sequence.folder / "reference/0000.exr").unlink()
    data = page_data(write_report(sequence, score(sequence)))
    assert not data["hasReference"]
    assert data["metrics"] == []
    assert {m["name"] for m in data["methods"]} == {"input", *METHODS}


def test_an_unknown_channel_is_refused_by_name(reported):
    sequence, scores, _ = reported
    with pytest.raises(InputError, match="lacks the channel 'glow'"):
        write_report(sequence, scores, ["glow"])


def test_the_command_scores_first_where_there_are_no_scores(tmp_path):
    sequence = make_report_sequence(tmp_path / "made", frames=1)
    result = CliRunner().invoke(onespp.cli.app, ["report", str(sequence.folder)])
    assert result.exit_code == 0, result.output
    assert (sequence.folder / "scores.json").exists()
    assert "report/index.html" in result.output.replace("\n", "")
