"""Error by cause, times and programs of others, as a user of the command line meets them."""

from __future__ import annotations

import json
import shlex
import sys

import numpy as np
import pytest

from onespp.denoise.metrics.table import STABILITY
from onespp.denoise.score.causes import CAUSES, HISTORIES
from onespp.denoise.score.sequence import score
from onespp.render.files.manifest import Manifest, Run
from onespp.render.files.sequence import FrameSequence, Reference
from tests.support.frames import make_frame, translation

H, W, COUNT = 24, 30, 4
CHANNELS = ("color", "albedo", "normal", "position", "depth", "id")


@pytest.fixture
def sequence(tmp_path) -> FrameSequence:
    """A board that moves before a wall; `half` has no error but on the board, `dark` is black."""
    made = FrameSequence.create(tmp_path / "a", Manifest(
        scene="board", frames=tuple(range(COUNT)), width=W, height=H, reference_spp=64,
        channels=CHANNELS, objects=("wall", "board")))
    for i in range(COUNT):
        frame = make_frame(H, W, index=i, board=translation(0.6 * i, 0, 0), wall_end=1e9)
        truth = frame["color"]
        made.write_frame(frame)
        made.write_reference(i, Reference(truth, np.full_like(truth, 1e-8), 64))
        half = np.where(frame["id"][..., None] == 1, 0.5 * truth, truth)
        made.write_result("half", i, half.astype(np.float32))
        made.write_result("dark", i, 0 * truth)
    for name in ("half", "dark"):
        made.write_run(name, Run(method=name))
    return made


def test_the_error_of_a_method_stands_where_it_was_made(sequence):
    scores = score(sequence)
    half, dark = (scores.methods[name] for name in ("half", "dark"))
    assert list(half.by_cause) == list(CAUSES)
    assert list(half.by_history) == list(HISTORIES)
    for classes in (half.by_cause, half.by_history, dark.by_cause, dark.by_history):
        assert sum(c.pixels for c in classes.values()) == pytest.approx(1)
        assert sum(c.mse_share for c in classes.values()) == pytest.approx(1)
    assert half.by_cause["moving"].mse_share > 0.8
    assert half.by_cause["static"].mse_share == 0
    assert half.by_cause["static"].psnr_srgb == 150
    assert dark.by_cause["static"].mse_share > 0.3
    assert dark.by_cause["background"].psnr_srgb is None
    assert dark.by_cause["disoccluded"].pixels > 0
    assert dark.by_history["16+"].pixels == 0


def test_measures_of_change_begin_with_the_second_frame(sequence):
    half = score(sequence).methods["half"]
    for name in STABILITY:
        assert half.per_frame[0][name] is None
        assert all(row[name] is not None for row in half.per_frame[1:])
        assert half[name] == pytest.approx(np.mean([r[name] for r in half.per_frame[1:]]))
    assert half["boiling"] < half["flicker"]


def test_a_gap_in_the_frames_is_no_step(sequence):
    (sequence.folder / "denoised/half/0001.exr").unlink()
    half = score(sequence).methods["half"]
    assert [row["flicker"] is None for row in half.per_frame] == [True, True, False]
    (sequence.folder / "frames/0002.exr").unlink()
    dark = score(sequence).methods["dark"]
    assert [row["flicker"] is None for row in dark.per_frame] == [True, False, True]


def test_by_cause_prints_a_table_of_each(call, sequence):
    code, out, _ = call("score", sequence.folder, "--by-cause", "--no-pictures")
    assert code == 0
    assert "by cause" in out
    assert "by history" in out
    for heading in ("disoccluded", "moving", "2-3 frames", "of all pixels"):
        assert heading in out
    assert "background" not in out  # there is none
    tables, wrote = out.split("wrote ")
    assert str(sequence.folder) in wrote  # a line as long as the path
    assert max(map(len, tables.splitlines())) <= 100


def test_by_cause_without_guides_says_what_it_takes(call, tmp_path):
    from tests.support.made_sequence import make_sequence

    made = make_sequence(tmp_path / "made")
    code, out, _ = call("score", made.folder, "--by-cause", "--no-pictures")
    assert code == 0
    assert "normal, depth and id" in " ".join(out.split())


def test_time_measures_in_turns_and_score_takes_it(call, sequence):
    assert call("denoise", sequence.folder, "--method", "bilateral", "--method", "temporal")[0] == 0
    code, out, error = call("time", sequence.folder, "--method", "bilateral", "--method",
                            "temporal", "--frames", 2, "--rounds", 2)
    assert code == 0, error
    assert "times bilateral" in out
    code, out, _ = call("score", sequence.folder, "--no-pictures")
    assert "Times of bilateral, temporal were measured in turns" in " ".join(out.split())
    times = json.loads((sequence.folder / "times.json").read_text())
    scores = json.loads((sequence.folder / "scores.json").read_text())
    for name in ("bilateral", "temporal"):
        assert scores["methods"][name]["ms_per_frame"] == times["methods"][name]["ms"]


def test_an_external_program_is_a_row_of_the_table(call, sequence, tmp_path):
    program = tmp_path / "copy.py"
    program.write_text("import shutil, sys\nfor k in range(int(sys.argv[3])):\n"
                       "    shutil.copy(f'{sys.argv[1]}/beauty_{k}.exr', "
                       "f'{sys.argv[2]}/result_{k}.exr')\n")
    line = shlex.join([sys.executable, str(program), "{input}", "{output}", "{frames}"])
    code, out, error = call("denoise", sequence.folder, "--external", line, "--name", "cpp")
    assert code == 0, error
    assert "4 frames by cpp" in out
    _, out, _ = call("score", sequence.folder, "--no-pictures")
    assert "cpp" in out
    for arguments in (["--external", line], ["--external", line, "--name", "x", "--set", "a=1"],
                      ["--external", line, "--name", "x", "--method", "atrous"]):
        code, _, error = call("denoise", sequence.folder, *arguments)
        assert code == 2
        assert "--external takes --name" in error
