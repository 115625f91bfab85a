"""How numbers came to be: commands as they were typed, and machines, with what they made."""

from __future__ import annotations

import json
import os
import platform
import re
import shlex
from html import unescape

import pytest

from onespp.denoise.report.html import write_report
from onespp.denoise.report.provenance import provenance
from onespp.denoise.score.commands import commands
from onespp.denoise.score.scorecard import read_scores
from onespp.denoise.score.sequence import score
from onespp.render.files.json_file import format_json
from onespp.render.files.sequence import FrameSequence
from onespp.render.files.times import MethodTime, Times, read_times
from onespp.render.host.machine import machine
from tests.support.made_sequence import COUNT, METHODS, make_sequence
from tests.support.small_sequence import small_manifest


def listed(page) -> list[str]:
    """The commands that a report's page shows."""
    return [unescape(line) for line in re.findall(r"<li><code>(.*?)</code>", page.read_text())]


def test_each_command_keeps_its_line_as_it_was_typed_and_the_report_shows_all(call, tmp_path):
    out = tmp_path / "a folder"
    first = ["render", "box", "--size", "16x12", "--channels", "color,normal,depth,id"]
    lines = [[*first, "--frames", "0:1", "--out", out], [*first, "--frames", "0:2", "--out", out],
             ["denoise", out, "--method", "temporal", "--set", "alpha=0.3", "--name", "mine"],
             ["time", out, "--method", "temporal", "--frames", "1", "--rounds", "1"],
             ["score", out, "--no-pictures"], ["report", out, "--channels", "depth"]]
    for line in (*lines[:2], lines[1], *lines[2:]):  # one twice: it is kept once
        code, _, error = call(*line)
        assert code == 0, error
    typed = [shlex.join(["onespp", *map(str, line)]) for line in lines]
    assert f"'{out}'" in typed[0]
    assert json.loads((out / "scores.json").read_text())["commands"] == typed[:-1]
    assert listed(out / "report/index.html") == typed
    assert "No command line was recorded" not in (out / "report/index.html").read_text()


def test_numbers_say_which_machine_they_are_from(call, tmp_path):
    made = make_sequence(tmp_path / "made")
    assert call("denoise", made.folder, "--method", "spatial-none", "--name", "x")[0] == 2
    scores = score(made)
    assert scores.machine == scores.methods["rough"].machine == ""  # not known, and not made up
    run = made.read_run("rough").model_copy(update={"machine": "A CPU, 8 cores"})
    made.write_run("rough", run)
    assert score(made).methods["rough"].machine == "A CPU, 8 cores"
    facts = provenance(made, read_scores(made.folder / "scores.json"))
    assert ("results", "A CPU, 8 cores; llvm, 2 threads") in facts["machines"]
    made.write_run("fine", run.model_copy(update={"method": "fine", "machine": "B CPU"}))
    facts = provenance(made, read_scores(made.folder / "scores.json"))
    assert ("results of rough", "A CPU, 8 cores; llvm, 2 threads") in facts["machines"]
    assert ("results of fine", "B CPU; llvm, 2 threads") in facts["machines"]


def test_the_machine_is_described_and_not_named():
    text = machine()
    affinity = getattr(os, "sched_getaffinity", None)
    cores = len(affinity(0)) if affinity else os.cpu_count() or 1
    assert re.search(rf"\b{cores} cores?\b", text)
    assert platform.system() in text
    assert "\n" not in text
    host = platform.node().split(".")[0]
    assert len(host) < 4 or host not in text


def test_a_sequence_that_goes_on_keeps_all_its_commands_once(tmp_path):
    for line, frames in (("a", (0,)), ("b", (1,)), ("a", (0,))):
        made = FrameSequence.create(tmp_path / "s", small_manifest(frames=frames, commands=(line,)))
    assert made.manifest.commands == ("a", "b")
    assert FrameSequence.open(tmp_path / "s").manifest.commands == ("a", "b")


def test_what_was_not_recorded_is_said_and_not_made_up(tmp_path):
    made = make_sequence(tmp_path / "made")
    scores = score(made, command="onespp score made")
    page = write_report(made, scores)
    assert listed(page) == ["onespp score made"]
    assert "No command line was recorded for the sequence, rough, fine." in page.read_text()
    for name in METHODS:
        made.write_run(name, made.read_run(name).model_copy(update={"command": f"make {name}"}))
    assert commands(made, METHODS) == [f"make {name}" for name in METHODS]


def test_files_of_before_commands_were_recorded_still_open(tmp_path):
    made = make_sequence(tmp_path / "made")
    score(made, command="onespp score made")
    one = MethodTime(parameters={}, first_ms=1.0, ms=1.0, ms_quartiles=(1.0, 1.0), ratio=1.0,
                     ratio_quartiles=(1.0, 1.0))
    (made.folder / "times.json").write_text(format_json(Times(
        size=(33, 21), frames=1, steps=1, device="llvm", threads=1, machine="x86_64",
        ratio_to="fine", methods={"fine": one})))

    for name in ("manifest.json", "times.json", "scores.json", "denoised/fine/run.json"):
        text = (made.folder / name).read_text()
        old = re.sub(r',\s*"commands?": (\[[^]]*\]|"[^"]*")', "", text)
        old = old if name == "times.json" else re.sub(r',\s*"machine": "[^"]*"', "", old)
        assert len(old) < len(text)
        (made.folder / name).write_text(old)
    sequence = FrameSequence.open(made.folder)
    scores = read_scores(made.folder / "scores.json")
    assert scores.commands == []
    assert len(scores.frames) == COUNT
    assert read_times(made.folder) is not None
    assert "the scores" in write_report(sequence, scores).read_text()


@pytest.mark.parametrize("arguments", [["scenes"], []])
def test_a_command_that_makes_nothing_records_nothing(call, arguments):
    from onespp.render.cli.terminal import command_line

    call(*arguments)
    assert command_line() == ""
