"""The folders that students have, and what an import says and does not claim."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from onespp.denoise.catalog import PEERS, build
from onespp.denoise.report.html import write_report
from onespp.denoise.report.terminal import caption
from onespp.denoise.score.sequence import score
from onespp.render.errors import InputError
from onespp.render.files.exr import read_exr, write_exr
from onespp.render.files.manifest import Manifest
from onespp.render.files.sequence import FrameSequence
from onespp.render.games202.convert import RESULTS, export_games202, import_games202
from onespp.render.games202.layout import gaps
from tests.support.frames import make_frame, noisy, translation
from tests.support.report_sequence import HEIGHT, WIDTH, make_report_sequence

FRAMES = 3


def write(path: Path, image: np.ndarray) -> None:
    write_exr(path, dict(zip("RGB", np.moveaxis(image, 2, 0))))


@pytest.fixture
def box(tmp_path):
    """`box` with `input/`, and beside it results and references."""
    sequence = make_report_sequence(tmp_path / "ours", FRAMES)
    export_games202(sequence, tmp_path / "box/input")
    (tmp_path / "box/output").mkdir()
    for i in range(FRAMES):
        write(tmp_path / f"box/output/result_{i}.exr",
              sequence.read_result("fine", i).astype(np.float16))
        write(tmp_path / f"box/reference_{i}.exr", sequence.read_reference(i).color)
    return tmp_path / "box"


def taken(folder: Path, out: Path) -> tuple[FrameSequence, list[str]]:
    notes: list[str] = []
    return import_games202(folder, out, tell=notes.append), notes


def test_a_folder_that_holds_input_is_taken_whole(box, tmp_path):
    ours = FrameSequence.open(tmp_path / "ours")
    sequence, notes = taken(box, tmp_path / "s")
    assert sequence.manifest.scene == "box"
    assert sequence.frames == [0, 1, 2]
    assert sequence.methods() == [RESULTS]
    np.testing.assert_array_equal(sequence.read_result(RESULTS, 2),
                                  ours.read_result("fine", 2).astype(np.float16))
    reference = sequence.read_reference(1)
    np.testing.assert_array_equal(reference.color, ours.read_reference(1).color)
    assert reference.spp is None
    assert sequence.reference_spp(1) is None
    assert np.isnan(reference.variance).all()
    assert [note.split(" from ")[0] for note in notes] == ["took 3 references", "took 3 results"]


def test_input_itself_is_called_what_it_is_the_input_of(box, tmp_path):
    sequence, _ = taken(box / "input", tmp_path / "s")
    assert sequence.manifest.scene == "box"
    assert sequence.methods() == [RESULTS]
    assert sequence.has_reference(2)


def pad(folder: Path) -> None:
    for path in list(folder.iterdir()):
        stem, number = path.stem.split("_")
        path.rename(path.with_name(f"{stem}_{int(number):04d}{path.suffix}"))


def shout(folder: Path) -> None:
    for path in list(folder.iterdir()):
        path.rename(path.with_name(path.stem.lower() + path.suffix.upper()))


@pytest.mark.parametrize("rename", [pad, shout, lambda f: (pad(f), shout(f)),
                                    lambda f: f.rename(f.with_name("Input"))])
def test_padded_numbers_and_other_cases_are_the_same_frames(box, tmp_path, rename):
    plain, _ = taken(box, tmp_path / "plain")
    rename(box / "input")
    sequence, _ = taken(box, tmp_path / "s")
    assert sequence.manifest.model_dump() == plain.manifest.model_dump()
    for name in ("color", "id", "depth"):
        np.testing.assert_array_equal(sequence.read_frame(2)[name], plain.read_frame(2)[name])


def test_a_frame_under_two_names_is_refused(box, tmp_path):
    (box / "input/beauty_01.exr").write_bytes((box / "input/beauty_1.exr").read_bytes())
    with pytest.raises(InputError, match=r"both beauty_01\.exr and beauty_1\.exr: keep one"):
        taken(box, tmp_path / "s")


def test_a_folder_of_references_and_results_beside_frames(box, tmp_path):
    frames = box / "input"
    (frames / "reference").mkdir()
    for i in range(FRAMES):
        (box / f"reference_{i}.exr").rename(frames / f"reference/beauty_{i:03d}.exr")
        (box / f"output/result_{i}.exr").rename(frames / f"result_{i}.exr")
    sequence, _ = taken(frames, tmp_path / "s")
    assert all(sequence.has_reference(i) and sequence.has_result(RESULTS, i)
               for i in range(FRAMES))


def test_results_made_again_are_taken_again_and_strangers_are_told(box, tmp_path):
    taken(box, tmp_path / "s")
    again = np.full((HEIGHT, WIDTH, 3), 0.25, np.float16)
    write(box / "output/result_1.exr", again)
    write(box / "output/result_7.exr", again)
    (box / "output/result_2.exr").unlink()
    sequence, notes = taken(box, tmp_path / "s")
    assert (sequence.read_result(RESULTS, 1) == 0.25).all()
    assert not sequence.has_result(RESULTS, 2)
    assert "left out results without a frame: 7" in notes


@pytest.mark.parametrize("spoiled", ["reference_1.exr", "output/result_1.exr"])
def test_a_spoiled_companion_is_refused_before_anything_is_written(box, tmp_path, spoiled):
    write(box / spoiled, np.zeros((3, 4, 3), np.float32))
    with pytest.raises(InputError, match="is 4x3 pixels"):
        taken(box, tmp_path / "s")
    assert not (tmp_path / "s").exists()


# What nobody knows


def test_the_manifest_claims_nothing_that_nobody_knows(box, tmp_path):
    sequence, _ = taken(box, tmp_path / "s")
    path = sequence.folder / "manifest.json"
    data = json.loads(path.read_text())
    unknown = ("seed", "spp", "max_depth", "direct", "sampler", "reference_filter")
    assert {key: data[key] for key in unknown} == dict.fromkeys(unknown)
    path.write_text(json.dumps(data | {"spp": 1, "direct": "mis", "sampler": "pcg",
                                       "reference_filter": "centre"}))  # of an older version
    assert FrameSequence.open(sequence.folder).manifest == sequence.manifest
    taken(box, tmp_path / "s")  # and goes on
    rendered = Manifest(scene="a", frames=(0,), width=1, height=1, channels=("color",),
                        objects=("a",))
    assert (rendered.spp, rendered.direct, rendered.sampler) == (1, "mis", "pcg")


def test_scores_and_report_do_without(box, tmp_path):
    sequence, _ = taken(box, tmp_path / "s")
    scores = score(sequence)
    assert scores.spp is None
    assert scores.reference_spp is None
    assert scores.has_reference
    assert scores.methods[RESULTS]["psnr_srgb"] is not None
    assert scores.methods[RESULTS].method == "files"
    assert "reference of unknown spp" in caption(scores)
    text = write_report(sequence, scores).read_text()
    assert "result (files)" in text
    assert "None" not in text.split("<script")[0]


# Gaps


def test_gaps_are_told_and_strides_are_not(box, tmp_path):
    for path in (*box.glob("input/*_1.*"), *box.glob("*/result_*"), *box.glob("reference_*")):
        path.unlink()
    assert taken(box, tmp_path / "stride")[1] == []  # 0 and 2
    export_games202(make_report_sequence(tmp_path / "five", 5), tmp_path / "gap/input")
    for path in (tmp_path / "gap/input").glob("*_2.*"):
        path.unlink()
    assert taken(tmp_path / "gap", tmp_path / "s")[1] == [
        "there is no frame between 1 and 3: methods with a history take 3 for the frame after 1"]


@pytest.mark.parametrize(("frames", "found"), [
    ([0, 1, 2], []), ([0, 2, 4], []), ([5], []), ([0, 1, 3, 4], [(1, 3)]),
    ([0, 2, 3, 9], [(0, 2), (3, 9)])])
def test_gaps_are_steps_beyond_the_least(frames, found):
    assert gaps(frames) == found


@pytest.mark.parametrize("name", ["temporal", "svgf", "onespp"])
def test_history_is_carried_over_a_gap_by_the_matrices(name):
    """As good as without one: where the surfaces went is known, however many frames are missing."""
    clean = [make_frame(48, 64, index=i, board=translation(0.05 * i, 0, 0)) for i in range(8)]
    kept = (0, 1, 2, 3, 4, 7)

    def error(frames: list[int]) -> float:
        method = build(name)
        state = method.init(48, 64)
        for i in frames:
            image, state = method(noisy(clean[i], seed=i), state)
        there = clean[7]["id"] >= 0
        return float(np.mean(np.square(image - clean[7]["color"])[there]))

    alone = error([7])
    assert error(list(kept)) < 0.75 * alone


# The command line


def test_import_can_overwrite_as_its_message_says(call, box, tmp_path):
    out = tmp_path / "s"
    assert call("import", box, "--out", out, "--fps", 12)[0] == 0
    assert FrameSequence.open(out).manifest.fps == 12
    write(box / "input/beauty_1.exr", np.ones((HEIGHT, WIDTH, 3), np.float32))
    code, _, error = call("import", box, "--out", out, "--fps", 12)
    assert code == 2
    assert "--overwrite" in error
    code, text, error = call("import", box, "--out", out, "--fps", 12, "--overwrite")
    assert code == 0, error
    assert "imported 3 frames" in text
    assert "took 3 references" in text
    assert (FrameSequence.open(out).read_frame(1)["color"] == 1).all()


def test_import_refuses_other_conventions_and_takes_them_if_told(call, box, tmp_path):
    for path in (box / "input").glob("matrix_*.mat"):
        data = path.read_bytes()
        matrices = np.frombuffer(data, "<f4", offset=4).reshape(-1, 4, 4)
        path.write_bytes(data[:4] + np.swapaxes(matrices, 1, 2).tobytes())
    code, _, error = call("import", box, "--out", tmp_path / "s")
    assert code == 2
    assert "transposed matrices" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "s/manifest.json").exists()
    assert call("import", box, "--out", tmp_path / "s", "--no-check")[0] == 0


def test_on_plain_frames_the_default_says_what_is_better(call, box, tmp_path):
    call("import", box, "--out", tmp_path / "s")
    code, text, error = call("denoise", tmp_path / "s")
    assert code == 0, error
    line, = (line for line in text.splitlines() if "default method" in line)
    assert "temporal-oidn or oidn-high" in line
    assert ("pip install" in line) != PEERS["oidn-high"].available()
    assert "default method" not in call("denoise", tmp_path / "s", "--method", "onespp")[1]


def test_a_missing_frame_is_told_when_denoising(call, box, tmp_path):
    call("import", box, "--out", tmp_path / "s")
    (tmp_path / "s/frames/0001.exr").unlink()
    assert "there is no frame between 0 and 2" in call(
        "denoise", tmp_path / "s", "--method", "temporal")[1]


def test_negative_radiance_is_told_of(box, tmp_path):
    for path in [*box.glob("input/beauty_*"), *box.glob("reference_*")]:
        planes, _ = read_exr(path, ("R", "G", "B"))
        write(path, np.abs(np.stack([planes[c] for c in "RGB"], -1)))
    assert not any("negative radiance" in note for note in taken(box, tmp_path / "plain")[1])
    for path in (box / "input/beauty_1.exr", box / "reference_2.exr"):
        planes, _ = read_exr(path, ("R", "G", "B"))
        image = np.stack([planes[c] for c in "RGB"], -1)
        image[2, 3, 1] = -0.5
        write(path, image)
    sequence, notes = taken(box, tmp_path / "negative")
    assert sequence.read_frame(1)["color"][2, 3, 1] == -0.5
    for what, frame in (("beauty", 1), ("reference", 2)):
        told = [note for note in notes if f"the {what} has negative radiance" in note]
        assert told == [f"the {what} has negative radiance in frames {frame}: methods take it as "
                        "it is, scores as black"]
