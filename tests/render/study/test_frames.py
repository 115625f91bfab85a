"""Frames timed against Mitsuba's integrators."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from onespp.cli import app
from onespp.render.study.frames import time_frames
from onespp.scenes import catalog
from tests.support import xml_scenes


def test_the_benchmark_times_both_renderers():
    ours, theirs = time_frames(catalog.load("box"), 16, 2)
    assert len(ours) == len(theirs) == 2
    assert min(*ours, *theirs) > 0


@pytest.mark.parametrize("command", [["render", "--side", "16"],
                                     ["reference", "--pixels", "64", "--spp", "1"]])
def test_a_scene_may_be_a_file(command, tmp_path):
    name, *options = command
    done = CliRunner().invoke(app, ["bench", name, str(xml_scenes.foliage(tmp_path)), "--repeats",
                                    "3", *options])
    assert done.exit_code == 0, done.output
    assert "foliage" in done.output
