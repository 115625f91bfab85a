"""`onespp new`: what it writes runs at once and is clean; what it refuses."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from onespp.denoise.catalog import parameters
from onespp.denoise.own_method import from_file
from onespp.denoise.score.scorecard import read_scores
from onespp.render.files.sequence import FrameSequence
from onespp.templates.write import KINDS

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_the_files_run_from_scene_to_score(call):
    for kind, name in zip(KINDS, ("box_blur", "edges", "jump")):
        code, text, _ = call("new", kind, name)
        assert (code, text.startswith(f"wrote {name}.py; try it: onespp ")) == (0, True)
    assert call("render", "jump.py", "--frames", "0:2", "--size", "48x32", "--reference-spp", 16,
                "--out", "made")[0] == 0
    assert FrameSequence.open(Path("made")).manifest.scene == "jump"
    assert call("denoise", "made", "--method", "box_blur.py", "--set", "radius=2")[0] == 0
    assert call("score", "made", "--metric", "edges.py", "--no-pictures")[0] == 0
    scores = read_scores(Path("made/scores.json"))
    methods = {name: method["psnr_srgb"] for name, method in scores.methods.items()}
    assert methods["box_blur"] > methods["input"] + 1, methods
    assert scores.methods["box_blur"]["edges"] < scores.methods["input"]["edges"]
    assert scores.measures["edges"].label == "edges"
    assert "class BoxBlur:" in Path("box_blur.py").read_text()
    assert not any("my_" in path.read_text() for path in Path().glob("*.py"))


@pytest.mark.parametrize("program", [("ruff", "check", "--isolated"),
                                     ("pyright", "--pythonpath", sys.executable)])
def test_the_files_are_clean(call, program):
    names = ("a_filter_with_a_rather_long_name", "an_error_with_a_rather_long_name", "a_scene")
    for kind, name in zip(KINDS, names):
        assert call("new", kind, name)[0] == 0
    Path("pyrightconfig.json").write_text(f'{{"extraPaths": ["{ROOT}"]}}')  # sees no editable ones
    command = [str(Path(sys.executable).with_name(program[0])), *map(str, program[1:])]
    done = subprocess.run([*command, *(f"{name}.py" for name in names)], capture_output=True,
                          text=True, timeout=200, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_value_that_cannot_be_is_refused_by_the_file(call):
    call("new", "method", "blur.py")
    assert parameters(from_file("blur.py")) == {"radius": 1}
    code, _, error = call("denoise", "made", "--method", "blur.py", "--set", "radius=0")
    assert code == 2
    assert "\n" not in error.strip()


def test_a_file_goes_into_a_folder_that_is_there(call):
    Path("filters").mkdir()
    assert call("new", "method", "filters/blur")[0] == 0
    assert Path("filters/blur.py").is_file()


@pytest.mark.parametrize("kind", KINDS)
def test_the_names_of_the_examples_can_be_used(call, kind):
    name = {"method": "my_filter"}.get(kind, f"my_{kind}")
    assert call("new", kind, name)[0] == 0
    assert Path(f"{name}.py").is_file()


@pytest.mark.parametrize(("kind", "name", "words"), [
    ("method", "there", "there.py is there already"),
    ("method", "no/blur", "there is no folder no"),
    ("method", "a-b", "cannot be the name of a method"), ("metric", "1x", "cannot be the name"),
    ("scene", "", "cannot be the name of a scene"), ("scene", "x" * 41, "cannot be the name"),
    ("method", "class", "cannot be the name"), ("method", "_x", "cannot be the name"),
    ("method", "naïve", "cannot be the name"), ("method", "svgf", "'svgf' is taken"),
    ("method", "reference", "'reference' is taken"), ("metric", "flip", "'flip' is taken"),
    ("metric", "ms", "'ms' is taken"), ("scene", "box", "'box' is taken"),
    ("method", "frame", "'frame' is a name that the file uses"),
    ("metric", "Metric", "'Metric' is a name that the file uses")])
def test_what_cannot_be_written_is_one_sentence(call, kind, name, words):
    Path("there.py").write_text("mine")
    code, out, error = call("new", kind, name)
    assert (code, out, words in error, error.count("\n")) == (2, "", True, 1), error
    assert [path.name for path in Path().iterdir()] == ["there.py"]
    assert Path("there.py").read_text() == "mine"
