"""Frames of other renderers: by Blender's names, by Mitsuba's, by the user's own."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from onespp.api.importing import import_frames, unfit_methods
from onespp.denoise.geometry.correspondence import NOWHERE, previous_pixel
from onespp.denoise.studies.agreement import AS_IT_IS, agreement
from onespp.render.cli.arguments import parse_settings
from onespp.render.errors import InputError
from onespp.render.files.exr import read_any_exr
from onespp.render.files.exr_header import _attributes
from onespp.render.files.sequence import FrameSequence
from onespp.render.foreign.camera_of_positions import camera_of_positions
from onespp.render.foreign.channel_maps import channel_map
from onespp.render.frame import Frame
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog

SIZE = (40, 56)
NAMES = ("color", "albedo", "normal", "position", "depth", "id")


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    """Of `box`, in which a ball moves and the camera stands; some frames apart, so that it is
    seen to."""
    renderer = Renderer(catalog.load("box"), *SIZE)
    return [renderer.frame(i, 0, NAMES) for i in (4, 8, 12)]


def motion(before: Frame, now: Frame) -> np.ndarray:
    """(h, w, 2) pixels to where each surface was, y down; 0 where there is none."""
    y, x = np.indices(SIZE) + 0.5
    found = np.zeros((*SIZE, 2))
    for i, (m0, m1) in enumerate(zip(before.world_from_object, now.world_from_object)):
        p = np.concatenate([now["position"], np.ones((*SIZE, 1))], -1).astype(np.float64)
        at = p @ (before.screen_from_world @ m0 @ np.linalg.inv(m1)).T
        here = now["id"] == i
        found[here] = (at[..., :2] / at[..., 3:] - np.stack([x, y], -1))[here]
    return found


def write(path: Path, *parts: Mapping[str, np.ndarray], **header) -> None:
    """An EXR file of one part, or of several, each compressed in another way."""
    kinds = (OpenEXR.ZIP_COMPRESSION, OpenEXR.PIZ_COMPRESSION, OpenEXR.RLE_COMPRESSION)
    made = [OpenEXR.Part({"compression": kinds[k % 3], "type": OpenEXR.scanlineimage, **header},
                         {name: np.ascontiguousarray(image) for name, image in part.items()},
                         f"part{k}") for k, part in enumerate(parts)]
    OpenEXR.File(made).write(str(path))


def named(source: str, image: np.ndarray, letters: str,
          dtype: type = np.float32) -> dict[str, np.ndarray]:
    return {f"{source}.{letter}" if source else letter: plane.astype(dtype)
            for letter, plane in zip(letters, np.moveaxis(np.atleast_3d(image), -1, 0))}


def blender(folder: Path, frames: list[Frame]) -> Path:
    """Files as Blender's multilayer output: half radiance, vectors with y up, depth 1e10 where
    there is nothing, objects by any numbers."""
    folder.mkdir()
    for k, frame in enumerate(frames):
        shown = frame["id"] >= 0
        vector = motion(frames[max(k - 1, 0)], frame) * (1, -1)
        write(folder / f"shot{k + 1:04d}.exr",
              named("ViewLayer.Combined", 2 * frame["color"], "RGB", np.float16),
              named("ViewLayer.Noisy Image", frame["color"], "RGB", np.float16),
              named("ViewLayer.Depth", np.where(shown, frame["depth"], 1e10), "Z"),
              named("ViewLayer.Normal", frame["normal"], "XYZ")
              | named("ViewLayer.Denoising Albedo", frame["albedo"], "RGB", np.float16),
              named("ViewLayer.Vector", np.concatenate([vector, -vector], -1), "XYZW")
              | named("ViewLayer.IndexOB", np.where(shown, 7 * frame["id"] + 3, 0), "X"))
    return folder


def mitsuba(folder: Path, frames: list[Frame], position: bool = True) -> Path:
    """Files as of the integrator `aov`, in tiles."""
    folder.mkdir()
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = 16
    tiles.mode = OpenEXR.ONE_LEVEL
    for k, frame in enumerate(frames):
        origin = np.linalg.inv(frame.camera_from_world)[:3, 3]
        distance = np.linalg.norm(frame["position"] - origin, axis=-1)
        images = (named("", frame["color"], "RGB") | named("alb", frame["albedo"], "RGB")
                  | named("nn", frame["normal"], "XYZ")
                  | named("dd", np.where(frame["id"] >= 0, distance, 0), "T"))
        if position:
            images |= named("pp", frame["position"], "XYZ")
        write(folder / f"{k}.exr", images, type=OpenEXR.tiledimage, tiles=tiles)
    return folder


def found_again(sequence, a: int, b: int) -> float:
    frames = [sequence.read_frame(i, [c for c in ("normal", "depth", "id", "motion")
                                      if c in sequence.channels]) for i in (a, b)]
    return float((previous_pixel(*frames) != NOWHERE).mean())


def test_what_blender_writes(frames, tmp_path):
    sequence = import_frames(blender(tmp_path / "b", frames), tmp_path / "out")
    assert (sequence.frames, sequence.size) == ([1, 2, 3], SIZE)
    for i, frame in zip(sequence.frames, frames):
        got = sequence.read_frame(i, [*sequence.channels])
        np.testing.assert_allclose(got["color"], frame["color"], rtol=1e-3, atol=1e-6)
        np.testing.assert_allclose(got["depth"], frame["depth"], rtol=1e-6)
        np.testing.assert_allclose(got["normal"], frame["normal"], atol=1e-6)
        pairs = np.unique(np.stack([got["id"], frame["id"]]).reshape(2, -1), axis=1)
        assert pairs.shape[1] == len({*pairs[0]}) == len({*pairs[1]})  # objects, in other numbers
    moved = sequence.read_frame(2, ["motion"])["motion"]
    np.testing.assert_allclose(moved, motion(frames[0], frames[1]), atol=1e-3)
    assert np.abs(moved).max() > 2
    share = float((previous_pixel(frames[0], frames[1]) != NOWHERE).mean())
    assert found_again(sequence, 1, 2) == pytest.approx(share, abs=0.02)


def test_positions_tell_the_camera(frames, tmp_path):
    sequence = import_frames(mitsuba(tmp_path / "m", frames), tmp_path / "out")
    for i, frame in zip(sequence.frames, frames):
        got = sequence.read_frame(i, ["depth", "position", "albedo"])
        shown = frame["id"] >= 0
        np.testing.assert_allclose(got["depth"], frame["depth"], rtol=1e-3, atol=1e-4)
        np.testing.assert_allclose(got["position"][shown], frame["position"][shown], atol=0.02)
        np.testing.assert_allclose(got.camera_from_world, frame.camera_from_world, atol=5e-3)
    assert unfit_methods(sequence) == ["without replay and replay_before there is no asvgf"]


def test_distances_need_a_field_of_view_without_positions(frames, tmp_path):
    folder = mitsuba(tmp_path / "m", frames, position=False)
    with pytest.raises(InputError, match=r"0.exr has distances .*fov 39"):
        import_frames(folder, tmp_path / "out")
    assert not (tmp_path / "out" / "manifest.json").exists()
    camera = catalog.load("box").camera
    across = 2 * np.degrees(np.arctan(np.tan(np.radians(camera.fov) / 2) * SIZE[1] / SIZE[0]))
    sequence = import_frames(folder, tmp_path / "out", fov=float(across))
    np.testing.assert_allclose(sequence.read_frame(1, ["depth"])["depth"], frames[1]["depth"],
                               rtol=1e-4)


def test_a_file_for_each_pass_and_names_of_ones_own(frames, tmp_path):
    folder = tmp_path / "passes"
    folder.mkdir()
    for k, frame in enumerate(frames):
        write(folder / f"beauty.{k:03d}.exr", named("", frame["color"], "RGB"))
        write(folder / f"surface.{k:03d}.exr", named("N", frame["normal"], "xyz")
              | named("z", frame["depth"], "V"))
    truth = tmp_path / "truth"
    truth.mkdir()
    write(truth / "t_1.exr", named("", frames[1]["color"], "RGB"))
    channels = {"color": "beauty", "normal": "surface.N", "depth": "surface.z"}
    sequence = import_frames(folder, tmp_path / "out", channels=channels, reference=truth)
    np.testing.assert_array_equal(sequence.read_frame(2, ["depth"])["depth"], frames[2]["depth"])
    assert sequence.has_reference(1)
    assert not sequence.has_reference(0)
    with pytest.raises(InputError, match="another content"):  # read otherwise, other frames
        import_frames(folder, tmp_path / "out", channels={**channels, "normal": "none"},
                      reference=truth)


def test_what_is_as_far_as_blender_says_nothing_is_shows_nothing(tmp_path):
    folder = tmp_path / "b"
    folder.mkdir()
    depth = np.full((*SIZE, 1), 5.0)
    depth[:10] = 1e10
    write(folder / "1.exr", named("L.Combined", np.ones((*SIZE, 3)), "RGB")
          | named("L.Depth", depth, "Z"))
    frame = import_frames(folder, tmp_path / "out").read_frame(1, ["id", "depth"])
    assert (frame["id"][:10] == -1).all()
    assert (frame["id"][10:] == 0).all()
    assert not frame["depth"][:10].any()


@pytest.mark.parametrize(("options", "words"), [
    ({}, None), ({"motion_up": False}, "its y turned over"),
    ({"motion_from": "previous"}, "its direction turned round")])
def test_motion_read_the_wrong_way_is_named(frames, tmp_path, options, words, call):
    folder = blender(tmp_path / "b", [frames[0], frames[2]])
    found = agreement(import_frames(folder, tmp_path / "out", **options))
    code, out, err = call("check", tmp_path / "out")
    assert code == 0, err
    if words is None:
        assert found.better is None
        assert found.share > 0.8
        assert found.readings[AS_IT_IS] == max(found.readings.values())
    else:
        assert found.better is not None
        assert words in found.better
        assert words in out


def test_radiance_that_an_integrator_writes_twice_is_no_albedo(frames, tmp_path):
    folder = mitsuba(tmp_path / "m", frames)
    more = mitsuba(tmp_path / "more", frames)
    for path in more.iterdir():
        images = dict(read_any_exr(path))
        for letter, other in zip("RGB", "GBR"):
            images[f"img.{letter}"] = images[letter]
            images[f"direct.{letter}"] = images[other]  # of another integrator
        write(path, images | {"img.A": images["R"], "direct.A": images["R"]})
    assert "albedo" in import_frames(more, tmp_path / "a", channels={"albedo": "alb"}).channels
    sequence = import_frames(more, tmp_path / "b", reference=more)
    assert sequence.has_reference(0)
    plain = import_frames(folder, tmp_path / "c")
    for i, frame in zip(sequence.frames, frames):
        for name in ("color", "albedo"):
            got, alone = (s.read_frame(i, [name])[name] for s in (sequence, plain))
            np.testing.assert_array_equal(got, alone)
        np.testing.assert_array_equal(sequence.read_reference(i).color, frame["color"])
    rng = np.random.default_rng(0)
    images = {name: rng.random((4, 4)) for name in ("R", "G", "B", "dd.T")}
    images |= {f"img.{letter}": images[letter] for letter in "RGB"}
    assert set(channel_map(images, "auto", {}).channels) == {"color", "distance"}
    two = images | {f"{name}.{letter}": images["dd.T"] for name in "pq" for letter in "RGB"}
    assert channel_map(two, "auto", {"color": "p"}).channels["albedo"] == ("q.R", "q.G", "q.B")


def test_a_references_radiance_is_all_that_is_asked_of_it(frames, tmp_path):
    truth = mitsuba(tmp_path / "t", frames)
    for path in truth.iterdir():
        images = dict(read_any_exr(path))
        write(path, images | {f"other.{letter}": images["dd.T"] for letter in "RGB"})
    sequence = import_frames(truth, tmp_path / "out", channels={"albedo": "alb"}, reference=truth)
    assert [i for i in sequence.frames if sequence.has_reference(i)] == sequence.frames


def test_one_of_several_view_layers_is_taken_as_said():
    images = {f"{layer}.{name}.{letter}": np.zeros((4, 4)) for layer in ("a", "b")
              for name in ("Combined", "Denoising Albedo") for letter in "RGB"}
    found = channel_map(images, "auto", {"color": "b.Combined"}).channels
    assert found["albedo"] == tuple(f"b.Denoising Albedo.{letter}" for letter in "RGB")


@pytest.mark.parametrize("nothing", [0.0, np.inf, -np.inf, np.nan, 1e10])
def test_positions_alone_tell_where_nothing_is(frames, tmp_path, nothing):
    folder = tmp_path / "p"
    folder.mkdir()
    position = frames[0]["position"].copy()
    position[:9] = nothing
    write(folder / "1.exr", named("", frames[0]["color"], "RGB") | named("pp", position, "XYZ"))
    frame = import_frames(folder, tmp_path / "out").read_frame(1, ["id", "depth", "normal"])
    assert (frame["id"][:9] == -1).all()
    assert not frame["depth"][:9].any()
    assert not frame["normal"][:9].any()
    there = frames[0]["id"][9:] >= 0
    np.testing.assert_allclose(frame["depth"][9:][there], frames[0]["depth"][9:][there], rtol=1e-3)


def test_positions_of_nothing_tell_no_camera_and_that_is_said(frames, tmp_path):
    (tmp_path / "p").mkdir()
    write(tmp_path / "p" / "1.exr", named("", frames[0]["color"], "RGB")
          | named("pp", np.zeros((*SIZE, 3)), "XYZ"))
    with pytest.raises(InputError, match="shows surfaces in 0 pixels, too few for positions"):
        import_frames(tmp_path / "p", tmp_path / "out")


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_an_id_that_is_no_number_is_of_nothing(frames, tmp_path, number, call):
    folder = blender(tmp_path / "b", frames[:1])
    path, = folder.iterdir()
    images = {name: plane.copy() for name, plane in read_any_exr(path).items()}
    y, x = np.argwhere(frames[0]["id"] >= 0)[0]
    images["ViewLayer.IndexOB.X"][y, x] = number
    write(path, images)
    code, _, err = call("import", folder, "--out", tmp_path / "out")
    assert code == 0, err
    shown = FrameSequence.open(tmp_path / "out").read_frame(1, ["id"])["id"] >= 0
    assert not shown[y, x]
    assert shown.sum() == (frames[0]["id"] >= 0).sum() - 1


def windowed(path: Path, images: Mapping[str, np.ndarray], at: tuple[int, int],
             shown: tuple[int, int] = SIZE, **more) -> None:
    """Images of a data window that begins at (row, column) of a display window of another size,
    which begins at (-7, 5)."""
    h, w = next(iter(images.values())).shape
    corner, first = np.array([5, -7], np.int32), np.array([5 + at[1], at[0] - 7], np.int32)
    write(path, images, dataWindow=(first, first + np.array([w - 1, h - 1], np.int32)),
          displayWindow=(corner, corner + np.array([shown[1] - 1, shown[0] - 1], np.int32)), **more)


@pytest.mark.parametrize("tiled", [False, True])
@pytest.mark.parametrize(("at", "size", "words"), [
    ((3, 5), (20, 30), ["padded"]), ((-4, -6), (50, 66), ["cropped"]),
    ((-3, 9), (20, 90), ["padded", "cropped"]), ((90, 90), (2, 3), ["padded", "cropped"]),
    ((-9, 0), (2, 3), ["padded", "cropped"]), ((0, 0), SIZE, [])])
def test_data_are_where_the_display_window_has_them(tmp_path, at, size, words, tiled):
    whole = np.arange(1, 1 + 200 * 200, dtype=np.float32).reshape(200, 200)
    there = np.zeros_like(whole)
    rows, columns = (slice(100 + a, 100 + a + n) for a, n in zip(at, size))
    there[rows, columns] = whole[rows, columns]
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = 16
    windowed(tmp_path / "a.exr", {"Z": whole[rows, columns]}, at, **(
        {"type": OpenEXR.tiledimage, "tiles": tiles} if tiled else {}))
    said: list[str] = []
    found = read_any_exr(tmp_path / "a.exr", said.append)["Z"]
    np.testing.assert_array_equal(found, there[100:100 + SIZE[0], 100:100 + SIZE[1]])
    assert [word for word in ("padded", "cropped") if any(word in line for line in said)] == words


def test_layers_that_were_cropped_to_what_they_show_are_imported_and_told(frames, tmp_path, call):
    folder = tmp_path / "b"
    folder.mkdir()
    frame = frames[0]
    write(folder / "rgb1.exr", named("L.Combined", frame["color"], "RGB"))
    depth = np.zeros(SIZE, np.float32)
    depth[3:20, 5:30] = 2
    windowed(folder / "z1.exr", {"L.Depth.Z": depth[3:20, 5:30]}, (3, 5))
    code, out, err = call("import", folder, "--out", tmp_path / "out", "--channel",
                          "depth=z.L.Depth", "--channel", "color=rgb.L.Combined")
    assert code == 0, err
    assert "padded with 0 to the display window (1 files, as z1.exr)" in out + err
    got = FrameSequence.open(tmp_path / "out").read_frame(1, ["depth"])["depth"]
    np.testing.assert_array_equal(got, depth)


def test_a_display_window_is_no_larger_than_memory(tmp_path):
    images = {"Z": np.ones((2, 3), np.float32)}
    windowed(tmp_path / "a.exr", images, (0, 0), (1 << 14, 1 << 14))
    with pytest.raises(InputError, match="claims to be shown in 16384x16384"):
        read_any_exr(tmp_path / "a.exr")


def parts(path: Path, images: Mapping[str, Mapping[str, np.ndarray]], **header) -> None:
    """A file of parts by their names. header: name -> of each part."""
    OpenEXR.File([OpenEXR.Part({
        "compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage,
        **{name: values[k] for name, values in header.items() if values[k]}},
        {c: np.ascontiguousarray(image) for c, image in planes.items()}, part)
        for k, (part, planes) in enumerate(images.items())]).write(str(path))


def test_layers_may_be_the_names_of_parts(frames, tmp_path):
    folder = tmp_path / "b"
    folder.mkdir()
    frame = frames[0]
    parts(folder / "1.exr", {
        "L.Combined": named("", frame["color"], "RGB"), "L.Depth": named("", frame["depth"], "V"),
        "L.Normal": named("", frame["normal"], "XYZ"),
        "other": named("L.IndexOB", frame["id"], "X"),
        "L.Position": named("", frame["position"], "XYZ")})
    sequence = import_frames(folder, tmp_path / "out")
    got = sequence.read_frame(1, ["color", "normal", "depth"])
    for name in ("color", "normal"):
        np.testing.assert_allclose(got[name], frame[name], atol=1e-6)
    np.testing.assert_allclose(got["depth"], frame["depth"], rtol=1e-3, atol=1e-4)


def test_the_part_of_radiance_need_not_come_first():
    images = {f"{part}.{letter}": np.full((4, 4), float(k)) for k, part in enumerate(
        ("albedo", "beauty")) for letter in "RGB"}
    found = channel_map(images, "auto", {}).channels
    assert (found["color"][0], found["albedo"][0]) == ("beauty.R", "albedo.R")


def test_a_part_alone_gives_no_layer_its_name(tmp_path):
    parts(tmp_path / "a.exr", {"beauty": {"R": np.ones((2, 3), np.float32)}})
    assert list(read_any_exr(tmp_path / "a.exr")) == ["R"]


def test_of_a_stereo_image_one_view_is_taken(tmp_path):
    one, two = (np.full((2, 3), value, np.float32) for value in (1.0, 2.0))
    parts(tmp_path / "parts.exr", {"rgb.left": {"R": one}, "rgb.right": {"R": two},
                                   "z": {"Z": one}}, view=["left", "right", ""])
    parts(tmp_path / "names.exr", {"": {"R": one, "right.R": two, "d.right.R": two, "d.R": one}},
          multiView=[["left", "right"]])
    for name, channels in (("parts", {"rgb.R", "z.Z"}), ("names", {"R", "d.R"})):
        said: list[str] = []
        found = read_any_exr(tmp_path / f"{name}.exr", said.append)
        assert set(found) == channels
        assert all((image == 1).all() for image in found.values())
        assert set(said) == {"of the views only 'left' is taken"}


@pytest.mark.parametrize(("changed", "words"), [
    ("previous", "its direction turned round (--motion previous"),
    ("x", "its x turned over (both, the other --motion-y and the other --motion). Import it so"),
    ("exchanged", "x and y exchanged. Write it so into the files: no option does it")])
def test_of_readings_that_explain_as_much_one_with_an_option_is_named(tmp_path, changed, words,
                                                                      call):
    folder, (h, w) = tmp_path / "b", SIZE
    folder.mkdir()
    texture = np.random.default_rng(0).integers(0, 9, (h + 40, w + 40)) // 3
    step = (3, 0) if changed == "previous" else (5, 2)  # sideways alone: turned round is x over
    for k in range(3):
        here = [slice(20 - k * s, 20 - k * s + n) for s, n in zip(step[::-1], SIZE)]
        motion = -np.ones((h, w, 2)) * step
        motion = {"previous": -motion, "x": motion * (-1, 1), "exchanged": motion[..., ::-1]
                  }[changed]
        write(folder / f"{k}.exr", named("", np.ones((h, w, 3)), "RGB") | named(
            "m", motion, "UV") | named("i", texture[here[0], here[1]], "I") | {
                "z.Z": np.full(SIZE, 5, np.float32)})
    code, _, err = call("import", folder, "--out", tmp_path / "out", "--channel", "motion=m",
                        "--channel", "depth=z")
    assert code == 0, err
    code, out, err = call("check", tmp_path / "out")
    assert code == 0, err
    assert words in out, out


def test_what_the_assignments_layout_would_ignore_is_refused(tmp_path):
    (tmp_path / "matrix_0.mat").write_bytes(b"")
    for options in ({"fov": 40.0}, {"reference": tmp_path}, {"motion_up": True}):
        with pytest.raises(InputError, match="in the assignment's layout"):
            import_frames(tmp_path, tmp_path / "out", **options)


def test_a_camera_is_not_made_up():
    y, x = np.indices(SIZE) + 0.5
    plane = np.stack([x, y, 0 * x], -1)  # fits more cameras than one
    assert camera_of_positions(plane, np.ones(SIZE, bool)) is None
    noise = np.random.default_rng(0).random((*SIZE, 3))
    assert camera_of_positions(noise, np.ones(SIZE, bool)) is None


@pytest.mark.parametrize(("images", "given", "words"), [
    ({"A": 0}, {}, "no radiance"), ({"R": 0, "G": 0, "B": 0}, {"normal": "N"}, "channels of 'N'"),
    ({"R": 0}, {"colour": "R"}, "names no channel"),
    ({"a.Combined.R": 0, "b.Combined.R": 0}, {}, "view layers a, b"),
    ({"R": 0, "G": 0, "B": 0, "p.R": 1, "p.G": 1, "p.B": 1, "q.R": 1, "q.G": 1, "q.B": 1}, {},
     "may be the albedo, 'p' and 'q': .*or none"),
    ({"R": 0, "G": 0, "B": 0, "p.X": 1, "p.Y": 1, "p.Z": 1, "q.X": 1, "q.Y": 1, "q.Z": 1}, {},
     "may be the position")])
def test_what_cannot_be_told_is_asked(images, given, words):
    images = {name: np.full((4, 4), float(value)) for name, value in images.items()}
    with pytest.raises(InputError, match=words):
        channel_map(images, "auto", given)
    with pytest.raises(InputError, match="NAME=SOURCE"):
        parse_settings(["normal"], "--channel", form="NAME=SOURCE")


@pytest.mark.parametrize("kind", [blender, mitsuba])
def test_a_chunk_that_says_it_is_another_is_noticed_before_it_is_decoded(frames, tmp_path, kind):
    path = next(kind(tmp_path / "x", frames[:1]).iterdir())
    data = bytearray(path.read_bytes())
    _, table = _attributes(bytes(data), 8)
    if kind is blender:  # several headers, and an empty one
        while data[table] != 0:
            _, table = _attributes(bytes(data), table)
        table += 1
    first, = struct.unpack_from("<Q", data, table)
    data[first] ^= 1
    path.write_bytes(data)
    with pytest.raises(InputError, match="is truncated or damaged"):
        read_any_exr(path)


def test_files_of_other_programs_that_are_cut_or_damaged_are_one_sentence(frames, tmp_path):
    for folder in (blender(tmp_path / "b", frames[:1]), mitsuba(tmp_path / "m", frames[:1])):
        path = next(folder.iterdir())
        data, rng = path.read_bytes(), np.random.default_rng(1)
        read_any_exr(path)
        for cut in rng.integers(0, len(data), 20):
            path.write_bytes(data[:cut])
            with pytest.raises(InputError, match=str(path)):
                read_any_exr(path)
        for at in rng.integers(0, len(data), 40):
            path.write_bytes(data[:at] + bytes([data[at] ^ 255]) + data[at + 1:])
            with suppress(InputError):  # pixels may be others; nothing else may be raised
                read_any_exr(path)
