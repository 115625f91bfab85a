"""Words completed as the three shells ask for them, quickly, and all that there are."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import click
import pytest

from onespp.cli import app
from onespp.cli.completion import SHELLS, WORDS
from onespp.datasets.plan import PRESETS
from onespp.denoise.catalog import METHODS, PEERS, build, parameters
from onespp.render.channels import OFFERED
from onespp.scenes.catalog import GENERATED, SCENES
from onespp.scenes.hard import HARD
from tests.support.made_sequence import make_sequence

KINDS = {"method": "method", "methods": "method", "peer": "method", "settings": "setting",
         "scene": "scene", "channels": "channel", "device": "device", "folder": "sequence",
         "folders": "sequence", "seeds": "sequence", "truth_folder": "sequence", "out": "file",
         "json_to": "file"}
SPECIAL = {("tune", "names"): "parameter", ("hard", "names"): "hard", ("import", "folder"): "dir",
           ("dataset", "plan"): [*PRESETS], ("dataset", "settings"): "",
           ("dataset", "verify"): "dir"}


def kind(command: str, parameter: click.Parameter) -> str | list[str]:
    if isinstance(parameter.type, click.Choice):
        return [str(choice) for choice in parameter.type.choices]
    known = SPECIAL.get((command, parameter.name or ""), KINDS.get(parameter.name or "", ""))
    return known or ("file" if isinstance(parameter.type, click.Path) else "")


def described(command: str, p: click.Parameter) -> dict:
    return {"names": [*p.opts, *p.secondary_opts], "kind": kind(command, p),
            **({"many": True} if p.multiple or p.nargs == -1 else {}),
            **({"flag": True} if getattr(p, "is_flag", False) else {})}


def words() -> dict:
    return {
        "commands": {name: {"help": command.get_short_help_str(80), "parameters": [
            described(name, p) for p in command.params]} for name, command in app.commands.items()},
        "methods": {name: [*parameters(build(name))] for name in (*METHODS, *PEERS)},
        "scenes": [*SCENES, *GENERATED, *(f"hard/{name}" for name in HARD)],
        "hard": [*HARD], "channels": [*OFFERED], "devices": ["auto", "llvm", "cuda", "metal"]}


def test_the_words_are_those_of_the_commands_and_catalogues(request):
    if request.config.getoption("--regenerate"):
        WORDS.write_text(json.dumps(words(), indent=1) + "\n")
    assert json.loads(WORDS.read_text()) == words(), \
        "run `pytest tests/cli/test_completion.py --regenerate`"


def asked(line: str, cwd=None) -> list[str]:
    """What bash would be offered at the end of a line, by the installed program."""
    typed = line.split(" ")
    done = subprocess.run(
        [sys.executable, "-m", "onespp"], cwd=cwd, capture_output=True, text=True, check=True,
        env={**os.environ, "_ONESPP_COMPLETE": "bash_complete", "COMP_WORDS": line,
             "COMP_CWORD": str(len(typed) - 1)})
    return [item.split(",", 1)[1] for item in done.stdout.splitlines() if item]


@pytest.mark.parametrize(("line", "expected"), [
    ("onespp comp", ["compare", "completion"]),
    ("onespp render bo", ["box"]),
    ("onespp render hard/no-such-", ["hard/no-such-"]),
    ("onespp render generated/2", ["generated/2", "generated/20", "generated/21", "generated/22",
                                   "generated/23"]),
    ("onespp denoise x --method svg", ["svgf"]),
    ("onespp denoise x --method svgf --method oidn-h", ["oidn-high"]),
    ("onespp denoise x --method svgf,atr", ["svgf,atrous"]),
    ("onespp run box --channels albedo,norm", ["albedo,normal"]),
    ("onespp denoise x --method oidn-high --set q", ["quality="]),
    ("onespp denoise x --method oidn-high --set alpha", []),
    ("onespp denoise x --set color_b", ["color_box="]),
    ("onespp tune x --method svgf --parameter alpha_", ["alpha_moments"]),
    ("onespp render box --sampler z", ["zsobol"]),
    ("onespp bench --device cu", ["cuda"]),
    ("onespp dataset ro", ["rooms"]), ("onespp completion f", ["fish"])])
def test_a_word_is_completed(line, expected):
    found = asked(line)
    if expected == ["color_box="]:
        found = [word for word in found if word in expected]
    assert found == expected


def test_folders_with_sequences_are_found_and_others_are_not(tmp_path):
    make_sequence(tmp_path / "data/one")
    make_sequence(tmp_path / "data/suite/two")
    (tmp_path / "data/other").mkdir()
    (tmp_path / "docs").mkdir()
    assert asked("onespp score d", tmp_path) == ["data/one", "data/suite/two"]
    assert asked("onespp score data/o", tmp_path) == ["data/one"]
    assert asked(f"onespp score {tmp_path}/data/s", "/") == [f"{tmp_path}/data/suite/two"]


def test_a_completion_loads_click_and_nothing_heavy():
    code = ("import sys, onespp.cli\n"
            "try: onespp.cli.main()\n"
            "except SystemExit: pass\n"
            "print([m for m in ('mitsuba', 'drjit', 'numpy', 'rich', 'pydantic', 'onespp.render')"
            " if m in sys.modules], 'LLVM' in open('/proc/self/maps').read())")
    for line in ("onespp denoise x --method svgf --set a", "onespp score d", "onespp render b"):
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True,
            env={**os.environ, "_ONESPP_COMPLETE": "bash_complete", "COMP_WORDS": line,
                 "COMP_CWORD": str(len(line.split(" ")) - 1)})
        assert done.stdout.splitlines()[-1] == "[] False"


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_gets_a_script_that_it_can_read(shell, call, tmp_path):
    code, script, _ = call("completion", shell)
    assert code == 0
    assert f"_ONESPP_COMPLETE={shell}_complete" in script
    if shutil.which(shell):
        (tmp_path / "script").write_text(script)
        assert subprocess.run([shell, "-n", str(tmp_path / "script")]).returncode == 0


@pytest.mark.skipif(not shutil.which("bash"), reason="there is no bash")
def test_bash_itself_completes_with_it(call, tmp_path):
    (tmp_path / "script").write_text(call("completion", "bash")[1])
    (tmp_path / "onespp").write_text(f"#!/bin/sh\nexec {sys.executable} -m onespp \"$@\"\n")
    (tmp_path / "onespp").chmod(0o755)
    code = ('. ./script; COMP_WORDS=(onespp render room --sampler blue); COMP_CWORD=4; '
            '_onespp_completion onespp blue --sampler; echo "${COMPREPLY[@]}"')
    path = f"{tmp_path}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(["bash", "-c", code], cwd=tmp_path, capture_output=True, text=True,
                          env={**os.environ, "PATH": path})
    assert done.stdout == "bluenoise\n", done.stderr


def test_another_shell_is_refused_in_a_sentence(call):
    code, _, words = call("completion", "tcsh")
    assert code == 2
    assert "'tcsh' is not one of 'bash', 'zsh', 'fish'" in words
