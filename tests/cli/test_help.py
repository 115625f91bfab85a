"""What `--help` tells beside the options, and colours where they are not wanted."""

from __future__ import annotations

import re

import pytest

from onespp.cli import app
from onespp.denoise.score.sequence import score
from tests.support.made_sequence import make_sequence

COLOUR = re.compile(r"\x1b\[(?:[0-9;]*;)?(?:3|4|9)[0-9]")


@pytest.mark.parametrize("command", [[], *([name] for name in app.commands), ["bench", "render"]])
def test_every_help_tells_the_exit_codes_in_plain_letters(call, monkeypatch, command):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("NO_COLOR", "1")
    code, out, _ = call(*command, "--help")
    assert code == 0
    assert "Exit codes: 0 " in out
    assert "130 interrupted" in " ".join(out.split())
    assert "\x1b" not in out


def test_tables_have_no_colours_where_they_are_not_wanted(tmp_path, call, monkeypatch):
    folder = tmp_path / "made"
    score(make_sequence(folder))
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert COLOUR.search(call("score", folder, "--no-pictures")[1])
    monkeypatch.setenv("NO_COLOR", "1")
    code, out, _ = call("score", folder, "--no-pictures")
    assert code == 0
    assert "fine" in out
    assert not COLOUR.search(out)
