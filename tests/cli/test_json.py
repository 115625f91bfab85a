"""`--json` wherever figures are printed: alone on standard output, complete, and in a file."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from onespp.cli import app
from onespp.denoise.score.sequence import score
from onespp.render.cli.figures import show_or_print
from onespp.scenes.hard import HARD
from tests.support.made_sequence import make_sequence

WITHOUT = {"dataset", "render", "denoise", "run", "report", "view", "import", "export", "new",
           "completion", "train"}
"""Commands whose outcome is files."""


def test_every_command_that_shows_figures_has_the_option():
    commands = {**app.commands, **app.commands["bench"].commands}  # type: ignore[attr-defined]
    lacking = {name for name, command in commands.items()
               if not any("--json" in p.opts for p in command.params)} - {"render"}
    assert lacking == WITHOUT - {"render"}
    assert "--json" not in [o for p in app.commands["render"].params for o in p.opts]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("figures") / "made"
    score(make_sequence(folder))
    return folder


@pytest.mark.parametrize(("arguments", "keys"), [
    (["scenes"], {"box", "room", "generated/0", *(f"hard/{name}" for name in HARD)}),
    (["lead", "MADE", "MADE", "--method", "fine", "--peer", "rough"],
     {"method", "peer", "figures"}),
    (["truth", "MADE", "MADE"], {"scene", "methods", "off"})])
def test_the_figures_are_all_that_is_printed(made, call, tmp_path, arguments, keys):
    typed = [str(made) if word == "MADE" else word for word in arguments]
    code, out, _ = call(*typed, "--json", "-")
    assert code == 0
    assert keys <= {*json.loads(out)}
    code, tables, _ = call(*typed, "--json", tmp_path / "figures.json")
    assert code == 0
    assert json.loads((tmp_path / "figures.json").read_text()) == json.loads(out)
    with pytest.raises(json.JSONDecodeError):
        json.loads(tables)


def test_what_runs_methods_gives_its_figures_too(tmp_path, call):
    folder = tmp_path / "box"
    assert call("render", "box", "--frames", "0:2", "--size", "24x20", "--reference-spp", "4",
                "--out", folder)[0] == 0
    times = json.loads(call("time", folder, "--method", "bilateral", "--method", "svgf", "--frames",
                            "1", "--rounds", "1", "--json", "-")[1])
    assert times["ratio_to"] == "bilateral"
    assert times["methods"]["svgf"]["ms"] > 0
    parts = json.loads(call("ablate", folder, "--method", "bilateral", "--json", "-")[1])
    assert parts["sequences"]["box"][0]["means"]["psnr_srgb"] > 5
    best = json.loads(call("tune", folder, "--method", "bilateral", "--parameter",
                           "isolate_background", "--json", "-")[1])
    assert best["psnr_srgb"] >= best["psnr_srgb_at_start"]


def test_what_is_not_finite_is_null(capsys):
    show_or_print({"a": float("inf"), "b": np.float32(2)}, "-", lambda: None)
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": 2.0}


def test_the_figures_are_those_of_the_table(made, call):
    arguments = ["lead", made, made, "--method", "fine", "--peer", "rough"]
    found = json.loads(call(*arguments, "--json", "-")[1])["figures"]
    table = call(*arguments)[1]
    row = next(line for line in table.splitlines() if "our input" in line)
    shown = float(re.findall(r"[-+]\d+\.\d+", row)[0])
    value = found["mean PSNR over the peer on our input, dB"]["made"]
    assert shown == pytest.approx(value, abs=0.005)
    assert value > 10
