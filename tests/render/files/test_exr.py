"""EXR files: what is written is what is read, by us and by other programs."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from onespp.render.errors import InputError
from onespp.render.files.exr import read_exr, read_header, write_exr
from tests.support.places import ROOT


def planes(height: int = 33, width: int = 20, seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    noise = {name: rng.normal(size=(height, width)).astype(np.float32)
             for name in ("R", "G", "B", "N.X", "Z")}
    return noise | {"albedo.R": rng.random((height, width)).astype(np.float16),
                    "count": rng.integers(0, 2**32, (height, width), dtype=np.uint32)}


@given(st.sampled_from([np.float32, np.float16, np.uint32]).flatmap(
    lambda kind: arrays(kind, st.tuples(st.integers(1, 40), st.integers(1, 7)))))
@settings(max_examples=60)
def test_every_value_comes_back_bit_for_bit(tmp_path_factory, image):
    path = tmp_path_factory.mktemp("exr") / "a.exr"
    write_exr(path, {"Z": image})
    back, header = read_exr(path)
    assert back["Z"].dtype == image.dtype
    assert (header.height, header.width) == image.shape
    assert back["Z"].tobytes() == image.tobytes()  # NaN, infinities and -0 too


def test_types_names_and_header_strings_come_back(tmp_path):
    written = planes()
    write_exr(tmp_path / "a.exr", written, {"scene": "box", "about": "a wall, é"})
    back, header = read_exr(tmp_path / "a.exr")
    assert set(back) == set(written)
    for name, image in written.items():
        assert back[name].dtype == image.dtype
        np.testing.assert_array_equal(back[name], image)
    assert header.attributes["scene"] == "box"
    assert header.attributes["about"] == "a wall, é"
    assert read_header(tmp_path / "a.exr") == header


def test_writing_leaves_the_given_arrays_alone(tmp_path):
    written = planes()
    write_exr(tmp_path / "a.exr", written)
    assert all(isinstance(image, np.ndarray) for image in written.values())


def test_a_strided_view_is_written_as_it_looks(tmp_path):
    image = np.random.default_rng(0).normal(size=(12, 10, 3)).astype(np.float32)
    write_exr(tmp_path / "a.exr", {"R": image[::-2, ::3, 1]})
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr")[0]["R"], image[::-2, ::3, 1])


def test_only_the_channels_asked_for_are_read(tmp_path):
    write_exr(tmp_path / "a.exr", planes())
    back, _ = read_exr(tmp_path / "a.exr", ["Z", "R"])
    assert list(back) == ["Z", "R"]
    np.testing.assert_array_equal(back["Z"], planes()["Z"])


def test_the_deprecated_interface_is_not_used(tmp_path, monkeypatch):
    monkeypatch.delattr(OpenEXR, "InputFile")
    write_exr(tmp_path / "a.exr", planes())
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr")[0]["Z"], planes()["Z"])


def test_many_reads_at_once_do_not_end_the_process(tmp_path):
    """With `InputFile` this was a segmentation fault on Python 3.12 and 3.13."""
    write_exr(tmp_path / "a.exr", planes(300, 200))
    code = ("import os, pathlib, sys; os.cpu_count = lambda: 4; "
            "from onespp.render.files.exr import read_exr; "
            "from concurrent.futures import ThreadPoolExecutor as Pool; "
            "path = pathlib.Path(sys.argv[1]); stdout = sys.stdout; "
            "list(Pool(3).map(lambda _: read_exr(path), range(100))); "
            "assert sys.stdout is stdout; print('read')")
    run = subprocess.run([sys.executable, "-c", code, str(tmp_path / "a.exr")], timeout=120,
                         capture_output=True, text=True, cwd=ROOT)
    assert (run.returncode, run.stdout) == (0, "read\n"), run.stderr


def test_what_is_read_cannot_be_written_to(tmp_path):
    write_exr(tmp_path / "a.exr", planes())
    assert not any(image.flags.writeable for image in read_exr(tmp_path / "a.exr")[0].values())


def test_equal_input_gives_equal_bytes_in_every_process_and_with_one_core(tmp_path):
    code = ("import sys, pathlib; from tests.render.files.test_exr import *; "
            "write_exr(pathlib.Path(sys.argv[1]), planes(300, 200), {'scene': 'box'})")
    for name, cores in (("a", None), ("b", {min(os.sched_getaffinity(0))} if hasattr(
            os, "sched_getaffinity") else None)):
        limit = f"import os; os.cpu_count = lambda: 1; os.sched_setaffinity(0, {cores}); "
        subprocess.run([sys.executable, "-c", (limit if cores else "") + code,
                        str(tmp_path / name)], check=True)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_the_other_interface_of_openexr_reads_our_files(tmp_path):
    written = planes()
    write_exr(tmp_path / "a.exr", written)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION
        for name, image in written.items():
            np.testing.assert_array_equal(file.channels()[name].pixels, image)


@pytest.mark.parametrize("kind", ["NO", "RLE", "ZIPS", "ZIP", "PIZ"])
def test_lossless_files_of_other_programs_are_read(tmp_path, kind):
    written = planes()
    header = {"compression": getattr(OpenEXR, f"{kind}_COMPRESSION"),
              "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, dict(written)).write(str(tmp_path / "a.exr"))
    back, _ = read_exr(tmp_path / "a.exr")
    for name, image in written.items():
        np.testing.assert_array_equal(back[name], image)


def test_a_large_constant_image_is_not_taken_for_a_bomb(tmp_path):
    write_exr(tmp_path / "a.exr", {c: np.zeros((2000, 2000), np.float32) for c in "RGB"})
    assert (tmp_path / "a.exr").stat().st_size < 100_000
    assert read_exr(tmp_path / "a.exr")[0]["R"].shape == (2000, 2000)


def test_mitsuba_opens_our_files_and_sees_the_layers(tmp_path):
    from onespp.render.mitsuba.variant import mi  # sets the variant that later tests render with

    written = {name: image for name, image in planes().items() if name != "count"}
    write_exr(tmp_path / "a.exr", written, {"scene": "box"})
    bitmap = mi.Bitmap(str(tmp_path / "a.exr"))
    pixels = np.array(bitmap)
    names = [field.name for field in bitmap.struct_()]
    assert set(names) == set(written)
    for i, name in enumerate(names):
        np.testing.assert_array_equal(pixels[..., i], written[name].astype(np.float32))
    assert "box" in str(bitmap.metadata())


@pytest.mark.parametrize(("channels", "word"), [
    ({"R": np.zeros((3, 4), np.float64)}, "float64"),
    ({"R": np.zeros((3, 4, 3), np.float32)}, "(3, 4, 3)"),
    ({"R": np.zeros((0, 4), np.float32)}, "(0, 4)"),
    ({"R": np.zeros((3, 4), np.float32), "G": np.zeros((4, 3), np.float32)}, "(4, 3)"),
    ({}, "not one (h, w)"),
])
def test_what_cannot_be_stored_is_refused_by_name(tmp_path, channels, word):
    with pytest.raises(InputError) as error:
        write_exr(tmp_path / "a.exr", channels)
    assert word in str(error.value)
    assert not list(tmp_path.iterdir())
