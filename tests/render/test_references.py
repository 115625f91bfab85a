"""References that grow until the error is as asked for."""

from __future__ import annotations

import numpy as np
import pytest

import onespp.render.references
import onespp.render.tracer.reference
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.job import RenderJob, render_sequence
from onespp.render.reference_error import FEWEST_SPP, expected_error, frame_noise
from onespp.render.tracer.renderer import Renderer
from tests.render.tracer.test_renderer import small_scene

SIZE, FRAMES = 12, (0, 1, 2)


def job(decibels: float, **changes) -> RenderJob:
    return RenderJob(small_scene(), FRAMES, SIZE, SIZE, reference_error=decibels, **changes)


def noises(sequence: FrameSequence):
    references = [sequence.read_reference(i) for i in sequence.frames]
    return [frame_noise(r.parts, r.spp) for r in references]


@pytest.fixture(scope="module")
def decibels(tmp_path_factory) -> float:
    """An error for which the fewest samples are too few: a third of theirs."""
    sequence = render_sequence(job(1e6), tmp_path_factory.mktemp("fewest") / "s")
    assert [sequence.reference_spp(i) for i in FRAMES] == [FEWEST_SPP] * len(FRAMES)
    return expected_error(noises(sequence)) / 3


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory, decibels) -> FrameSequence:
    return render_sequence(job(decibels), tmp_path_factory.mktemp("undisturbed") / "s")


def test_references_grow_until_the_error_is_as_asked_for(undisturbed, decibels):
    assert 0.5 * decibels < expected_error(noises(undisturbed)) <= decibels
    spp = [undisturbed.reference_spp(i) for i in FRAMES]
    assert max(spp) > FEWEST_SPP
    assert all(n % FEWEST_SPP == 0 for n in spp)
    assert undisturbed.manifest.reference_spp == min(spp)


def test_interrupted_after_every_pass_they_take_the_same_steps(tmp_path, monkeypatch, undisturbed,
                                                               decibels):
    real, passes = Renderer.sample_sum, 0

    def third_interrupted(self, *arguments):
        nonlocal passes
        passes += len(arguments) > 5  # those that measure speed have no start
        if passes % 3 == 0:
            passes += 1
            raise KeyboardInterrupt
        return real(self, *arguments)

    monkeypatch.setattr(Renderer, "sample_sum", third_interrupted)
    stops = 0
    while True:
        try:
            stopped = render_sequence(job(decibels), tmp_path / "s")
            break
        except KeyboardInterrupt:
            stops += 1
    assert stops > 10
    for i in FRAMES:
        name = f"reference/{i:04d}.exr"
        assert (stopped.folder / name).read_bytes() == (undisturbed.folder / name).read_bytes()
    assert not list(stopped.folder.rglob("*.npz"))


def test_a_smaller_error_goes_on_from_the_references_that_are_there(tmp_path, monkeypatch, decibels,
                                                                    undisturbed):
    render_sequence(job(1e6), tmp_path / "s")
    starts = []
    real = Renderer.sample_sum

    def counted(self, *arguments):
        starts.append(arguments[5:])
        return real(self, *arguments)

    monkeypatch.setattr(Renderer, "sample_sum", counted)
    grown = render_sequence(job(decibels), tmp_path / "s")
    assert all(start[0] >= FEWEST_SPP // 4 for start in starts if start)
    assert [grown.reference_spp(i) for i in FRAMES] == [
        undisturbed.reference_spp(i) for i in FRAMES]
    starts.clear()
    assert render_sequence(job(decibels), tmp_path / "s").manifest == grown.manifest
    assert starts == []  # nor is the time measured again


def test_the_cost_is_told_first_and_an_end_that_came_too_soon(tmp_path, monkeypatch):
    monkeypatch.setattr(onespp.render.reference_error, "MOST_SPP", 128)
    monkeypatch.setattr(onespp.render.references, "MOST_SPP", 128)
    told, shares = [], [0.0]

    def report(done: float, total: float, what: str, /) -> None:
        if what.startswith("reference"):
            shares.append(done / total)

    sequence = render_sequence(job(1e-6), tmp_path / "s", progress=report,
                               tell=lambda sentence: told.append((shares[-1], sentence)))
    (first, cost), (last, end) = told
    assert [sequence.reference_spp(i) for i in FRAMES] == [128] * len(FRAMES)
    assert "likely to take 128 samples a pixel" in cost
    assert "million paths a second" in cost
    assert "references end at 128 samples a pixel" in end
    assert first == 0
    assert last > 0.9
    assert shares == sorted(shares)
    assert shares[-1] == 1


def test_references_of_an_older_version_are_kept_or_made_anew(tmp_path, decibels):
    sequence = render_sequence(RenderJob(small_scene(), FRAMES, SIZE, SIZE, reference_spp=64),
                               tmp_path / "s")
    for i, spp in ((0, 256), (1, 32)):
        reference = sequence.read_reference(i)
        sequence.write_reference(i, Reference(reference.color, reference.variance, spp))
    old = (tmp_path / "s/reference/0000.exr").read_bytes()
    sequence = render_sequence(job(2 * decibels), tmp_path / "s")
    assert (tmp_path / "s/reference/0000.exr").read_bytes() == old
    assert [sequence.has_parts(i) for i in FRAMES] == [False, True, True]
    assert expected_error([frame_noise(r.parts, r.spp) for r in map(
        sequence.read_reference, FRAMES[1:])]) <= 2 * decibels


@pytest.mark.parametrize(("changes", "words"), [
    ({"reference_error": 0.0}, "above 0"), ({"reference_error": float("nan")}, "above 0"),
    ({"reference_error": float("inf")}, "above 0"),
    ({"reference_error": 0.1, "reference_spp": 64}, "use one of them")])
def test_what_cannot_be_asked_for_is_told_before_anything_is_written(tmp_path, changes, words):
    with pytest.raises(InputError, match=words):
        render_sequence(RenderJob(small_scene(), (0,), SIZE, SIZE, **changes), tmp_path / "s")
    assert not (tmp_path / "s").exists()


def test_parts_of_a_frame_have_noise_of_their_own(undisturbed):
    parts = undisturbed.read_reference(0).parts
    for a in range(4):
        for b in range(a):
            assert (parts[a] != parts[b]).mean() > 0.5
    assert np.isfinite(parts).all()


def test_what_a_reference_has_so_far_is_on_the_disk_while_it_grows(tmp_path, monkeypatch):
    """A process that is killed gets no chance to save."""
    monkeypatch.setattr(onespp.render.references, "SECONDS_BETWEEN_SAVES", -1.0)
    saved = []

    def look(done: float, total: float, what: str, note: str = "", /) -> None:
        if what.startswith("reference") and (folder := tmp_path / "s/reference").exists():
            saved.extend(folder.glob("*.npz"))

    render_sequence(RenderJob(small_scene(), (0,), SIZE, SIZE, reference_spp=256), tmp_path / "s",
                    progress=look)
    assert len(saved) >= 3
    assert not list((tmp_path / "s").rglob("*.npz"))
