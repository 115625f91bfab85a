"""Frames timed against Mitsuba's integrators."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from onespp.cli import app
from onespp.render.study.frames import FrameTimes, time_frames
from onespp.scenes import catalog
from tests.support import xml_scenes


def test_the_benchmark_times_both_renderers():
    row = time_frames(catalog.load("box"), 16, 2, max_depth=3)
    assert (row.scene, row.side, row.max_depth) == ("box", 16, 3)
    for times in (row.ms, row.path_ms, row.aov_ms):
        assert len(times) == 2
        assert min(times) > 0


def test_times_as_long_are_the_median_of_ratios():
    row = FrameTimes("a", 16, 3, [2.0, 4.0, 9.0], [1.0, 4.0, 3.0], [1.0, 1.0, 9.0])
    assert row.times_as_long(row.path_ms) == 2
    assert row.times_as_long(row.aov_ms) == 2


def test_several_scenes_have_a_row_each_and_figures():
    done = CliRunner().invoke(app, ["bench", "render", "box", "hard/mirror", "--side", "16",
                                    "--repeats", "1", "--max-depth", "4", "--json", "-"])
    assert done.exit_code == 0, done.output
    rows = json.loads(done.stdout)
    assert [(row["scene"], row["max_depth"], len(row["ms"])) for row in rows] == [
        ("box", 4, 1), ("hard/mirror", 4, 1)]


@pytest.mark.parametrize("command", [["render", "--side", "16"],
                                     ["reference", "--pixels", "64", "--spp", "1"]])
def test_a_scene_may_be_a_file(command, tmp_path):
    name, *options = command
    done = CliRunner().invoke(app, ["bench", name, str(xml_scenes.foliage(tmp_path)), "--repeats",
                                    "3", *options])
    assert done.exit_code == 0, done.output
    assert "foliage" in done.output
