"""Data sets in other layouts hold what the folder holds."""

from __future__ import annotations

import io
import json
import sys
import tarfile

import numpy as np
import pytest

from onespp import InputError
from onespp.clips import export


def test_shards_hold_every_render_and_are_the_same_each_time(made, tmp_path, monkeypatch, call):
    code, out, err = call("export", made.folder, "--format", "webdataset", "--out", tmp_path / "a")
    assert (code, out) == (0, f"exported 4 renders of sequences to {tmp_path / 'a'}\n"), err
    with tarfile.open(tmp_path / "a/train-000000.tar") as tar:
        names = tar.getnames()
        assert {name.partition(".")[0] for name in names} == {"000000-s0", "000000-s1"}
        color = np.load(io.BytesIO(tar.extractfile("000000-s1.indirect.npy").read()))
        about = json.loads(tar.extractfile("000000-s0.json").read())
    assert np.array_equal(color[2], made.sequence(0, 1).read_frame(2)["indirect"])
    assert color.dtype == np.float16
    assert about["draw"] == made.made(0).draw
    assert "000000-s0.reference.npy" in names
    assert "000000-s1.reference.npy" not in names
    monkeypatch.setattr(export, "SHARD_BYTES", 1)
    assert export.export(made, "webdataset", tmp_path / "b") == 4
    assert sorted(p.name for p in (tmp_path / "b").iterdir()) == [
        "train-000000.tar", "train-000001.tar", "validation-000000.tar", "validation-000001.tar"]
    monkeypatch.undo()
    export.export(made, "webdataset", tmp_path / "c")
    assert (tmp_path / "a/train-000000.tar").read_bytes() == (
        tmp_path / "c/train-000000.tar").read_bytes()


def test_zarr_holds_every_render(made, tmp_path):
    zarr = pytest.importorskip("zarr")
    assert export.export(made, "zarr", tmp_path / "z") == 4
    group = zarr.open_group(str(tmp_path / "z"), mode="r")["validation/000001/s0"]
    assert np.array_equal(group["reference"][1], made.sequence(1).read_reference(1).color)
    assert np.array_equal(group["screen_from_world"][2], made.sequence(1).read_matrices(2)[1])
    assert group["depth"].shards == (3, 16, 24)
    assert group.attrs["draw"] == made.made(1).draw


def test_what_cannot_be_exported_is_told(made, tmp_path, monkeypatch):
    with pytest.raises(InputError, match="use zarr or webdataset"):
        export.export(made, "tfrecord", tmp_path / "z")
    (tmp_path / "x").write_text("x")
    with pytest.raises(InputError, match="holds files already"):
        export.export(made, "zarr", tmp_path)
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(InputError, match="pip install 'onespp\\[zarr\\]'"):
        export.export(made, "zarr", tmp_path / "z")
