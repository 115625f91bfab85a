"""The command line as a user meets it: files made, exit codes, one sentence for bad input."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from onespp.render.files.sequence import FrameSequence
from onespp.scenes.catalog import SCENES
from onespp.scenes.hard import HARD

SCENE = '''
from onespp.scenes.description import Camera, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse
from onespp.scenes.transforms import look_at, rotate, scale, translate

def scene():
    return Scene("mine", "a scene of my own", (
        Shape("floor", Rectangle(), diffuse((0.5, 0.5, 0.5)), rotate((1, 0, 0), -90) @ scale(4)),
        Shape("ball", Sphere(), diffuse((0.8, 0.3, 0.2)),
              lambda f: translate((0.1 * f, 1, 0)) @ scale(0.5)),
        Shape("lamp", Sphere(), diffuse((0, 0, 0)), translate((0, 4, 0)), (9.0, 9.0, 9.0)),
    ), Camera(look_at((0, 2, 6), (0, 1, 0))), frames=3, width=16, height=12)
'''


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "my scene.py"
    path.write_text(SCENE)
    return path


def refused(result, *words: str) -> None:
    code, _, error = result
    assert code == 2
    assert error.startswith("onespp: ")
    assert error.count("\n") == 1
    for word in words:
        assert word in error


def test_scenes_are_listed_with_what_moves_and_the_hard_ones_in_a_group_of_their_own(call):
    code, out, _ = call("scenes")
    assert code == 0
    ordinary, hard, *_ = out.split("\n\n")
    assert all(f"\n{name}: " in f"\n{ordinary}" for name in SCENES)
    assert len(hard.splitlines()) == 1 + len(HARD)
    assert "box: " in out
    assert "20 frames of 512x512" in out
    assert "80 frames of 1280x720" in out
    assert "moves: camera" in out


def test_a_scene_file_goes_all_the_way_to_a_score(call, scene_file, tmp_path):
    out = tmp_path / "a folder with spaces ü"
    code, text, error = call("run", scene_file, "--out", out, "--reference-spp", 16)
    assert code == 0, error
    assert "onespp" in text
    scores = json.loads((out / "scores.json").read_text())
    assert scores["frames"] == [0, 1, 2]
    assert scores["reference_spp"] == 16
    assert set(scores["methods"]) == {"input", "onespp"}
    for name in ("scores.csv", "pictures/sheet_0000.png", "pictures/sequence.mp4",
                 "denoised/onespp/0002.exr", "reference/0002.exr", "frames/0002.json"):
        assert (out / name).stat().st_size > 0, name

    code, text, _ = call("score", out, "--json", "-", "--no-pictures")
    assert code == 0
    assert json.loads(text)["methods"]["input"]["psnr_srgb"] > 0


def test_parameters_and_names_make_results_side_by_side(call, scene_file, tmp_path):
    out = tmp_path / "a"
    call("render", scene_file, "--out", out, "--frames", "0:2", "--reference-spp", 4)
    assert call("denoise", out, "--method", "atrous", "--method", "bilateral")[0] == 0
    assert call("denoise", out, "--method", "bilateral", "--set", "radius=1",
                "--name", "small")[0] == 0
    sequence = FrameSequence.open(out)
    assert sequence.methods() == ["atrous", "bilateral", "small"]
    assert sequence.read_run("small").parameters["radius"] == 1
    assert (sequence.read_result("small", 0) != sequence.read_result("bilateral", 0)).any()


def test_results_of_other_parameters_are_not_mixed(call, scene_file, tmp_path):
    out = tmp_path / "a"
    call("render", scene_file, "--out", out)
    call("denoise", out, "--method", "bilateral")
    (out / "frames/0002.exr").unlink()
    call("denoise", out, "--method", "bilateral", "--set", "radius=1")
    assert not FrameSequence.open(out).has_result("bilateral", 2)


def test_a_sequence_without_reference_reports_all_but_the_error(call, scene_file, tmp_path):
    out = tmp_path / "a"
    call("render", scene_file, "--out", out)
    call("denoise", out)
    code, _, _ = call("score", out)
    assert code == 0
    method = json.loads((out / "scores.json").read_text())["methods"]["onespp"]
    assert method["psnr_srgb"] is None
    assert method["ms_per_frame"] > 0


def test_games202_files_make_the_round_trip(call, scene_file, tmp_path):
    call("render", scene_file, "--out", tmp_path / "a")
    assert call("export", tmp_path / "a", "--format", "games202", "--out", tmp_path / "g")[0] == 0
    assert call("import", tmp_path / "g", "--out", tmp_path / "b")[0] == 0
    assert call("denoise", tmp_path / "b")[0] == 0
    ours, theirs = FrameSequence.open(tmp_path / "a"), FrameSequence.open(tmp_path / "b")
    assert (ours.read_frame(1)["color"] == theirs.read_frame(1)["color"]).all()


def test_running_again_with_more_frames_goes_on(call, scene_file, tmp_path):
    out = tmp_path / "a"
    call("render", scene_file, "--out", out, "--frames", "0:1")
    before = (out / "frames/0000.exr").stat().st_mtime_ns
    assert call("render", scene_file, "--out", out, "--frames", "0:3")[0] == 0
    assert (out / "frames/0000.exr").stat().st_mtime_ns == before
    assert FrameSequence.open(out).frames == [0, 1, 2]


@pytest.mark.parametrize(("arguments", "words"), [
    (("render", "bocks"), ("bocks", "box")),
    (("render", "nowhere.py"), ("nowhere.py",)),
    (("render", "box", "--size", "0x4"), ("0x4", "1 to")),
    (("render", "box", "--size", "big"), ("big", "640x360")),
    (("render", "box", "--frames", "5:2"), ("5:2",)),
    (("render", "box", "--frames", "-1"), ("-1",)),
    (("render", "box", "--seed", "-3"), ("-3",)),
    (("render", "box", "--channels", "color,smell"), ("smell", "albedo")),
    (("render", "box", "--device", "abacus"), ("abacus", "llvm")),
    (("render", "box", "--threads", "0"), ("0",)),
    (("render", "box", "--reference-spp", "-1", "--size", "4x4"), ("4 spp",)),
    (("run", "box", "--reference-spp", "0", "--size", "4x4"), ("4 spp",)),
    (("denoise", "nowhere"), ("nowhere", "onespp render")),
    (("score", "nowhere"), ("nowhere",)),
    (("export", "nowhere"), ("nowhere",)),
    (("import", "nowhere"), ("nowhere",)),
])
def test_bad_input_is_one_sentence(call, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    refused(call(*arguments), *words)
    assert not list(tmp_path.rglob("*.exr"))


@pytest.mark.parametrize(("arguments", "words"), [
    (("--method", "magic"), ("magic", "bilateral")),
    (("--method", "bilateral", "--set", "flavour=3"), ("flavour", "radius")),
    (("--method", "bilateral", "--set", "radius"), ("NAME=VALUE",)),
    (("--method", "bilateral", "--set", "radius=-1"), ("radius", "-1")),
    (("--method", "bilateral", "--method", "atrous", "--name", "x"), ("--name",)),
    (("--method", "bilateral", "--name", "../x"), ("../x",)),
])
def test_a_bad_method_is_one_sentence(call, scene_file, tmp_path, arguments, words):
    call("render", scene_file, "--out", tmp_path / "a", "--frames", "0")
    refused(call("denoise", tmp_path / "a", *arguments), *words)
    assert not (tmp_path / "x").exists()


def test_a_damaged_frame_is_named_and_other_results_are_kept(call, scene_file, tmp_path):
    out = tmp_path / "a"
    call("render", scene_file, "--out", out)
    call("denoise", out, "--method", "atrous")
    frame = out / "frames/0001.exr"
    frame.write_bytes(frame.read_bytes()[:700])
    refused(call("denoise", out, "--method", "bilateral"), "0001.exr")
    assert FrameSequence.open(out).has_result("bilateral", 0)
    assert FrameSequence.open(out).has_result("atrous", 2)


def test_another_sequence_is_not_overwritten_unasked(call, scene_file, tmp_path):
    out = tmp_path / "a"
    call("render", scene_file, "--out", out)
    before = (out / "frames/0000.exr").read_bytes()
    refused(call("render", scene_file, "--out", out, "--seed", 1), "seed", "--overwrite")
    assert (out / "frames/0000.exr").read_bytes() == before
    assert call("render", scene_file, "--out", out, "--seed", 1, "--overwrite")[0] == 0
    assert (out / "frames/0000.exr").read_bytes() != before


@pytest.mark.parametrize("how", [
    signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_a_stopped_render_ends_in_a_sentence_and_goes_on_to_the_same_bytes(
        how, call, scene_file, tmp_path):
    arguments = ["render", str(scene_file), "--frames", "0:20", "--size", "48x48",
                 "--reference-spp", "64"]
    process = subprocess.Popen([sys.executable, "-m", "onespp", *arguments, "--out",
                                str(tmp_path / "stopped")], stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60
    while not (tmp_path / "stopped/reference/0001.exr").exists():
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(process.pid, how)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert error.splitlines()[-1].startswith("onespp: stopped")
    assert "Traceback" not in error
    assert call(*arguments, "--out", tmp_path / "stopped")[0] == 0
    assert call(*arguments, "--out", tmp_path / "whole")[0] == 0
    for path in (tmp_path / "whole").rglob("*.exr"):
        other = tmp_path / "stopped" / path.relative_to(tmp_path / "whole")
        assert other.read_bytes() == path.read_bytes(), path.name
    assert not list((tmp_path / "stopped").rglob("*.npz"))


def test_the_package_runs_as_a_module(tmp_path, scene_file):
    for arguments in (["render", str(scene_file), "--out", str(tmp_path / "a"), "--frames", "0"],
                      ["denoise", str(tmp_path / "a"), "--method", "atrous"]):
        done = subprocess.run([sys.executable, "-m", "onespp", *arguments], capture_output=True,
                              text=True, check=False)
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("words", [
    ["score", "{}"], ["report", "{}"], ["denoise", "{}"], ["import", "{}"], ["export", "{}"],
    ["compare", "{}", "{}"], ["lead", "{}", "{}"], ["render", "box", "--out", "{}"]])
def test_a_name_that_is_too_long_is_one_sentence(call, words):
    refused(call(*(word.format("a" * 300) for word in words)), "too long")


@pytest.mark.parametrize(("method", "words"), [
    ("svfg", ["unknown method 'svfg'"]), ("asvgf", ["replay", "--channels +gradient"])])
def test_a_run_refuses_a_method_before_it_renders(call, scene_file, tmp_path, method, words):
    out = tmp_path / "out"
    refused(call("run", scene_file, "--out", out, "--method", method), *words)
    assert not out.exists()


@pytest.mark.parametrize("option", ["--side", "--repeats", "--max-depth"])
@pytest.mark.parametrize("value", ["0", "-3", "99999999"])
def test_bench_render_refuses_what_cannot_be_timed(call, option, value):
    code, _, error = call("bench", "render", "box", option, value)
    assert code == 2
    assert option in error
    assert "range" in error


def test_a_size_is_written_in_plain_digits(call, tmp_path):
    refused(call("render", "box", "--size", "\u0661x\u0662", "--out", tmp_path / "o"), "--size")
