"""A small data set, rendered once for all tests that read one."""

from __future__ import annotations

import pytest

import onespp
from onespp.datasets.folder import DataSet


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> DataSet:
    """Sequence 0, to train on, and 1, to validate: 3 frames of 16x24, two renders of each."""
    return onespp.dataset("simple", tmp_path_factory.mktemp("data") / "set", sequences=2, frames=3,
                          size=(16, 24), seeds=2, reference_spp=16,
                          changes={"draw.cameras": ["orbit"], "split.validation": 0.3})


@pytest.fixture
def copy(made, tmp_path) -> DataSet:
    """A copy of it that a test may change."""
    import shutil

    shutil.copytree(made.folder, tmp_path / "copy")
    return DataSet.open(tmp_path / "copy")
