"""Damaged files at random, a few for each reader. More: `python -m tests.robustness.fuzz 20000`."""

from __future__ import annotations

import pytest

from .fuzz import READERS, fuzz

SLOW = {"scores": 40, "import": 40, "import-exr": 40}  # these read many files


@pytest.mark.parametrize("name", list(READERS))
def test_spoiled_files_are_read_or_refused_in_one_sentence(tmp_path, name, capfd):
    inputs = SLOW.get(name, 150)
    outcomes = fuzz(name, inputs, 0, tmp_path)
    assert outcomes["read"] + outcomes["refused"] == inputs
    assert outcomes["refused"] > inputs / 2
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("name", list(READERS))
def test_twenty_thousand_spoiled_files(tmp_path, name):
    outcomes = fuzz(name, 20_000, 1, tmp_path)
    assert outcomes["refused"] > 10_000
