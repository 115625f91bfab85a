"""The reference: its variance, its passes, and going on after an interrupt."""

from __future__ import annotations

import json

import numpy as np
import pytest

import onespp.render.job
import onespp.render.tracer.reference
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.job import RenderJob, render_sequence
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.reference import SampleSums, pass_sizes, render_reference
from onespp.render.tracer.renderer import Renderer
from onespp.render.tracer.sampler import Sobol, keys_from_seed
from tests.support.furnace import furnace

from .test_renderer import small_scene

SIZE = 12


@pytest.mark.parametrize("spp", [2, 7, 8, 9, 64, 100, 513, 1024, 4096])
def test_passes_add_up(spp):
    sizes = pass_sizes(spp)
    assert sum(sizes) == spp
    assert len(sizes) >= min(spp, 8)
    assert max(sizes) - min(sizes) <= 1


def test_a_reference_of_one_sample_is_refused():
    with pytest.raises(InputError, match="use 2 spp or more"):
        pass_sizes(1)


def test_the_stated_variance_is_that_of_the_mean():
    renderer = Renderer(furnace(0.6, 0.8, 4), SIZE, SIZE)
    references = [render_reference(renderer, 0, seed, 24) for seed in range(60)]
    spread = np.var([r.color for r in references], axis=0, ddof=1).mean()
    stated = np.mean([r.variance for r in references])
    # 60 x 144 pixels x 3 correlated components: the ratio's own deviation is about 3 %.
    assert stated == pytest.approx(spread, rel=0.12)


def test_uneven_passes_estimate_the_same_variance():
    rng = np.random.default_rng(1)
    sizes = pass_sizes(37)
    stated, means = [], []
    for _ in range(3000):
        progress = SampleSums.start(1, 1)
        for n in sizes:
            progress.add(rng.normal(2.0, 3.0, (n, 1, 1, 3)).sum(0), n)
        reference = progress.reference()
        stated.append(reference.variance.mean())
        means.append(reference.color[0, 0, 0])
    assert np.mean(stated) == pytest.approx(9 / 37, rel=0.05)
    assert np.var(means) == pytest.approx(9 / 37, rel=0.1)


def test_sobol_pairs_put_one_point_in_every_elementary_interval():
    n = 64
    sampler = Sobol(keys_from_seed(1), mi.UInt32(5), mi.UInt32(np.arange(n)))
    for _ in range(4):
        x, y = np.array(sampler.next_2d())
        for columns in (1, 2, 4, 8, 16, 32, 64):
            cell = np.floor(x * columns) * (n // columns) + np.floor(y * (n // columns))
            assert len(set(cell)) == n
        assert len(set(np.floor(np.array(sampler.next_1d()) * n))) == n


def test_sobol_numbers_are_uniform_and_independent_over_pixels():
    n = 1 << 14
    sampler = Sobol(keys_from_seed(3), mi.UInt32(np.arange(n)), mi.UInt32(0))
    numbers = np.array([*np.array(sampler.next_2d()), np.array(sampler.next_1d()),
                        *np.array(sampler.next_2d())])
    np.testing.assert_allclose(numbers.mean(1), 0.5, atol=5 * (1 / 12 / n) ** 0.5)
    correlation = np.corrcoef(numbers) - np.eye(len(numbers))
    assert np.abs(correlation).max() < 5 / n**0.5


def test_an_interrupted_reference_goes_on_to_the_same_bytes(tmp_path, monkeypatch):
    job = RenderJob(small_scene(), [0, 1], SIZE, SIZE, reference_spp=32)
    undisturbed = render_sequence(job, tmp_path / "undisturbed")

    passes = 0
    real = Renderer.sample_sum

    def interrupted(self, *arguments):
        nonlocal passes
        passes += 1
        if passes == 12:  # in the middle of frame 1's reference
            raise KeyboardInterrupt
        return real(self, *arguments)

    monkeypatch.setattr(Renderer, "sample_sum", interrupted)
    with pytest.raises(KeyboardInterrupt):
        render_sequence(job, tmp_path / "stopped")
    stopped = FrameSequence.open(tmp_path / "stopped")
    assert stopped.has_reference(0)
    assert not stopped.has_reference(1)
    assert stopped.read_partial(1) is not None

    done = passes
    resumed = render_sequence(job, tmp_path / "stopped")
    assert passes - done == 5  # of frame 1's 8 passes, 3 were kept
    for i in (0, 1):
        for kind in ("frames", "reference"):
            name = f"{kind}/{i:04d}.exr"
            assert (resumed.folder / name).read_bytes() == (undisturbed.folder / name).read_bytes()
    assert resumed.read_partial(1) is None


def test_a_complete_folder_is_left_alone(tmp_path, monkeypatch):
    job = RenderJob(small_scene(), [0, 2], SIZE, SIZE, reference_spp=4)
    sequence = render_sequence(job, tmp_path / "a")
    before = {p: p.stat().st_mtime_ns for p in sequence.folder.rglob("*.*")}
    monkeypatch.setattr(onespp.render.job, "Renderer", None)
    render_sequence(job, tmp_path / "a")
    assert {p: p.stat().st_mtime_ns for p in sequence.folder.rglob("*.*")} == before


def test_another_sample_count_renders_the_reference_again(tmp_path):
    job = RenderJob(small_scene(), [0], SIZE, SIZE, reference_spp=4)
    render_sequence(job, tmp_path / "a")
    more = RenderJob(small_scene(), [0], SIZE, SIZE, reference_spp=8)
    assert render_sequence(more, tmp_path / "a").read_reference(0).spp == 8


def files(folder):
    """Name and time of change of everything but the manifest."""
    return {p: p.stat().st_mtime_ns for p in folder.rglob("*.exr")}


def test_a_better_reference_is_kept_and_said(tmp_path, call):
    out = tmp_path / "box"
    command = ("render", "box", "--size", "12x9", "--out", out)
    assert call(*command, "--frames", "0:2", "--reference-spp", 24)[0] == 0
    before = files(out)
    code, text, _ = call(*command, "--frames", "0:3", "--reference-spp", 16)
    assert code == 0
    assert text.splitlines()[0] == ("kept 2 references of 24 spp, better than the 16 spp asked for "
                                    "(--overwrite replaces them)")
    assert {p: t for p, t in files(out).items() if p in before} == before
    sequence = FrameSequence.open(out)
    assert [sequence.reference_spp(i) for i in range(3)] == [24, 24, 16]
    assert sequence.manifest.reference_spp == 16  # the fewest, which is what holds for all
    code, text, _ = call(*command, "--frames", "2", "--reference-spp", 24)
    assert (code, "kept" in text) == (0, False)
    assert FrameSequence.open(out).manifest.reference_spp == 24


def test_the_default_of_run_keeps_a_better_reference_too(tmp_path, call):
    out = tmp_path / "box"
    options = ("box", "--size", "12x9", "--frames", "0:2", "--out", out)
    assert call("render", *options, "--reference-spp", 300)[0] == 0
    before = files(out / "reference")
    code, text, _ = call("run", *options, "--method", "bilateral")
    assert (code, "kept 2 references of 300 spp" in text) == (0, True)
    assert files(out / "reference") == before
    assert json.loads((out / "scores.json").read_text())["reference_spp"] == 300


def test_a_better_reference_through_another_filter_is_refused_and_kept(tmp_path, call):
    out = tmp_path / "box"
    options = ("render", "box", "--size", "12x9", "--frames", "0", "--out", out)
    assert call(*options, "--reference-spp", 24, "--antialias")[0] == 0
    before = files(out)
    code, _, err = call(*options, "--reference-spp", 16)
    assert (code, "another reference_filter (box there, centre here)" in err) == (2, True)
    assert files(out) == before


def test_a_damaged_reference_of_more_samples_is_made_anew(tmp_path):
    render_sequence(RenderJob(small_scene(), [0], SIZE, SIZE, reference_spp=24), tmp_path / "a")
    (tmp_path / "a/reference/0000.exr").write_bytes(b"not an image")
    job = RenderJob(small_scene(), [0], SIZE, SIZE, reference_spp=16)
    assert render_sequence(job, tmp_path / "a").read_reference(0).spp == 16


@pytest.mark.parametrize(("asked", "spp", "traced"), [
    (64, 64, 11),    # goes on
    (16, 20, 0),     # 5 passes of 4 are better than what is asked for
    (32, 32, 3),     # its 8 passes of 4 are the first ones of 64's
    (33, 33, 4),     # so are the first five of its 9
    (24, 24, 8)])    # 8 passes of 3: anew
def test_what_an_interrupt_left_of_a_better_reference_is_used(tmp_path, monkeypatch, asked, spp,
                                                              traced):
    monkeypatch.setattr(onespp.render.tracer.reference, "LARGEST_PASS", 4)
    scene, real, passes = small_scene(), Renderer.sample_sum, []

    def counted(self, *arguments):
        passes.append(arguments)
        if len(passes) == 6:
            raise KeyboardInterrupt
        return real(self, *arguments)

    monkeypatch.setattr(Renderer, "sample_sum", counted)
    with pytest.raises(KeyboardInterrupt):
        render_sequence(RenderJob(scene, [0], SIZE, SIZE, reference_spp=64), tmp_path / "a")
    job = RenderJob(scene, [0], SIZE, SIZE, reference_spp=asked)
    found = render_sequence(job, tmp_path / "a").read_reference(0)
    assert (found.spp, len(passes) - 6) == (spp, traced)
    monkeypatch.setattr(Renderer, "sample_sum", real)
    progress, sizes = SampleSums.start(SIZE, SIZE), [4] * 5 if asked == 16 else pass_sizes(spp)
    renderer = Renderer(scene, SIZE, SIZE)
    for number, size in enumerate(sizes):
        progress.add(renderer.sample_sum(0, 0, number, size), size)
    np.testing.assert_array_equal(found.color, progress.reference().color)
    np.testing.assert_array_equal(found.variance, progress.reference().variance)


def test_an_edited_scene_is_not_taken_for_the_old_one(tmp_path):
    render_sequence(RenderJob(small_scene(), [0], SIZE, SIZE), tmp_path / "a")
    with pytest.raises(InputError, match=r"has changed.*--overwrite"):
        render_sequence(RenderJob(small_scene(max_depth=4), [0], SIZE, SIZE), tmp_path / "a")


@pytest.mark.parametrize(("more", "passes"), [(48, 4), (33, 9)])
def test_a_reference_of_more_samples_goes_on_from_the_one_of_fewer(tmp_path, monkeypatch, more,
                                                                   passes):
    monkeypatch.setattr(onespp.render.tracer.reference, "LARGEST_PASS", 4)
    real, numbers = Renderer.sample_sum, []

    def counted(self, index, seed, number, *arguments):
        numbers.append(number)
        return real(self, index, seed, number, *arguments)

    scene = small_scene()
    anew = render_sequence(RenderJob(scene, [0], SIZE, SIZE, reference_spp=more), tmp_path / "anew")
    render_sequence(RenderJob(scene, [0], SIZE, SIZE, reference_spp=32), tmp_path / "raised")
    monkeypatch.setattr(Renderer, "sample_sum", counted)
    raised = render_sequence(RenderJob(scene, [0], SIZE, SIZE, reference_spp=more),
                             tmp_path / "raised")
    a, b = anew.read_reference(0), raised.read_reference(0)
    assert numbers == list(range(len(pass_sizes(more))))[-passes:]
    assert b.spp == more
    np.testing.assert_allclose(b.color, a.color, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(b.variance, a.variance, rtol=1e-4, atol=1e-7)
