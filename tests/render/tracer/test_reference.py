"""The reference: its parts, their variance, its passes, and going on after an interrupt."""

from __future__ import annotations

import json

import numpy as np
import pytest

import onespp.cli.run
import onespp.render.job
import onespp.render.tracer.reference
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.job import RenderJob, render_sequence
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.reference import (
    LARGEST_PASS,
    MOST_PATHS,
    PARTS,
    SampleSums,
    next_pass,
    pass_end,
    render_reference,
    whole_spp,
)
from onespp.render.tracer.renderer import Renderer
from onespp.render.tracer.sampler import Sobol, keys_from_seed
from onespp.scenes import catalog
from tests.support.furnace import furnace

from .test_renderer import small_scene

SIZE = 12


def passes_of(end: int, pixels: int = 1) -> list[tuple[int, int]]:
    """The part and the samples of every pass of a reference with `end` samples a part."""
    samples, passes = [0] * PARTS, []
    while (step := next_pass(samples, end, pixels)) is not None:
        passes.append(step)
        samples[step[0]] += step[1]
    return passes


@pytest.mark.parametrize("spp", [1, 2, 7, 8, 9, 64, 100, 513, 1024, 4096])
def test_parts_get_equally_many_samples_in_turns(spp):
    end = whole_spp(spp) // PARTS
    passes = passes_of(end)
    assert spp <= PARTS * end < spp + PARTS
    assert [part for part, _ in passes] == list(range(PARTS)) * (len(passes) // PARTS)
    assert [sum(n for p, n in passes if p == part) for part in range(PARTS)] == [end] * PARTS
    assert max(n for _, n in passes) <= LARGEST_PASS


@pytest.mark.parametrize("pixels", [1, 1920 * 1080, 3000 * 2000, MOST_PATHS + 1])
def test_a_larger_reference_begins_with_the_passes_of_a_smaller_one(pixels):
    larger = passes_of(300, pixels)
    for end in (16, 32, 64, 128):
        assert passes_of(end, pixels) == larger[:len(passes_of(end, pixels))]
    assert max(n * pixels for _, n in larger) <= max(MOST_PATHS, pixels)
    ends = [pass_end(done, pixels) for done in range(300)]
    assert all(end > done for done, end in enumerate(ends))
    assert ends == sorted(ends)


def test_a_reference_without_samples_is_refused():
    with pytest.raises(InputError, match="use 4 spp or more"):
        whole_spp(0)


def independent(spp: int, count: int = 32, size: int = SIZE) -> list[Reference]:
    renderer = Renderer(furnace(0.6, 0.8, 4), size, size)
    return [render_reference(renderer, 0, seed, spp) for seed in range(count)]


def test_the_stated_variance_is_that_of_the_mean():
    references = independent(24, size=24)
    spread = np.var([r.color for r in references], axis=0, ddof=1).mean()
    stated = np.mean([r.variance for r in references])
    # 576 pixels x 3 correlated components, 31 and 96 degrees of freedom: the ratio's own deviation
    # is about 1.5 %.
    assert stated == pytest.approx(spread, rel=0.1)


def test_the_noise_of_one_half_says_nothing_about_that_of_the_other():
    references = independent(8, size=24)
    truth = np.mean([r.color for r in references], 0, dtype=np.float64)
    products = []
    for r in references:
        a, b = r.halves
        # The mean of all is not the truth but 1/32 off, which correlates with a and b alike.
        products.append(((a - truth) * (b - truth) + r.variance / len(references)).mean())
    z = np.mean(products) / (np.std(products, ddof=1) / len(products) ** 0.5)
    own = np.mean([np.var(list(r.halves), axis=0, ddof=1).mean() for r in references])
    assert abs(z) < 4
    assert np.std(products, ddof=1) / len(products) ** 0.5 < 0.01 * own  # 1 % would be seen


def test_what_is_read_is_what_was_rendered(tmp_path):
    job = RenderJob(small_scene(), [0], SIZE, SIZE, reference_spp=12)
    found = render_sequence(job, tmp_path / "a").read_reference(0)
    made = render_reference(Renderer(small_scene(), SIZE, SIZE), 0, 0, 12)
    assert found.spp == made.spp == 12
    for name in ("color", "variance", "parts"):
        np.testing.assert_array_equal(getattr(found, name), getattr(made, name))
    np.testing.assert_allclose(np.mean(found.halves, 0), found.color, rtol=1e-6)
    passes = [Renderer(small_scene(), SIZE, SIZE).sample_sum(0, 0, part, 3) / 3
              for part in range(PARTS)]
    noise = found.variance.mean() ** 0.5
    assert np.abs(found.parts - passes).max() < 0.01 * noise  # half precision of the differences


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
        if passes == 7:  # in the middle of frame 1's reference
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
    assert passes - done == PARTS - 2  # of frame 1's 4 passes, 2 were kept
    for i in (0, 1):
        for kind in ("frames", "reference"):
            name = f"{kind}/{i:04d}.exr"
            assert (resumed.folder / name).read_bytes() == (undisturbed.folder / name).read_bytes()
    assert resumed.read_partial(1) is None


@pytest.mark.parametrize("spp", [40, 64])
def test_interrupts_at_every_pass_change_no_byte(tmp_path, monkeypatch, spp):
    monkeypatch.setattr(onespp.render.tracer.reference, "LARGEST_PASS", 8)
    job = RenderJob(small_scene(), [0], SIZE, SIZE, reference_spp=spp)
    undisturbed = render_sequence(job, tmp_path / "undisturbed")
    real, passes = Renderer.sample_sum, 0

    def second_interrupted(self, *arguments):
        nonlocal passes
        passes += 1
        if passes % 2 == 0:
            raise KeyboardInterrupt
        return real(self, *arguments)

    monkeypatch.setattr(Renderer, "sample_sum", second_interrupted)
    stops = 0
    while True:
        try:
            stopped = render_sequence(job, tmp_path / "stopped")
            break
        except KeyboardInterrupt:
            stops += 1
    assert stops == len(passes_of_job(spp)) - 1
    name = "reference/0000.exr"
    assert (stopped.folder / name).read_bytes() == (undisturbed.folder / name).read_bytes()


def passes_of_job(spp: int) -> list[tuple[int, int]]:
    return passes_of(spp // PARTS, SIZE * SIZE)


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


def test_the_default_of_run_is_an_error_and_keeps_a_better_reference_too(tmp_path, call,
                                                                         monkeypatch):
    monkeypatch.setattr(onespp.cli.run, "REFERENCE_ERROR", 1e3)
    out = tmp_path / "box"
    options = ("box", "--size", "12x9", "--frames", "0:2", "--out", out)
    assert call("render", *options[:3], "--frames", "0", "--out", out,
                "--reference-spp", 300)[0] == 0
    before = files(out / "reference")
    code, _, err = call("run", *options, "--method", "bilateral")
    assert code == 0
    assert "references to 1000 dB are likely to take 16 to 300 samples a pixel, so " in err
    assert {p: t for p, t in files(out / "reference").items() if p in before} == before
    sequence = FrameSequence.open(out)
    assert [sequence.reference_spp(i) for i in (0, 1)] == [300, 16]
    assert json.loads((out / "scores.json").read_text())["reference_spp"] == 16
    code, _, err = call("run", *options, "--reference-spp", 16, "--reference-error", 1)
    assert (code, err.count("\n"), "use one of them" in err) == (2, 1, True)


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


def parts_at_once(scene, spp: int) -> Reference:
    """A reference of whole parts, each in one pass."""
    renderer, sums = Renderer(scene, SIZE, SIZE), SampleSums.start(SIZE, SIZE)
    for part in range(PARTS):
        sums.add(part, renderer.sample_sum(0, 0, part, spp // PARTS), spp // PARTS)
    return sums.reference()


def assert_same(a: Reference, b: Reference) -> None:
    """But for the rounding of sums, and of differences to half precision."""
    assert a.spp == b.spp
    np.testing.assert_allclose(a.color, b.color, rtol=2e-6, atol=1e-7)
    noise = b.variance.mean() ** 0.5
    np.testing.assert_allclose(a.parts, b.parts, atol=0.01 * noise)


@pytest.mark.parametrize(("asked", "spp", "traced"), [
    (64, 64, 11),    # goes on
    (16, 32, 3),     # a part has 8 samples already: so get the others
    (32, 32, 3),
    (36, 36, 7),
    (24, 32, 3)])
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
    assert_same(found, parts_at_once(scene, spp))


def test_an_edited_scene_is_not_taken_for_the_old_one(tmp_path):
    render_sequence(RenderJob(small_scene(), [0], SIZE, SIZE), tmp_path / "a")
    with pytest.raises(InputError, match=r"has changed.*--overwrite"):
        render_sequence(RenderJob(small_scene(max_depth=4), [0], SIZE, SIZE), tmp_path / "a")


@pytest.mark.parametrize(("fewer", "more", "passes"), [(32, 64, 8), (32, 33, 4), (20, 64, 12)])
def test_a_reference_of_more_samples_goes_on_from_the_one_of_fewer(tmp_path, monkeypatch, fewer,
                                                                   more, passes):
    monkeypatch.setattr(onespp.render.tracer.reference, "LARGEST_PASS", 4)
    real, traced = Renderer.sample_sum, []

    def counted(self, *arguments):
        traced.append(arguments)
        return real(self, *arguments)

    scene = small_scene()
    render_sequence(RenderJob(scene, [0], SIZE, SIZE, reference_spp=fewer), tmp_path / "raised")
    monkeypatch.setattr(Renderer, "sample_sum", counted)
    raised = render_sequence(RenderJob(scene, [0], SIZE, SIZE, reference_spp=more),
                             tmp_path / "raised")
    assert len(traced) == passes
    assert_same(raised.read_reference(0), parts_at_once(scene, whole_spp(more)))


def as_older_versions_wrote(sequence: FrameSequence, i: int) -> None:
    reference = sequence.read_reference(i)
    sequence.write_reference(i, Reference(reference.color, reference.variance, reference.spp))


def test_a_reference_of_an_older_version_is_kept_and_said_if_it_is_good_enough(tmp_path, call):
    out = tmp_path / "box"
    command = ("render", "box", "--size", "12x9", "--out", out, "--frames", "0:2")
    assert call(*command, "--reference-spp", 16)[0] == 0
    as_older_versions_wrote(FrameSequence.open(out), 1)
    before = files(out)
    assert FrameSequence.open(out).read_reference(1).halves is None
    code, text, _ = call(*command, "--reference-spp", 16)
    assert (code, text.splitlines()[0]) == (0, (
        "kept 1 reference of an older version, without independent halves: scores against them "
        "have a noise floor (--overwrite replaces them)"))
    assert files(out) == before
    code, text, _ = call(*command, "--reference-spp", 32)
    assert (code, "halves" in text.replace(str(tmp_path), "")) == (0, False)
    sequence = FrameSequence.open(out)
    assert [sequence.read_reference(i).spp for i in (0, 1)] == [32, 32]
    assert sequence.read_reference(1).halves is not None
    made = render_reference(Renderer(catalog.load("box"), 9, 12), 1, 0, 32)
    np.testing.assert_array_equal(sequence.read_reference(1).parts, made.parts)  # anew


def test_samples_that_the_parts_cannot_share_are_rounded_up_and_said(tmp_path, call):
    command = ("render", "box", "--size", "12x9", "--frames", "0", "--out", tmp_path / "a")
    code, text, _ = call(*command, "--reference-spp", 2)
    assert (code, text.splitlines()[0]) == (
        0, "references have 4 parts of equally many samples: 4 spp instead of 2")
    sequence = FrameSequence.open(tmp_path / "a")
    assert sequence.manifest.reference_spp == sequence.reference_spp(0) == 4
