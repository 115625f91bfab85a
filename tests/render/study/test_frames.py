"""Frames timed against Mitsuba's integrators."""

from __future__ import annotations

from onespp.render.study.frames import time_frames


def test_the_benchmark_times_both_renderers():
    ours, theirs = time_frames("box", 16, 2)
    assert len(ours) == len(theirs) == 2
    assert min(*ours, *theirs) > 0
