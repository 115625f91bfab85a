"""Files beside denoising: the same results, times of calls alone, a word on what bounds it."""

import threading
import time

import numpy as np
import pytest

from onespp.denoise.methods.temporal import Temporal
from onespp.denoise.run.sequence import ALONE, Pace, denoise_sequence
from onespp.render.errors import InputError
from onespp.render.files.manifest import Manifest
from onespp.render.files.sequence import FrameSequence
from tests.support.frames import make_frame, noisy, translation

H, W, FRAMES = 9, 11, ALONE + 4


@pytest.fixture
def sequence(tmp_path):
    made = FrameSequence.create(tmp_path, Manifest(
        scene="wall", frames=f"0:{FRAMES}", width=W, height=H,
        channels=("color", "normal", "position", "depth", "id"), objects=("wall", "board")))
    for i in range(FRAMES):
        made.write_frame(noisy(make_frame(H, W, index=i, camera=translation(0.02 * i, 0, 0)), i))
    return made


def test_results_are_those_of_the_method_called_frame_by_frame(sequence):
    seen = []
    run = denoise_sequence(sequence, Temporal(), "temporal", lambda done, ms: seen.append(done))
    method = Temporal()
    state = method.init(H, W)
    for i in range(FRAMES):
        image, state = method(sequence.read_frame(i), state)
        np.testing.assert_array_equal(sequence.read_result("temporal", i), image)
    assert seen == list(range(1, FRAMES + 1))
    assert list(run.ms) == list(range(ALONE))


def test_files_are_read_and_written_beside_the_calls(sequence, monkeypatch):
    """0.1 s in each call, 0.05 s in each file read: beside one another 0.1 s a frame."""
    read = FrameSequence.read_frame

    def slowly(self, *arguments):
        time.sleep(0.05)
        return read(self, *arguments)

    class Slow(Temporal):
        def __call__(self, frame, state):
            time.sleep(0.1)
            return frame["color"], state

    monkeypatch.setattr(FrameSequence, "read_frame", slowly)
    paces, threads = [], threading.active_count()
    denoise_sequence(sequence, Slow(), "slow", on_pace=paces.append)
    assert threading.active_count() == threads
    (pace,) = paces
    assert pace.frames == 4
    assert pace.denoising >= 0.4
    assert pace.files >= 0.15
    assert pace.seconds < pace.denoising + 0.7 * pace.files
    assert "bound by denoising" in str(pace)


def test_the_pace_names_what_bounds_it():
    assert str(Pace(10, 1.0, 0.9, 0.4)) == (
        "100 ms a frame, bound by denoising (90 ms, files beside it 40 ms)")
    assert "bound by files" in str(Pace(10, 1.0, 0.4, 0.9))


def test_a_damaged_frame_read_ahead_leaves_the_results_before_it(sequence):
    bad = ALONE + 2
    path = sequence.folder / f"frames/{bad:04d}.exr"
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(InputError, match=f"{bad:04d}"):
        denoise_sequence(sequence, Temporal(), "temporal")
    found = [sequence.has_result("temporal", i) for i in range(FRAMES)]
    assert found == [i < bad for i in range(FRAMES)]
    assert len(sequence.read_run("temporal").ms) == ALONE


def test_a_failed_write_is_told(sequence, monkeypatch):
    def refuse(self, *arguments):
        raise InputError("the disk is full")

    monkeypatch.setattr(FrameSequence, "write_result", refuse)
    with pytest.raises(InputError, match="disk is full"):
        denoise_sequence(sequence, Temporal(), "temporal")
