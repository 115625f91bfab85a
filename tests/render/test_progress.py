"""The time that is left is told by what was done while somebody looked."""

from __future__ import annotations

import pytest

from onespp.render.progress import Pace


def test_steps_of_a_stopped_run_took_no_time_in_this_one():
    pace = Pace(begun=10.0, first=134)
    assert pace.left(10.0, 134, 1001) == 0
    assert pace.left(16.0, 137, 1001) == pytest.approx(2 * (1001 - 137))


def test_fractions_of_a_step_count():
    assert Pace(0.0, 0).left(1.0, 0.25, 2) == pytest.approx(7)
