"""Picks Mitsuba's variant once, before any test module imports the renderer."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest
from hypothesis import settings

import onespp
from onespp.cli import app
from onespp.datasets.folder import DataSet
from onespp.render.cli.terminal import run as run_command
from tests.support.places import GAMES202

settings.register_profile("untimed", deadline=None)  # machines are shared
settings.load_profile("untimed")


@pytest.fixture(scope="session")
def games202() -> Path:
    """The assignment's real frames, which are not ours to ship."""
    if not GAMES202.is_dir():
        pytest.skip("the GAMES202 box frames are not in ../shared/data/games202-box")
    return GAMES202


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> DataSet:
    """A small data set: sequence 0, to train on, and 1, to validate; 3 frames of 16x24, two renders
    of each."""
    return onespp.dataset("simple", tmp_path_factory.mktemp("data") / "set", sequences=2, frames=3,
                          size=(16, 24), seeds=2, reference_spp=16,
                          changes={"draw.cameras": ["orbit"], "draw.speed": [3, 3],
                                   "split.validation": 0.3})


@pytest.fixture
def call(capsys):
    """Runs a command line in this process; returns (exit code, stdout, stderr)."""
    def run(*arguments) -> tuple[int, str, str]:
        code = 0
        try:
            run_command(app, [str(a) for a in arguments])
        except SystemExit as stop:
            code = int(stop.code or 0)
        finally:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
        captured = capsys.readouterr()
        return code, captured.out, captured.err
    return run


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--regenerate", action="store_true",
                     help="render the golden images anew instead of comparing with them")
