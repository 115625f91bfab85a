"""A sequence on disk: round trips, continuing, overwriting."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from onespp.render.channels import CHANNELS, HALF
from onespp.render.errors import InputError
from onespp.render.files.exr import read_exr, read_header, write_exr
from onespp.render.files.frame_ranges import format_frames, parse_frames
from onespp.render.files.manifest import Manifest, Run
from onespp.render.files.matrices import format_matrices, read_matrices
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.frame import Frame
from tests.support.small_sequence import (
    HEIGHT,
    OBJECTS,
    WIDTH,
    contents,
    small_frame,
    small_manifest,
    small_sequence,
)


def test_a_frame_comes_back_exactly_and_what_is_stored_as_half_to_half(tmp_path):
    sequence = small_sequence(tmp_path / "s")
    frame, back = small_frame(1), FrameSequence.open(tmp_path / "s").read_frame(1)
    for name, image in frame.images.items():
        assert back[name].dtype == image.dtype
        assert back[name].shape == image.shape
        expected = image.astype(np.float16) if CHANNELS[name].stored == HALF else image
        np.testing.assert_array_equal(back[name], expected, err_msg=name)
    np.testing.assert_array_equal(back.camera_from_world, frame.camera_from_world)
    np.testing.assert_array_equal(back.screen_from_world, frame.screen_from_world)
    np.testing.assert_array_equal(back.world_from_object, frame.world_from_object)
    assert back.index == 1
    assert read_header(sequence.folder / "frames/0001.exr").attributes["scene"] == "small"


def test_references_of_radiance_alone_are_taken_of_other_programs_only(tmp_path):
    white = np.ones((HEIGHT, WIDTH), np.float32)
    for source in ("foreign", "render"):
        sequence = FrameSequence.create(tmp_path / source, small_manifest().model_copy(
            update={"source": source}))
        write_exr(sequence.folder / "reference/0000.exr", dict.fromkeys("RGB", white),
                  {"spp": "64"})
        if source == "render":
            with pytest.raises(InputError, match=r"lacks the channel variance\.R"):
                sequence.read_reference(0)
            continue
        reference = sequence.read_reference(0)
        assert np.isnan(reference.variance).all()
        assert (reference.color == 1).all()


def test_channel_names_are_the_ones_other_programs_know(tmp_path):
    sequence = small_sequence(tmp_path / "s")
    names = set(read_header(sequence.folder / "frames/0000.exr").channels)
    assert {"R", "G", "B", "Z", "N.X", "N.Y", "N.Z", "P.X", "P.Y", "P.Z", "ID",
            "albedo.R", "albedo.G", "albedo.B", "direct.R"} <= names


def test_planes_hold_what_their_names_say_to_other_programs(tmp_path):
    frame, sequence = small_frame(0), small_sequence(tmp_path / "s", (0,))
    planes, _ = read_exr(sequence.folder / "frames/0000.exr")
    for name, layer in (("color", "RGB"), ("direct", ("direct.R", "direct.G", "direct.B")),
                        ("normal", ("N.X", "N.Y", "N.Z")), ("position", ("P.X", "P.Y", "P.Z"))):
        for i, plane in enumerate(layer):
            np.testing.assert_array_equal(planes[plane], frame[name][..., i], err_msg=plane)


def test_half_channels_are_clipped_and_never_overflow(tmp_path):
    sequence = small_sequence(tmp_path / "s")
    frame = small_frame(0)
    albedo = np.array(frame["albedo"])
    albedo[0, 0] = (1e6, -np.inf, 65519)
    sequence.write_frame(Frame(0, {**frame.images, "albedo": albedo}, frame.camera_from_world,
                               frame.screen_from_world, frame.world_from_object))
    np.testing.assert_array_equal(sequence.read_frame(0)["albedo"][0, 0], [65504, -65504, 65504])


def test_only_the_channels_asked_for_are_in_the_frame(tmp_path):
    frame = small_sequence(tmp_path / "s").read_frame(0, ("depth", "color"))
    assert list(frame.images) == ["depth", "color"]


matrices = arrays(np.float64, (4, 4), elements=st.floats(allow_nan=False, allow_infinity=False))


@given(matrices, matrices, st.lists(matrices, min_size=1, max_size=3))
@settings(max_examples=100, deadline=None)
def test_matrices_in_json_lose_no_bit(tmp_path_factory, camera, screen, objects):
    path = tmp_path_factory.mktemp("m") / "0007.json"
    names = OBJECTS[:len(objects)]
    path.write_text(format_matrices(7, camera, screen, dict(zip(names, objects))), "utf-8")
    back = read_matrices(path, 7, names)
    assert back[0].tobytes() == camera.tobytes()
    assert back[1].tobytes() == screen.tobytes()
    assert back[2].tobytes() == np.stack(objects).tobytes()


def test_matrices_are_a_row_a_line_with_their_names(tmp_path):
    small_sequence(tmp_path / "s")
    text = (tmp_path / "s/frames/0000.json").read_text("utf-8")
    data = json.loads(text)
    assert list(data) == ["frame", "camera_from_world", "screen_from_world", "objects"]
    assert list(data["objects"]) == list(OBJECTS)
    assert [entry["id"] for entry in data["objects"].values()] == [0, 1, 2]
    assert max(map(len, text.splitlines())) < 110


def test_matrices_of_what_stands_still_are_not_written(tmp_path):
    """Another object that moves, or an older manifest, which has all: each file by its manifest."""
    frame, moving = small_frame(0), OBJECTS[1:2]
    some, all_ = (FrameSequence.create(tmp_path / str(names), small_manifest(moving=names))
                  for names in (moving, None))
    for sequence in (some, all_):
        sequence.write_frame(frame)
    file = some.folder / "frames/0000.json"
    assert list(json.loads(file.read_text("utf-8"))["objects"]) == list(moving)
    back = some.read_frame(0)
    expected = np.tile(np.eye(4), (len(OBJECTS), 1, 1))
    expected[1] = frame.world_from_object[1]
    assert (frame.world_from_object[0] != np.eye(4)).any()
    np.testing.assert_array_equal(back.world_from_object, expected)
    np.testing.assert_array_equal(all_.read_frame(0).world_from_object, frame.world_from_object)
    file.write_bytes((all_.folder / "frames/0000.json").read_bytes())
    with pytest.raises(InputError, match="disagrees with the manifest about the object 'ball'"):
        some.read_frame(0)
    continued = FrameSequence.create(all_.folder, small_manifest(moving=moving))
    assert continued.manifest.moving is None
    with pytest.raises(ValueError, match="'another' is not one of the objects"):
        small_manifest(moving=("another",))


@given(st.sets(st.integers(0, 300), min_size=1, max_size=40))
def test_frame_ranges_read_back_as_written(frames):
    assert parse_frames(format_frames(sorted(frames))) == tuple(sorted(frames))


@pytest.mark.parametrize(("text", "frames"), [
    ("0:4", (0, 1, 2, 3)), ("7", (7,)), ("0:10:4", (0, 4, 8)), ("1,3:5, 9", (1, 3, 4, 9))])
def test_frame_ranges_mean_what_python_means(text, frames):
    assert parse_frames(text) == frames


@pytest.mark.parametrize("text", ["", "a", "-1", "3:3", "0:5:0", "5:0:-1", "1.5", "0:4,2", "2,2",
                                  "0:999999999", "1:2:3:4", "99999999999999999999", "٣"])
def test_frame_ranges_that_make_no_sense_are_refused(text):
    with pytest.raises(InputError, match="frames"):
        parse_frames(text)


def test_the_manifest_reads_back_as_written(tmp_path):
    manifest = small_manifest(
        frames=(0, 1, 2, 7), reference_spp=64, about="two\nlines", fps=29.97, max_depth=6,
        device="llvm", versions={"onespp": "0.1.0"}, created="2025-01-01T00:00:00+00:00")
    FrameSequence.create(tmp_path / "s", manifest)
    assert FrameSequence.open(tmp_path / "s").manifest == manifest
    assert json.loads((tmp_path / "s/manifest.json").read_text())["frames"] == "0:3,7"


def noisy_parts(size: tuple[int, int], level: float, noise: float) -> np.ndarray:
    rng = np.random.default_rng(3)
    return (level + noise * rng.standard_normal((4, *size, 3))).astype(np.float32)


@pytest.mark.parametrize(("level", "noise"), [(1.0, 0.3), (200.0, 1e-3), (0.01, 1e-4), (1e3, 1e3)])
def test_parts_of_a_reference_come_back_but_for_a_thousandth_of_their_noise(tmp_path, level, noise):
    sequence = small_sequence(tmp_path / "s")
    parts = noisy_parts(sequence.size, level, noise)
    made = Reference.of_parts(parts, 64)
    sequence.write_reference(1, made)
    assert sequence.has_parts(1)
    back = sequence.read_reference(1)
    ulp = 2.0**-22 * level
    np.testing.assert_array_equal(back.color, made.color)
    if ulp < 1e-4 * noise:  # else parts are rounded, in float32, before they are subtracted
        np.testing.assert_array_equal(back.variance, made.variance)
        np.testing.assert_array_equal(back.parts, made.parts)
    np.testing.assert_allclose(back.parts, parts, rtol=0, atol=6e-3 * noise + ulp)
    np.testing.assert_allclose(back.color, parts.mean(0, dtype=np.float64), rtol=1e-7)
    np.testing.assert_allclose(back.halves, [parts[:2].mean(0), parts[2:].mean(0)], rtol=0,
                               atol=6e-3 * noise + ulp)
    assert np.square(back.parts - parts).mean() < (1e-3 * noise) ** 2 + ulp**2
    expected = parts.astype(np.float64).var(0, ddof=1) / 4
    np.testing.assert_allclose(back.variance, expected, rtol=0.05, atol=(noise / 100 + ulp)**2)
    names = read_header(tmp_path / "s/reference/0001.exr").channels
    assert {n: t.itemsize for n, t in names.items() if len(n) == 1} == {"R": 4, "G": 4, "B": 4}
    assert sum(t.itemsize for t in names.values()) == 30


def test_parts_that_half_precision_cannot_tell_apart_are_clipped_and_stay_finite(tmp_path):
    sequence = small_sequence(tmp_path / "s")
    parts = noisy_parts(sequence.size, 1e7, 1e6)
    sequence.write_reference(0, Reference.of_parts(parts, 16))
    back = sequence.read_reference(0)
    np.testing.assert_allclose(back.color, parts.mean(0, dtype=np.float64), rtol=1e-6)
    assert np.isfinite(back.parts).all()
    assert np.abs(back.parts - back.color).max() == 2 * 65504
    parts[0, 0, 0] = np.inf
    sequence.write_reference(0, Reference.of_parts(parts, 16))
    assert not np.isfinite(sequence.read_reference(0).color[0, 0]).any()


def test_references_results_and_runs_come_back(tmp_path):
    sequence = small_sequence(tmp_path / "s")
    frame = small_frame(1)
    assert not sequence.has_reference(1)
    sequence.write_reference(1, Reference(frame["color"], frame["direct"], 4096), {"seed": "3"})
    assert sequence.has_reference(1)
    assert sequence.reference_spp(1) == 4096
    back = sequence.read_reference(1)
    np.testing.assert_array_equal(back.color, frame["color"])
    np.testing.assert_array_equal(back.variance, frame["direct"])
    assert back.spp == 4096

    assert (back.parts, back.halves, sequence.has_parts(1)) == (None, None, False)

    assert sequence.methods() == []
    sequence.write_result("a-trous", 0, frame["color"])
    assert sequence.methods() == []  # without a run the method is not complete
    run = Run(method="a-trous", parameters={"levels": 5, "sigma": 0.1, "on": True}, threads=2,
              first_ms=120.5, ms={0: 3.25, 1: 3.5})
    sequence.write_run("a-trous", run)
    assert sequence.methods() == ["a-trous"]
    assert sequence.read_run("a-trous") == run
    assert sequence.has_result("a-trous", 0)
    assert not sequence.has_result("a-trous", 1)
    np.testing.assert_array_equal(sequence.read_result("a-trous", 0), frame["color"])


def test_partial_references_come_back_and_go(tmp_path):
    sequence = small_sequence(tmp_path / "s")
    assert sequence.read_partial(0) is None
    total = np.random.default_rng(0).normal(size=(3, 4, 3))
    sequence.write_partial(0, {"total": total, "samples": 65, "antialias": True})
    back = sequence.read_partial(0)
    assert back is not None
    assert back["total"].dtype == np.float64
    np.testing.assert_array_equal(back["total"], total)
    assert int(back["samples"]) == 65
    assert bool(back["antialias"])
    sequence.remove_partial(0)
    sequence.remove_partial(0)
    assert sequence.read_partial(0) is None


def test_the_same_sequence_is_continued_and_keeps_its_files(tmp_path):
    small_sequence(tmp_path / "s")
    before = contents(tmp_path / "s")
    sequence = FrameSequence.create(tmp_path / "s", small_manifest(
        frames=(0, 1), device="cuda", versions={"onespp": "9"}, created="later", about="other"))
    assert contents(tmp_path / "s") == before
    assert sequence.has_frame(0)
    assert not sequence.has_frame(2)


def test_a_frame_counts_only_with_images_and_matrices(tmp_path):
    sequence = small_sequence(tmp_path / "s")
    (tmp_path / "s/frames/0000.json").unlink()
    (tmp_path / "s/frames/0001.exr").unlink()
    assert not sequence.has_frame(0)
    assert not sequence.has_frame(1)


def test_frames_and_a_reference_can_be_added_later(tmp_path):
    small_sequence(tmp_path / "s", (2, 3))
    grown = FrameSequence.create(tmp_path / "s", small_manifest(
        frames=(3, 4, 9), reference_spp=16, reference_filter="box"))
    assert grown.frames == [2, 3, 4, 9]
    assert FrameSequence.open(tmp_path / "s").manifest == grown.manifest
    assert grown.manifest.reference_spp == 16
    same = FrameSequence.create(tmp_path / "s", small_manifest(frames=(2,)))
    assert same.frames == [2, 3, 4, 9]
    assert same.manifest.reference_spp == 16
    assert same.manifest.reference_filter == "box"
    more = FrameSequence.create(tmp_path / "s", small_manifest(
        frames=(2,), reference_spp=64, reference_filter="box"))
    assert more.manifest.reference_spp == 64
    with pytest.raises(InputError, match="another reference_filter"):
        FrameSequence.create(tmp_path / "s", small_manifest(reference_spp=64))


@pytest.mark.parametrize(("change", "words"), [
    ({"seed": 5}, "another seed (0 there, 5 here)"),
    ({"scene": "big"}, "another scene (small there, big here)"),
    ({"width": 10}, "another width (9 there, 10 here)"),
    ({"fingerprint": "abc"}, "another content"),
    ({"objects": ("a", "b")}, "another objects"),
    ({"channels": ("color",)}, "another channels"),
    ({"max_depth": 3}, "another max_depth"),
    ({"height": 22}, "another height (21 there, 22 here)"),
    ({"source": "games202"}, "another source"),
    ({"fps": 25.0}, "another fps"),
    ({"spp": 2}, "another spp"),
    ({"direct": "resampled"}, "another direct (mis there, resampled here)"),
    ({"sampler": "zsobol"}, "another sampler (pcg there, zsobol here)"),
    ({"tracing": 2}, "another kind of frames (another version of onespp made them"),
])
def test_another_sequence_is_not_continued_and_the_difference_is_named(tmp_path, change, words):
    small_sequence(tmp_path / "s")
    before = contents(tmp_path / "s")
    with pytest.raises(InputError) as error:
        FrameSequence.create(tmp_path / "s", small_manifest(**change))
    assert words in str(error.value)
    assert "--overwrite" in str(error.value)
    assert contents(tmp_path / "s") == before


def test_overwriting_removes_the_sequence_and_nothing_else(tmp_path):
    sequence = small_sequence(tmp_path / "s")
    frame = small_frame(0)
    sequence.write_reference(0, Reference(frame["color"], frame["direct"], 8))
    sequence.write_partial(1, {"samples": 1})
    sequence.write_result("m", 0, frame["color"])
    sequence.write_run("m", Run(method="m"))
    ours = {"scores.json", "scores.csv", "pictures/sheet.png", "pictures/box.mp4",
            "frames/.123.tmp.0002.exr"}
    foreign = {"notes.txt", "frames/0000.exr.bak", "frames/mine.exr", "denoised/m/notes.md",
               "pictures/deep/a.png", "src/0000.exr", "denoised/0000.exr"}
    for name in ours | foreign:
        path = tmp_path / "s" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    FrameSequence.create(tmp_path / "s", small_manifest(seed=8), overwrite=True)
    assert set(contents(tmp_path / "s")) == foreign | {"manifest.json"}
    assert FrameSequence.open(tmp_path / "s").manifest.seed == 8
    assert not (tmp_path / "s/reference").exists()


def test_overwriting_does_not_need_a_readable_manifest(tmp_path):
    small_sequence(tmp_path / "s")
    (tmp_path / "s/manifest.json").write_text("{")
    with pytest.raises(InputError, match="not valid JSON"):
        FrameSequence.create(tmp_path / "s", small_manifest())
    fresh = FrameSequence.create(tmp_path / "s", small_manifest(), overwrite=True)
    assert set(contents(tmp_path / "s")) == {"manifest.json"}
    assert not fresh.has_frame(0)


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_folder_with_other_files_is_left_alone(tmp_path, overwrite):
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(InputError, match="holds files that are no sequence"):
        FrameSequence.create(tmp_path, small_manifest(), overwrite)
    with pytest.raises(InputError, match="is a file"):
        FrameSequence.create(tmp_path / "thesis.tex", small_manifest(), overwrite)
    assert os.listdir(tmp_path) == ["thesis.tex"]


def test_an_empty_folder_can_be_used(tmp_path):
    (tmp_path / ".DS_Store").write_text("x")
    assert FrameSequence.create(tmp_path, small_manifest()).size == (HEIGHT, WIDTH)


@pytest.mark.parametrize(("act", "words"), [
    (lambda s: s.write_frame(small_frame(5)), "has no frame 5: its frames are 0:2"),
    (lambda s: s.read_frame(5), "has no frame 5"),
    (lambda s: s.read_frame(0, ("variance",)), "lacks the channel 'variance'"),
    (lambda s: s.read_reference(0), "does not exist"),
    (lambda s: s.read_result("m", 0), "does not exist"),
    (lambda s: s.read_run("m"), "does not exist"),
    (lambda s: s.write_result("../m", 0, small_frame()["color"]), "not a name for a method"),
    (lambda s: s.read_result("", 0), "not a name for a method"),
    (lambda s: s.write_result("m", 0, small_frame()["depth"]), "expected (21, 9, 3)"),
    (lambda s: s.write_reference(7, Reference(small_frame()["color"], small_frame()["color"], 2)),
     "has no frame 7"),
])
def test_what_a_sequence_cannot_do_ends_in_one_sentence(tmp_path, act, words):
    sequence = small_sequence(tmp_path / "s")
    before = contents(tmp_path / "s")
    with pytest.raises(InputError) as error:
        act(sequence)
    assert words in str(error.value)
    assert "\n" not in str(error.value)
    assert contents(tmp_path / "s") == before


def test_a_frame_with_other_objects_than_the_manifest_is_not_written(tmp_path):
    sequence, frame = small_sequence(tmp_path / "s"), small_frame(0)
    with pytest.raises(InputError, match=r"has 2 objects, the manifest of .* lists 3"):
        sequence.write_frame(Frame(0, frame.images, frame.camera_from_world,
                                   frame.screen_from_world, frame.world_from_object[:2]))


def test_equal_frames_are_equal_bytes(tmp_path):
    a, b = small_sequence(tmp_path / "a"), small_sequence(tmp_path / "b")
    assert contents(a.folder) == contents(b.folder)


def test_opening_what_is_no_sequence_says_how_to_make_one(tmp_path):
    for folder in (tmp_path, tmp_path / "missing"):
        with pytest.raises(InputError, match="onespp render"):
            FrameSequence.open(folder)


def test_a_manifest_of_the_python_side_takes_any_list_of_frames():
    assert Manifest(scene="s", frames=range(3), width=1, height=1, channels=("color",),
                    objects=("a",)).frames == (0, 1, 2)
