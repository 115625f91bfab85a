"""Files that lie, break off or cannot be written: one sentence, and nothing is lost."""

from __future__ import annotations

import errno
import json
import os
import struct
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from onespp.render.channels import SUN
from onespp.render.errors import InputError
from onespp.render.files import atomic
from onespp.render.files.exr import read_exr, write_exr
from onespp.render.files.sequence import FrameSequence, Reference
from tests.support.places import ROOT
from tests.support.small_sequence import (
    HEIGHT,
    WIDTH,
    contents,
    small_frame,
    small_manifest,
    small_sequence,
)

fuzz = settings(max_examples=150,
                suppress_health_check=[HealthCheck.function_scoped_fixture])


def sentence(act, *arguments) -> str:
    """The message of the InputError that a call ends in; one line, one sentence."""
    with pytest.raises(InputError) as error:
        act(*arguments)
    text = str(error.value)
    assert text.isprintable()
    assert len(text) < 500 + text.count("/") * 100
    return text


def outcome(act, *arguments):
    """What a call returns, or the message of its InputError."""
    try:
        return act(*arguments)
    except InputError as error:
        return str(error)


@pytest.fixture
def exr(tmp_path) -> Path:
    rng = np.random.default_rng(0)
    write_exr(tmp_path / "a.exr", {name: rng.normal(size=(64, 40)).astype(np.float32)
                                   for name in ("R", "G", "B")}, {"scene": "box"})
    return tmp_path / "a.exr"


# Images


def test_an_image_cut_off_anywhere_is_noticed_before_the_library_complains(exr, capfd):
    data = exr.read_bytes()
    assert len(data) > 20_000
    for end in [*range(0, 500, 7), *range(500, len(data), 1000), len(data) - 1]:
        exr.write_bytes(data[:end])
        assert "a.exr" in sentence(read_exr, exr)
    assert capfd.readouterr().err == ""


def test_damage_inside_a_chunk_is_one_sentence_and_prints_nothing_into_our_output(tmp_path, capsys):
    """The library tells of it by `print`, which would land in the middle of a table."""
    path = tmp_path / "a.exr"
    write_exr(path, {"Z": np.add.outer(np.arange(64), np.arange(40)).astype(np.float32)})
    data = bytearray(path.read_bytes())
    data[-60:-40] = bytes(20)
    path.write_bytes(data)
    stdout = sys.stdout
    assert "a.exr is damaged and cannot be decoded" in sentence(read_exr, path)
    assert sys.stdout is stdout
    assert capsys.readouterr().out == ""


def test_an_image_for_which_there_is_no_memory_is_not_called_damaged(tmp_path):
    if not Path("/proc/self/statm").exists():
        pytest.skip("the memory of a process can be limited on Linux alone")
    path, size = tmp_path / "a.exr", 6000
    write_exr(path, {"Z": np.zeros((size, size), np.float32)})
    code = ("import resource, sys, pathlib; "
            "from onespp.render.files.exr import read_exr, _threads; _threads(); "
            "used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize(); "
            f"resource.setrlimit(resource.RLIMIT_AS, (used + {2 * size * size},) * 2); "
            "read_exr(pathlib.Path(sys.argv[1]))")
    run = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True,
                         cwd=ROOT)
    assert run.stderr.splitlines()[-1].startswith("MemoryError"), run.stderr


def test_a_channel_of_an_unknown_type_is_named(exr):
    data = exr.read_bytes()
    assert data.count(b"G\0\2\0\0\0") == 1
    exr.write_bytes(data.replace(b"G\0\2\0\0\0", b"\n\0\7\0\0\0"))
    assert r"channel '\n' of an unknown type" in sentence(read_exr, exr)


def test_what_a_header_lists_twice_is_named(exr):
    data = exr.read_bytes()
    exr.write_bytes(data.replace(b"G\0\2\0\0\0", b"R\0\2\0\0\0"))
    assert "has two channels 'R'" in sentence(read_exr, exr)
    at = data.index(b"dataWindow\0")
    window = data[at:at + len(b"dataWindow\0box2i\0") + 20]
    exr.write_bytes(data[:at] + window + data[at:])
    assert "has two 'dataWindow'" in sentence(read_exr, exr)


def test_an_image_of_the_other_byte_order_is_no_exr(exr):
    data = exr.read_bytes()
    exr.write_bytes(data[3::-1] + data[7:3:-1] + data[8:])
    assert "is not an OpenEXR file" in sentence(read_exr, exr)


def test_more_channels_than_were_asked_for_do_no_harm(tmp_path):
    sequence = small_sequence(tmp_path)
    path = tmp_path / "frames/0000.exr"
    planes = dict(read_exr(path)[0])
    before = sequence.read_frame(0)["color"]
    write_exr(path, planes | {"extra.\u00fc": planes["Z"], "..": planes["Z"]})
    assert (sequence.read_frame(0)["color"] == before).all()


def test_an_image_that_was_not_finished_is_noticed(exr):
    """A writer that died leaves a chunk table of zeros."""
    data = exr.read_bytes()
    chunks = 4  # 64 rows in blocks of 16; the table's first entry points behind the table
    start = next(at for at in range(300, 600)
                 if struct.unpack_from("<Q", data, at)[0] == at + 8 * chunks)
    exr.write_bytes(data[:start] + bytes(8 * chunks) + data[start + 8 * chunks:])
    assert "incomplete" in sentence(read_exr, exr)


@pytest.mark.parametrize(("width", "height"), [(10**6, 10**6), (60_000, 60_000), (0, 5), (-3, 5),
                                               (2**31 - 1, 1)])
def test_a_header_that_lies_about_its_size_allocates_nothing(exr, width, height):
    data = exr.read_bytes()
    true_window = struct.pack("<4i", 0, 0, 39, 63)
    assert data.count(true_window) == 2
    exr.write_bytes(data.replace(true_window, struct.pack("<4i", 0, 0, width - 1, height - 1)))
    code = ("import resource, sys, pathlib; from onespp.render.files.exr import read_exr; "
            "resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30)); "
            "read_exr(pathlib.Path(sys.argv[1]))")
    run = subprocess.run([sys.executable, "-c", code, str(exr)], capture_output=True, text=True)
    assert f"claims to be {width}x{height} pixels" in run.stderr.splitlines()[-1]
    assert f"claims to be {width}x{height}" in sentence(read_exr, exr)


def part(**header) -> OpenEXR.Part:
    return OpenEXR.Part({"type": OpenEXR.scanlineimage, **header},
                        {"Z": np.zeros((8, 8), np.float32)}, header.get("name", "a"))


def test_kinds_of_exr_that_are_not_read_are_named(tmp_path):
    path = tmp_path / "a.exr"
    OpenEXR.File([part(), part(name="b")]).write(str(path))
    assert "multi-part" in sentence(read_exr, path)
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = 4
    OpenEXR.File({"type": OpenEXR.tiledimage, "tiles": tiles},
                 {"Z": np.zeros((8, 8), np.float32)}).write(str(path))
    assert "tiled" in sentence(read_exr, path)
    OpenEXR.File({"type": OpenEXR.scanlineimage, "compression": OpenEXR.DWAA_COMPRESSION},
                 {"Z": np.zeros((8, 8), np.float32)}).write(str(path))
    assert "ZIP compression" in sentence(read_exr, path)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Z": OpenEXR.Channel(
        "Z", np.zeros((4, 4), np.float32), 2, 2)}).write(str(path))
    assert "subsampled" in sentence(read_exr, path)


@pytest.mark.parametrize("data", [b"", b"\x76\x2f\x31", b"PNG\r\n", b"solid text\n" * 100,
                                  b"\x76\x2f\x31\x01", b"\x76\x2f\x31\x01\x02\0\0\0",
                                  b"\x76\x2f\x31\x01\x02\0\0\0" + b"a" * 5000])
def test_what_is_no_exr_is_not_read(tmp_path, data):
    (tmp_path / "a.exr").write_bytes(data)
    assert "a.exr is" in sentence(read_exr, tmp_path / "a.exr")


def test_a_folder_or_nothing_in_place_of_an_image(tmp_path):
    assert "does not exist" in sentence(read_exr, tmp_path / "none.exr")
    (tmp_path / "a.exr").mkdir()
    assert "cannot be read" in sentence(read_exr, tmp_path / "a.exr")


def test_missing_channels_are_named_with_what_there_is(exr):
    text = sentence(read_exr, exr, ["R", "Z", "N.X"])
    assert "lacks the channel Z, N.X (it has 'B', 'G', 'R')" in text


@given(st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=6),
       st.booleans())
@fuzz
def test_changed_bytes_give_an_image_or_one_sentence(tmp_path_factory, changes, in_header):
    path = tmp_path_factory.getbasetemp() / "fuzz.exr"
    image = (np.arange(40 * 24, dtype=np.float32) % 17).reshape(40, 24)
    write_exr(path, {"R": image, "Z": image.astype(np.float16)}, {"scene": "box"})
    data = bytearray(path.read_bytes())
    for place, value in changes:
        data[place % (400 if in_header else len(data))] = value
    path.write_bytes(data)
    result = outcome(read_exr, path)
    if isinstance(result, str):
        assert result.isprintable()
    else:
        images, header = result
        assert all(i.shape == (header.height, header.width) for i in images.values())


# Manifests, matrices and partial references


def spoil_manifest(folder: Path, **changes) -> None:
    data = json.loads((folder / "manifest.json").read_text())
    data.update(changes)
    (folder / "manifest.json").write_text(json.dumps(data))


@pytest.mark.parametrize(("changes", "words"), [
    ({"format": 2}, "invalid 'format'"),
    ({"width": 0}, "invalid 'width'"),
    ({"width": "9"}, "invalid 'width'"),
    ({"height": 10**9}, "invalid 'height'"),
    ({"height": 2.5}, "invalid 'height'"),
    ({"seed": True}, "invalid 'seed'"),
    ({"fps": float("nan")}, "invalid 'fps'"),
    ({"fps": 0}, "invalid 'fps'"),
    ({"frames": "0:999999999"}, "invalid 'frames'"),
    ({"frames": "../../etc"}, "invalid 'frames'"),
    ({"frames": 5}, "invalid 'frames'"),
    ({"frames": None}, "invalid 'frames'"),
    ({"frames": ["../0"]}, "invalid 'frames'"),
    ({"frames": {"0": 1}}, "invalid 'frames'"),
    ({"channels": []}, "invalid 'channels'"),
    ({"channels": ["color", "colour\n"]}, "is not a channel"),
    ({"channels": ["color", "color"]}, "is listed twice"),
    ({"objects": []}, "invalid 'objects'"),
    ({"objects": ["a", "a"]}, "is listed twice"),
    ({"objects": ["a\nb"]}, "invalid 'objects.0'"),
    ({"scene": 3}, "invalid 'scene'"),
    ({"reference_spp": -1}, "invalid 'reference_spp'"),
    ({"source": "elsewhere"}, "invalid 'source'"),
    ({"versions": {"a": 1}}, "invalid 'versions.a'"),
    ({"extra\nkey": 1}, "unknown key 'extra?key'"),
])
def test_a_manifest_with_a_wrong_value_names_the_key(tmp_path, changes, words):
    small_sequence(tmp_path)
    spoil_manifest(tmp_path, **changes)
    assert words in sentence(FrameSequence.open, tmp_path)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "5", "{}", "[" * 100_000, "\0", "{'a': 1}",
                                  '{"format": 1' + "0" * 5000 + "}", '"' + "a" * 5000 + '"'])
def test_a_manifest_that_is_none_is_refused(tmp_path, text):
    small_sequence(tmp_path)
    (tmp_path / "manifest.json").write_text(text)
    assert "manifest.json" in sentence(FrameSequence.open, tmp_path)


def test_a_manifest_that_is_not_text_is_refused(tmp_path):
    small_sequence(tmp_path)
    (tmp_path / "manifest.json").write_bytes(b"\xff\xfe\x80")
    assert "not valid JSON" in sentence(FrameSequence.open, tmp_path)


@pytest.mark.parametrize(("changes", "words"), [
    ({"width": WIDTH + 1}, f"is {WIDTH}x{HEIGHT} pixels, expected {WIDTH + 1}x{HEIGHT}"),
    ({"objects": ["ball"]}, "disagrees with the manifest about the object"),
    ({"objects": ["b", "a", "c"]}, "disagrees with the manifest about the object 'b'"),
    ({"channels": ["color", "variance"]}, "lacks the channel variance.R"),
])
def test_a_manifest_that_disagrees_with_its_frames_is_noticed(tmp_path, changes, words):
    small_sequence(tmp_path)
    spoil_manifest(tmp_path, **changes)
    assert words in sentence(FrameSequence.open(tmp_path).read_frame, 0)


def test_a_frame_of_the_manifest_that_is_not_there_is_named(tmp_path):
    small_sequence(tmp_path)
    spoil_manifest(tmp_path, frames="0:5")
    assert "0004.json does not exist" in sentence(FrameSequence.open(tmp_path).read_frame, 4)
    (tmp_path / "frames/0000.exr").unlink()
    assert "0000.exr does not exist" in sentence(FrameSequence.open(tmp_path).read_frame, 0)


def test_frames_that_were_mixed_up_are_noticed(tmp_path):
    sequence = small_sequence(tmp_path)
    os.replace(tmp_path / "frames/0001.json", tmp_path / "frames/0000.json")
    assert "holds frame 1, expected 0" in sentence(sequence.read_frame, 0)


@pytest.mark.parametrize(("old", "new", "words"), [
    ('"id": 0', '"id": 1', "disagrees with the manifest about the object 'ball'"),
    ('"id": 0', '"id": -1', "disagrees"),
    ('"id": 0', '"id": 0.5', "invalid 'objects.ball.id'"),
    ('"ball"', '"bull"', "disagrees"),
    ('"camera_from_world"', '"camera"', "lacks the key 'camera_from_world'"),
    ('"camera_from_world": [\n', '"camera_from_world": [[1, 0, 0, 0],\n',
     "invalid 'camera_from_world'"),
    ('"camera_from_world": [\n    [', '"camera_from_world": [\n    [NaN, ',
     "invalid 'camera_from_world.0'"),
    ('"frame": 0', '"frame": "0"', "invalid 'frame'"),
    ("]]", "]", "not valid JSON"),
    ("}\n}", "}", "not valid JSON"),
])
def test_spoiled_matrices_are_noticed(tmp_path, old, new, words):
    sequence = small_sequence(tmp_path)
    path = tmp_path / "frames/0000.json"
    text = path.read_text("utf-8")
    changed = text.replace(old, new, 1) if old in text else text[:-3]
    assert changed != text
    path.write_text(changed, "utf-8")
    assert words in sentence(sequence.read_frame, 0)


@given(st.integers(0, 10**6), st.binary(max_size=6), st.integers(0, 40))
@fuzz
def test_changed_json_is_read_or_ends_in_one_sentence(tmp_path_factory, place, new, removed):
    folder = tmp_path_factory.getbasetemp() / "fuzz_json"
    sequence = small_sequence(folder, (0,))
    for path in (folder / "manifest.json", folder / "frames/0000.json"):
        data = path.read_bytes()
        at = place % len(data)
        path.write_bytes(data[:at] + new + data[at + removed:])
        for result in (outcome(FrameSequence.open, folder), outcome(sequence.read_matrices, 0)):
            assert not isinstance(result, str) or result.isprintable()
        path.write_bytes(data)


def test_ids_that_point_at_no_object_are_not_read(tmp_path):
    """Kernels gather by ID without a check."""
    sequence = small_sequence(tmp_path)
    path = tmp_path / "frames/0000.exr"
    good, _ = read_exr(path)
    for (plane, least), value in product({"ID": -1, "light.ID": SUN}.items(),
                                         (3, -3, 0.5, np.nan, 1e30)):
        planes = {name: np.array(image) for name, image in good.items()}
        planes[plane][4, 4] = value
        write_exr(path, planes)
        assert (f"object IDs other than the whole numbers {least} to 2"
                in sentence(sequence.read_frame, 0))


def test_a_reference_that_does_not_say_its_samples_is_refused(tmp_path):
    sequence, frame = small_sequence(tmp_path), small_frame(0)
    planes = dict(zip("RGB", np.moveaxis(frame["color"], 2, 0)))
    planes |= {f"variance.{c}": planes[c] for c in "RGB"}
    for header in ({}, {"spp": "0"}, {"spp": "many"}, {"spp": "-3"}):
        write_exr(tmp_path / "reference/0000.exr", planes, header)
        assert "samples a pixel" in sentence(sequence.read_reference, 0)


def test_a_reference_that_lacks_a_part_is_refused(tmp_path):
    sequence = small_sequence(tmp_path)
    parts = np.random.default_rng(0).random((4, *sequence.size, 3), np.float32)
    sequence.write_reference(0, Reference.of_parts(parts, 64))
    path = tmp_path / "reference/0000.exr"
    planes = {name: np.array(image) for name, image in read_exr(path)[0].items()}
    for missing in ("half.R", "quarter0.G", "quarter1.B", "R"):
        write_exr(path, {n: p for n, p in planes.items() if n != missing}, {"spp": "64"})
        assert f"lacks the channel {missing}" in sentence(sequence.read_reference, 0)


def test_a_damaged_partial_reference_is_named(tmp_path):
    sequence = small_sequence(tmp_path)
    sequence.write_partial(0, {"total": np.zeros((5, 5)), "passes": 3})
    path = tmp_path / "reference/0000.partial.npz"
    data = path.read_bytes()
    for spoiled in (b"", b"text", data[:len(data) // 2], data[:100] + b"!" * 50 + data[150:]):
        path.write_bytes(spoiled)
        assert "delete it" in sentence(sequence.read_partial, 0)
    np.savez_compressed(path, total=np.zeros((5, 5)))  # a few bytes might hold gigabytes
    assert "delete it" in sentence(sequence.read_partial, 0)
    np.savez(path, total=np.array([{}], dtype=object))  # would run code if it were unpickled
    assert "delete it" in sentence(sequence.read_partial, 0)


# Disks that refuse, and interrupts


def fill_disk(monkeypatch, after: int) -> None:
    """The next file breaks off after some bytes, as on a full disk."""
    def write(path: Path, data: bytes) -> None:
        with path.open("wb") as file:
            file.write(data[:after])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", write)


@pytest.mark.parametrize("after", [0, 1000])
def test_a_full_disk_ends_in_one_sentence_and_loses_nothing(tmp_path, monkeypatch, after):
    sequence = small_sequence(tmp_path)
    before = contents(tmp_path)
    fill_disk(monkeypatch, after)
    assert "disk is full" in sentence(sequence.write_frame, small_frame(0, seed=1))
    assert "disk is full" in sentence(sequence.write_result, "m", 0, small_frame()["color"])
    assert "disk is full" in sentence(
        FrameSequence.create, tmp_path, small_manifest(frames=(0, 1, 2, 3)))
    monkeypatch.undo()
    assert contents(tmp_path) == before


@pytest.mark.skipif(sys.platform == "win32", reason="the limit on file size is POSIX")
def test_a_real_limit_on_file_size_is_a_full_disk_too(tmp_path):
    sequence = small_sequence(tmp_path)
    before = contents(tmp_path)
    code = ("import resource, signal, sys; import numpy as np; "
            "from onespp.render.files.sequence import FrameSequence; "
            "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
            "resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000)); "
            "from tests.support.small_sequence import small_frame; "
            "FrameSequence.open(sys.argv[1]).write_result('m', 0, small_frame()['color'])")
    run = subprocess.run([sys.executable, "-c", code, str(sequence.folder)], capture_output=True,
                         text=True, cwd=ROOT)
    assert "InputError" in run.stderr
    assert "disk is full" in run.stderr
    assert contents(tmp_path) == before


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_an_interrupted_write_leaves_the_old_file_and_no_other(tmp_path, monkeypatch, error):
    sequence = small_sequence(tmp_path)
    before = contents(tmp_path)

    def interrupt(source, target):
        assert Path(source).stat().st_size > 0
        raise error

    monkeypatch.setattr(atomic.os, "replace", interrupt)
    with pytest.raises(error):
        sequence.write_frame(small_frame(0, seed=1))
    monkeypatch.undo()
    assert contents(tmp_path) == before


def test_a_killed_writer_leaves_nothing_that_counts(tmp_path):
    sequence = small_sequence(tmp_path, (0,))
    left = atomic.temporary_name(tmp_path / "frames/0001.exr")
    left.write_bytes(b"half")
    assert atomic.is_temporary(left)
    assert left.suffix == ".exr"  # programs that go by the name can write to it
    grown = FrameSequence.create(tmp_path, small_manifest(frames=(0, 1)))
    assert not grown.has_frame(1)
    assert sequence.has_frame(0)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0,
                    reason="root may write anywhere")
def test_a_folder_without_permission_is_named(tmp_path):
    sequence = small_sequence(tmp_path)
    (tmp_path / "frames").chmod(0o500)
    try:
        assert "could not be written" in sentence(sequence.write_frame, small_frame(0))
    finally:
        (tmp_path / "frames").chmod(0o700)


def test_a_file_where_a_folder_should_be_is_named(tmp_path):
    sequence = small_sequence(tmp_path)
    (tmp_path / "denoised").write_text("x")
    assert "could not be written" in sentence(
        sequence.write_result, "m", 0, small_frame()["color"])
