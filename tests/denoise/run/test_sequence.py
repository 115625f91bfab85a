"""Files beside denoising: the same results, times of calls alone, a word on what bounds it."""

import threading

import numpy as np
import pytest

from onespp.denoise.methods.temporal import Temporal
from onespp.denoise.run.sequence import ALONE, Pace, denoise_sequence
from onespp.render.errors import InputError
from onespp.render.files.manifest import Manifest
from onespp.render.files.sequence import FrameSequence
from tests.support.clock import Clock
from tests.support.frames import make_frame, noisy, translation

H, W, FRAMES = 9, 11, ALONE + 4
LONG = 20  # seconds, after which a wait has failed


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
    run = denoise_sequence(sequence, Temporal(), "temporal", lambda done, *_: seen.append(done))
    method = Temporal()
    state = method.init(H, W)
    for i in range(FRAMES):
        image, state = method(sequence.read_frame(i), state)
        np.testing.assert_array_equal(sequence.read_result("temporal", i), image)
    assert seen == list(range(1, FRAMES + 1))
    assert list(run.ms) == list(range(ALONE))


def test_files_are_read_and_written_beside_the_calls(sequence, monkeypatch):
    """A call waits until the next frame has been read, a write for the call after its own to begin:
    one after another, they would wait for ever."""
    begun, been_read = ([threading.Event() for _ in range(FRAMES)] for _ in range(2))
    last, clock = FRAMES - 1, Clock()
    clock.put_into(monkeypatch, "onespp.denoise.run.sequence", "onespp.render.host.timed")
    read, write = FrameSequence.read_frame, FrameSequence.write_result

    def reading(self, index, *arguments):
        frame = read(self, index, *arguments)
        clock.pass_(0.05)
        been_read[index].set()
        return frame

    def writing(self, name, index, *arguments):
        assert index < ALONE or index == last or begun[index + 1].wait(LONG), index
        clock.pass_(0.01)
        write(self, name, index, *arguments)

    class Slow(Temporal):
        def __call__(self, frame, state):
            begun[frame.index].set()
            alone = frame.index < ALONE or frame.index == last
            assert alone or been_read[frame.index + 1].wait(LONG), frame.index
            clock.pass_(0.1)
            return frame["color"], state

    monkeypatch.setattr(FrameSequence, "read_frame", reading)
    monkeypatch.setattr(FrameSequence, "write_result", writing)
    paces, threads = [], threading.active_count()
    denoise_sequence(sequence, Slow(), "slow", on_pace=paces.append)
    assert threading.active_count() == threads
    (pace,) = paces
    assert pace.frames == 4
    assert pace.denoising == pytest.approx(0.4)
    assert pace.files == pytest.approx(4 * 0.06)
    assert pace.seconds == pytest.approx(0.4)  # this thread's
    assert "bound by denoising" in str(pace)


def test_the_first_frames_are_read_and_written_while_nothing_is_denoised(sequence, monkeypatch):
    said = []
    read, write = FrameSequence.read_frame, FrameSequence.write_result

    def reading(self, index, *arguments):
        said.append(f"read {index}")
        return read(self, index, *arguments)

    def writing(self, name, index, *arguments):
        write(self, name, index, *arguments)
        said.append(f"written {index}")

    class Noting(Temporal):
        def __call__(self, frame, state):
            said.append(f"begin {frame.index}")
            result = super().__call__(frame, state)
            said.append(f"end {frame.index}")
            return result

    monkeypatch.setattr(FrameSequence, "read_frame", reading)
    monkeypatch.setattr(FrameSequence, "write_result", writing)
    denoise_sequence(sequence, Noting(), "noting")
    assert said[:4 * ALONE] == [f"{what} {i}" for i in range(ALONE)
                                for what in ("read", "begin", "end", "written")]


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
