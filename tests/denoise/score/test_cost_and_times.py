"""Times measured in turns, peak memory, and how they come into the scores."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from onespp.denoise.run.interleaved_timing import time_methods
from onespp.denoise.run.peak_memory import PeakMemory
from onespp.denoise.run.sequence import denoise_sequence
from onespp.denoise.score.cost import cost, startup
from onespp.denoise.score.sequence import score
from onespp.render.errors import InputError
from onespp.render.files.manifest import Run
from onespp.render.files.times import read_times
from tests.support.clock import Clock
from tests.support.small_sequence import HEIGHT, WIDTH, small_sequence

CLOCK = Clock()


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    """The time that passes is what `Sleeper` says."""
    CLOCK.put_into(monkeypatch, "onespp.render.host.timed")
    return CLOCK


@dataclass(frozen=True)
class Sleeper:
    """Takes its time, and ten times as long for the first frame."""

    needs: ClassVar[tuple[str, ...]] = ("color",)

    ms: float = 2.0

    def init(self, height, width):
        return []

    def __call__(self, frame, seen):
        CLOCK.pass_(1e-3 * self.ms * (1 if seen else 10))
        return np.array(frame["color"]), [*seen, frame.index]


@dataclass(frozen=True)
class Greedy(Sleeper):
    """Takes 64 MiB for a moment."""

    def __call__(self, frame, seen):
        np.ones(64 << 17)
        return np.array(frame["color"]), seen


def test_methods_are_timed_in_turns_and_ratios_are_to_the_first(tmp_path):
    """On a machine that takes 1, 2, 3, 4, 1, ... times as long from step to step, 6 and 2 ms."""
    sequence, told = small_sequence(tmp_path / "a"), []

    @dataclass(frozen=True)
    class Disturbed(Sleeper):
        def __call__(self, frame, seen):
            for _ in range(len(told) % 4):
                super().__call__(frame, seen)
            return super().__call__(frame, seen)

    times = time_methods(sequence, {"slow": Disturbed(6.0), "fast": Disturbed(2.0)}, rounds=4,
                         progress=lambda done, *_: told.append(done))
    slow, fast = times.methods["slow"], times.methods["fast"]
    assert (slow.first_ms, fast.first_ms) == pytest.approx((60, 20))
    assert (slow.ms, fast.ms) == pytest.approx((15, 5))  # medians of 1, 1, 2, 2, 3, 3, 4, 4 times
    assert slow.ms_quartiles == pytest.approx((6 * 1.75, 6 * 3.25))
    assert (slow.ratio, fast.ratio) == pytest.approx((1, 1 / 3))
    assert fast.ratio_quartiles == pytest.approx((1 / 3, 1 / 3))  # of the same step
    assert times.steps == 8  # the first round, with its 60 ms, does not count
    assert told == list(range(1, 11))
    assert read_times(sequence.folder) == times


def test_the_order_turns_so_that_none_always_comes_first(tmp_path):
    calls = []

    @dataclass(frozen=True)
    class Noting(Sleeper):
        name: str = ""

        def __call__(self, frame, seen):
            calls.append(self.name)
            return super().__call__(frame, seen)

    methods = {n: Noting(name=n) for n in "abc"}
    time_methods(small_sequence(tmp_path / "a"), methods, frames=2, rounds=1)
    assert "".join(calls) == "abc" "bca" "cab" "abc"


def test_nothing_to_time_is_refused(tmp_path):
    sequence = small_sequence(tmp_path / "a")
    with pytest.raises(InputError, match="nothing to time"):
        time_methods(sequence, {})
    assert read_times(sequence.folder) is None
    (sequence.folder / "times.json").write_text("{}")
    with pytest.raises(InputError, match=r"times\.json lacks the key"):
        read_times(sequence.folder)


def test_a_score_takes_the_times_measured_in_turns_for_the_same_settings(tmp_path):
    sequence = small_sequence(tmp_path / "a")
    denoise_sequence(sequence, Sleeper(3.0), "sleeper")
    denoise_sequence(sequence, Sleeper(3.0), "other")
    times = time_methods(sequence, {"sleeper": Sleeper(3.0), "other": Sleeper(1.0)}, rounds=1)
    scores = score(sequence)
    sleeper, other = scores.methods["sleeper"], scores.methods["other"]
    assert sleeper.interleaved
    assert sleeper.ms_per_frame == times.methods["sleeper"].ms == pytest.approx(3)
    assert sleeper.megapixels_per_s == pytest.approx(HEIGHT * WIDTH / sleeper.ms_per_frame / 1e3)
    assert not other.interleaved  # it ran with another parameter
    assert other.ms_per_frame == sequence.read_run("other").ms[1] == pytest.approx(3)
    assert other.startup_ms == pytest.approx(27)
    assert any("Times of sleeper were measured in turns" in note and "medians of their own runs"
               in note for note in scores.notes)


def test_a_run_that_is_not_known_costs_nothing_known(tmp_path):
    sequence = small_sequence(tmp_path / "a")
    for run in (None, Run(method="mine")):
        known = cost(sequence, run, None)
        assert known["ms_per_frame"] is known["startup_ms"] is known["megapixels_per_s"] is None


@pytest.mark.parametrize(("ms", "expected"), [
    ([], None), ([9.0], None), ([9.0, 4.0], 5.0), ([9.0, 5.0, 4.0], 4.5),
    ([100.0, 50.0, 4.0, 5.0, 6.0], 94.5 + 44.5), ([1.0, 1.0, 1.0, 5.0], 0.0)])
def test_the_start_is_what_the_first_frames_took_beyond_the_others(ms, expected):
    assert startup(ms) == expected


needs_marks = pytest.mark.skipif(PeakMemory()._before is None, reason="no /proc here")


@needs_marks
def test_the_peak_counts_only_work_between_the_marks():
    peak = PeakMemory()
    peak.begin()
    np.ones(8 << 17)
    peak.end()
    small = peak.megabytes
    np.ones(512 << 17)  # not looked at
    peak.begin()
    peak.end()
    assert peak.megabytes < small + 64
    peak.begin()
    np.ones(256 << 17)
    peak.end()
    assert 200 < peak.megabytes < 330


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="not glibc")
@needs_marks
def test_memory_that_the_allocator_had_kept_counts_when_it_is_used_again():
    np.ones(30 << 17)  # blocks of up to 30 MiB come from the heap from now on
    kept = [np.ones(1 << 17) for _ in range(128)]  # of 1 MiB
    del kept
    peak = PeakMemory()
    peak.begin()
    again = [np.ones(1 << 17) for _ in range(96)]
    peak.end()
    assert len(again) < peak.megabytes + 8 < 120


@needs_marks
def test_a_run_says_how_much_memory_its_method_took(tmp_path):
    sequence = small_sequence(tmp_path / "a")
    assert 50 < denoise_sequence(sequence, Greedy(), "greedy").peak_mb < 120
    assert denoise_sequence(sequence, Sleeper(), "modest").peak_mb < 30
    assert score(sequence).methods["greedy"].peak_mb > 50
