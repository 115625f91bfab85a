"""Picks Mitsuba's variant once, before any test module imports the renderer."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import render  # noqa: F401  (finds LLVM before anything imports Dr.Jit)

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def games202() -> Path:
    """The assignment's real frames, which are not ours to ship."""
    folder = Path(__file__).resolve().parents[2] / "shared/data/games202-box"
    if not folder.is_dir():
        pytest.skip("the GAMES202 box frames are not in ../shared/data/games202-box")
    return folder


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--regenerate", action="store_true",
                     help="render the golden images anew instead of comparing with them")
