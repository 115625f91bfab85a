"""A job: frames are written while the next ones are rendered."""

from __future__ import annotations

import threading

import pytest

from onespp.render.channels import TRACING
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.job import RenderJob, render_sequence
from onespp.render.tracer.renderer import Renderer

from .tracer.test_renderer import small_scene

PATIENCE = 60.0  # seconds, after which what waits for the other thread fails


def test_a_frame_is_written_while_the_next_is_rendered(tmp_path, monkeypatch):
    begun, order = threading.Event(), []
    frame, write = Renderer.frame, FrameSequence.write_frame

    def rendered(self, index, *arguments):
        if index == 1:
            begun.set()
        return frame(self, index, *arguments)

    def written(self, made, *arguments):
        assert made.index or begun.wait(PATIENCE)  # frame 0 only once frame 1 is begun
        write(self, made, *arguments)
        order.append(made.index)

    monkeypatch.setattr(Renderer, "frame", rendered)
    monkeypatch.setattr(FrameSequence, "write_frame", written)
    sequence = render_sequence(RenderJob(small_scene(), (0, 1, 2), 12, 12), tmp_path / "s")
    assert order == [0, 1, 2]
    assert all(sequence.frame_is_whole(i) for i in order)


def test_what_another_version_began_is_read_and_not_continued(tmp_path):
    """A manifest that does not say which is of the first."""
    job = RenderJob(small_scene(), (0, 1, 2), 12, 12)
    path = FrameSequence.create(tmp_path / "s", job.manifest()).folder / "manifest.json"
    line = f'  "tracing": {TRACING},\n'
    text = path.read_text()
    assert line in text
    path.write_text(text.replace(line, ""))
    assert FrameSequence.open(tmp_path / "s").manifest.tracing == 1
    with pytest.raises(InputError, match=r"another version of onespp made.*: use --overwrite"):
        render_sequence(job, tmp_path / "s")


def test_a_disk_that_refuses_a_frame_is_told_of_in_the_same_sentence(tmp_path, monkeypatch):
    def refuse(self, made, *_):
        raise InputError(f"frame {made.index} could not be written because the disk is full")

    monkeypatch.setattr(FrameSequence, "write_frame", refuse)
    with pytest.raises(InputError, match="frame 0 could not be written because the disk is full"):
        render_sequence(RenderJob(small_scene(), (0, 1, 2), 12, 12), tmp_path / "s")


def test_an_interrupt_loses_no_frame_that_was_rendered(tmp_path):
    def stop(done: float, total: float, what: str, /) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_sequence(RenderJob(small_scene(), (0, 1, 2), 12, 12), tmp_path / "s", progress=stop)
    sequence = FrameSequence.open(tmp_path / "s")
    assert [sequence.frame_is_whole(i) for i in (0, 1, 2)] == [True, True, False]
