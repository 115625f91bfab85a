"""The assignment's layout, both ways: on its real frames, and on our own."""

from __future__ import annotations

import shutil
import struct
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onespp.render.errors import InputError
from onespp.render.files.exr import read_exr, write_exr
from onespp.render.files.sequence import FrameSequence
from onespp.render.frame import Frame
from onespp.render.games202.convert import (
    export_games202,
    export_results,
    import_games202,
    import_result,
    read_mat,
    write_mat,
)
from tests.support.small_sequence import HEIGHT, OBJECTS, WIDTH, small_frame, small_sequence

take = partial(import_games202, check=False)  # frames of random numbers keep to no convention

IMAGES = {"beauty": "RGB", "normal": "RGB", "position": "RGB", "depth": "Y", "ID": "Y"}


def assert_same_layout(a: Path, b: Path, frames: int) -> None:
    """Both folders hold the same pixels and matrices, bit for bit, and equally named channels."""
    for i in range(frames):
        for stem, names in IMAGES.items():
            first, _ = read_exr(a / f"{stem}_{i}.exr")
            second, _ = read_exr(b / f"{stem}_{i}.exr")
            assert set(first) == set(second) == set(names)
            for name in names:
                assert first[name].dtype == second[name].dtype == np.float32
                assert first[name].tobytes() == second[name].tobytes(), (stem, i, name)
        assert (a / f"matrix_{i}.mat").read_bytes() == (b / f"matrix_{i}.mat").read_bytes()


def projected(frame: Frame) -> np.ndarray:
    """Positions by screen_from_world, (h, w, 4) float64, not yet divided."""
    position = np.concatenate([frame["position"], np.ones_like(frame["depth"])[..., None]], -1)
    return position.astype(np.float64) @ frame.screen_from_world.T


def test_an_export_that_fails_leaves_nothing(tmp_path):
    """Missing: said before anything is written. Damaged: found by decoding, halfway."""
    sequence = small_sequence(tmp_path / "a")
    path = sequence.folder / "frames/0001.exr"
    data = path.read_bytes()
    path.unlink()
    with pytest.raises(InputError, match="lacks frame 1: render all frames first"):
        export_games202(sequence, tmp_path / "new/out")
    assert not (tmp_path / "new").exists()
    path.write_bytes(data[:-40] + bytes(40))
    (tmp_path / "out").mkdir()
    (tmp_path / "out/mine.txt").write_text("kept")
    with pytest.raises(InputError, match=r"0001\.exr is damaged"):
        export_games202(sequence, tmp_path / "out")
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["mine.txt"]


def test_an_import_that_fails_halfway_leaves_nothing(tmp_path):
    export_games202(small_sequence(tmp_path / "a"), tmp_path / "given")
    path = tmp_path / "given/position_1.exr"
    write_exr(path, dict.fromkeys("RGB", np.zeros((HEIGHT, WIDTH), np.float32)))
    data = path.read_bytes()
    path.write_bytes(data[:-12] + bytes(12))
    with pytest.raises(InputError, match=r"position_1\.exr is damaged"):
        take(tmp_path / "given", tmp_path / "b")
    assert not (tmp_path / "b").exists()
    path.write_bytes(data)
    assert take(tmp_path / "given", tmp_path / "b").has_frame(1)


def test_the_real_frames_survive_import_and_export_bit_for_bit(games202, tmp_path):
    sequence = import_games202(games202 / "input", tmp_path / "s")
    assert sequence.frames == [0, 1, 2, 3]
    assert sequence.manifest.source == "games202"
    assert sequence.size == (512, 512)
    assert len(sequence.manifest.objects) == 7
    export_games202(FrameSequence.open(tmp_path / "s"), tmp_path / "out")
    assert_same_layout(games202 / "input", tmp_path / "out", 4)


def test_on_real_frames_the_screen_is_where_we_say_it_is(games202, tmp_path):
    sequence = import_games202(games202 / "input", tmp_path / "s")
    for i in sequence.frames:
        frame = sequence.read_frame(i)
        seen = frame["id"] >= 0
        screen = projected(frame)
        rows, columns = np.mgrid[:512, :512]
        np.testing.assert_array_equal(screen[..., 3][seen], frame["depth"][seen])
        centre = np.stack([columns, rows], -1)[seen] + 0.5
        assert np.abs(screen[seen][:, :2] / screen[seen][:, 3:] - centre).max() < 3e-5
        camera = np.linalg.inv(frame.camera_from_world)[:3, 3]
        np.testing.assert_allclose(frame["position"][~seen], np.broadcast_to(
            camera, (int((~seen).sum()), 3)), atol=1e-6)


def exported(tmp_path: Path) -> tuple[FrameSequence, Path]:
    sequence = small_sequence(tmp_path / "ours", (3, 7))
    export_games202(sequence, tmp_path / "layout")
    return sequence, tmp_path / "layout"


def test_our_frames_export_in_the_layout_and_import_again(tmp_path):
    sequence, layout = exported(tmp_path)
    assert {path.name for path in layout.iterdir()} == {
        f"{stem}_{k}.{'mat' if stem == 'matrix' else 'exr'}"
        for stem in (*IMAGES, "matrix") for k in (0, 1)}
    back = take(layout, tmp_path / "back", scene="again")
    assert back.frames == [0, 1]
    assert back.manifest.scene == "again"
    for k, i in enumerate(sequence.frames):
        ours, theirs = sequence.read_frame(i), back.read_frame(k)
        for name in ("color", "normal", "depth", "id"):
            np.testing.assert_array_equal(theirs[name], ours[name])
        for name in ("camera_from_world", "screen_from_world", "world_from_object"):
            np.testing.assert_array_equal(getattr(theirs, name),
                                          getattr(ours, name).astype(np.float32))
        background = ours["id"] < 0
        np.testing.assert_array_equal(theirs["position"][~background],
                                      ours["position"][~background])
        camera = np.linalg.inv(ours.camera_from_world)[:3, 3].astype(np.float32)
        assert (theirs["position"][background] == camera).all()
    export_games202(back, tmp_path / "twice")
    assert_same_layout(layout, tmp_path / "twice", 2)


def test_the_matrix_file_has_the_assignments_bytes(tmp_path):
    matrices = np.arange(3 * 16, dtype=np.float64).reshape(3, 4, 4)
    write_mat(tmp_path / "m.mat", matrices)
    data = (tmp_path / "m.mat").read_bytes()
    assert data == struct.pack("<i48f", 1, *range(48))  # row-major: 0 1 2 3 is the first row
    np.testing.assert_array_equal(read_mat(tmp_path / "m.mat"), matrices)


def test_results_of_another_program_become_a_method(tmp_path):
    sequence, _ = exported(tmp_path)
    image = small_frame(0)["color"].astype(np.float16)
    write_exr(tmp_path / "result_1.exr", dict(zip("BGR", np.moveaxis(image, 2, 0)[::-1])))
    assert import_result(sequence, tmp_path, "cpp") == [7]
    assert sequence.methods() == ["cpp"]
    np.testing.assert_array_equal(sequence.read_result("cpp", 7), image.astype(np.float32))
    assert not sequence.has_result("cpp", 3)
    assert sequence.read_run("cpp").ms == {}
    written = export_results(sequence, "cpp", tmp_path / "results")
    assert [path.name for path in written] == ["result_1.exr"]
    back, _ = read_exr(written[0])
    assert back["G"].dtype == np.float16
    np.testing.assert_array_equal(back["G"], image[..., 1])


def test_results_are_taken_in_the_order_of_their_numbers(tmp_path):
    sequence = small_sequence(tmp_path / "ours", tuple(range(5, 16)))
    for k in (0, 2, 10):
        write_exr(tmp_path / f"result_{k}.exr", dict.fromkeys("RGB", IMAGE + k))
    assert import_result(sequence, tmp_path, "cpp") == [5, 7, 15]
    assert (sequence.read_result("cpp", 15) == 10).all()


def test_results_beyond_half_are_clipped_on_export(tmp_path):
    sequence, _ = exported(tmp_path)
    sequence.write_result("m", 3, np.full((HEIGHT, WIDTH, 3), 1e9, np.float32))
    path, = export_results(sequence, "m", tmp_path / "results")
    assert (read_exr(path)[0]["R"] == 65504).all()


def test_an_import_of_one_pixel_keeps_its_shape(tmp_path):
    one = np.ones((1, 1), np.float32)
    for stem, names in IMAGES.items():
        write_exr(tmp_path / f"{stem}_0.exr", dict.fromkeys(names, one * 0))
    write_mat(tmp_path / "matrix_0.mat", np.tile(np.eye(4), (3, 1, 1)))
    frame = import_games202(tmp_path, tmp_path / "s").read_frame(0)
    assert frame["color"].shape == (1, 1, 3)
    assert frame["id"].shape == (1, 1)


def test_importing_again_continues_but_not_with_changed_files(tmp_path):
    _, layout = exported(tmp_path)
    take(layout, tmp_path / "s", scene="a")
    (tmp_path / "s/frames/0001.exr").unlink()
    assert take(layout, tmp_path / "s", scene="a").has_frame(1)
    shutil.copy(layout / "beauty_0.exr", layout / "beauty_1.exr")
    with pytest.raises(InputError, match="another content"):
        take(layout, tmp_path / "s", scene="a")
    take(layout, tmp_path / "s", scene="a", overwrite=True)


def test_the_order_of_the_files_in_the_folder_does_not_matter(tmp_path):
    sequence = small_sequence(tmp_path / "ours", tuple(range(11)))
    export_games202(sequence, tmp_path / "layout")
    back = take(tmp_path / "layout", tmp_path / "s")
    assert back.frames == list(range(11))  # not 0, 1, 10, 2
    np.testing.assert_array_equal(back.read_frame(10)["depth"], sequence.read_frame(10)["depth"])


def replace(stem: str, planes: dict[str, np.ndarray]):
    return lambda folder: write_exr(folder / f"{stem}_1.exr", planes)


def mat(edit) -> object:
    def spoil(folder: Path) -> None:
        path = folder / "matrix_1.mat"
        path.write_bytes(edit(path.read_bytes()))
    return spoil


IMAGE = np.zeros((HEIGHT, WIDTH), np.float32)
SPOILED = [
    (lambda f: (f / "depth_1.exr").unlink(), "depth_1.exr does not exist"),
    (lambda f: (f / "matrix_1.mat").unlink(), "matrix_1.mat does not exist"),
    (lambda f: (f / "beauty_1.exr").unlink(), "beauty_1.exr does not exist"),
    (lambda f: (f / "beauty_1.exr").write_bytes(b""), "beauty_1.exr is empty"),
    (lambda f: (f / "normal_1.exr").write_text("P3 1 1 255"), "is not an OpenEXR file"),
    (replace("depth", {"Y": IMAGE[1:]}), "is 9x20 pixels"),
    (replace("depth", {"Z": IMAGE}), "lacks the channel Y"),
    (replace("ID", {"Y": IMAGE + 0.5}), "object IDs other than"),
    (replace("ID", {"Y": IMAGE + len(OBJECTS)}), "object IDs other than"),
    (replace("ID", {"Y": IMAGE - 2}), "object IDs other than"),
    (replace("ID", {"Y": IMAGE * np.nan}), "object IDs other than"),
    (mat(lambda b: b[:-1]), "is 323 bytes long, but 3 objects take 324"),
    (mat(lambda b: b + b"\0"), "is 325 bytes long"),
    (mat(lambda b: b[:3]), "too short"),
    (mat(lambda b: b""), "too short"),
    (mat(lambda b: struct.pack("<i", -5) + b[4:]), "matrices of -5 objects"),
    (mat(lambda b: struct.pack("<i", 2**31 - 1) + b[4:]), "matrices of 2147483647 objects"),
    (mat(lambda b: struct.pack("<i", 0) + b[4:132]), "matrices of 0 objects"),
    (mat(lambda b: struct.pack("<i", 2) + b[68:]), "of 2 objects, the first frame's of 3"),
    (mat(lambda b: b[:4] + struct.pack("<f", float("nan")) + b[8:]), "not finite"),
]


@pytest.mark.parametrize(("spoil", "words"), SPOILED, ids=[words for _, words in SPOILED])
def test_a_spoiled_import_names_the_file_and_the_fault(tmp_path, spoil, words):
    _, layout = exported(tmp_path)
    spoil(layout)
    with pytest.raises(InputError) as error:
        take(layout, tmp_path / "s")
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("act", "words"), [
    (lambda s, f: take(f / "nowhere", f / "s"), "is not a folder"),
    (lambda s, f: take(f, f / "s"), "has no beauty_0.exr"),
    (lambda s, f: take(f / "layout", f / "s", fps=0), "invalid 'fps'"),
    (lambda s, f: import_result(s, f, "m"), "has no result_0.exr"),
    (lambda s, f: import_result(s, f, "../m"), "not a name for a method"),
    (lambda s, f: export_results(s, "m", f / "r"), "has no results of the method 'm'"),
    (lambda s, f: export_games202(
        small_sequence(f / "short", (0,)), f / "layout"), "longer sequence"),
])
def test_requests_that_cannot_be_met_end_in_one_sentence(tmp_path, act, words):
    sequence, _ = exported(tmp_path)
    with pytest.raises(InputError) as error:
        act(sequence, tmp_path)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_result_without_a_frame_or_of_another_size_is_refused(tmp_path):
    sequence, _ = exported(tmp_path)
    write_exr(tmp_path / "result_2.exr", dict.fromkeys("RGB", IMAGE))
    with pytest.raises(InputError, match="results end at 1"):
        import_result(sequence, tmp_path, "m")
    (tmp_path / "result_2.exr").unlink()
    write_exr(tmp_path / "result_0.exr", dict.fromkeys("RGB", IMAGE[1:]))
    with pytest.raises(InputError, match="expected 9x21"):
        import_result(sequence, tmp_path, "m")
    assert sequence.methods() == []


@given(st.one_of(st.binary(max_size=400), st.builds(
    lambda n, body: struct.pack("<i", n) + body, st.integers(-2, 5),
    st.binary(min_size=128, max_size=448))))
@settings(max_examples=200, deadline=None)
def test_any_bytes_are_matrices_or_an_input_error(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "fuzz.mat"
    path.write_bytes(data)
    try:
        matrices = read_mat(path)
    except InputError:
        count = struct.unpack("<i", data[:4])[0] if len(data) >= 4 else -1
        floats = np.frombuffer(data[4:len(data) // 4 * 4], "<f4")
        assert (count < 1 or len(data) != 4 + 64 * (count + 2) or not np.isfinite(floats).all())
    else:
        assert len(data) == 4 + 64 * len(matrices)
        assert np.isfinite(matrices).all()
