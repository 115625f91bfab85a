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
from onespp.clips.motion import Matrices, motion_in_pixels


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


def test_noisebase_projects_places_to_pixels_and_moves_them_to_where_they_were(made, tmp_path):
    """By its loader's own steps: a basis of target and up, and matrices of rows."""
    zarr = pytest.importorskip("zarr")
    assert export.export(made, "noisebase", tmp_path / "n") == 4
    assert "sequences: 1" in (tmp_path / "n/train.yaml").read_text()
    store = zarr.storage.ZipStore(str(tmp_path / "n/validation/scene0000.zip"), mode="r")
    group = zarr.open_group(store, mode="r")
    assert group["color"].shape == (3, 4, 16, 16, 2)
    assert group["color"].chunks == (1, 4, 16, 16, 2)
    sequence, cut = made.sequence(1), slice(4, 20)
    matrices = []
    for i in (1, 2):
        eye, up = group["camera_position"][i], group["camera_up"][i]
        forward = group["camera_target"][i] - eye
        basis = np.stack([np.cross(forward, up), up, forward])
        view = np.block([[basis, -(basis @ eye)[:, None]], [np.zeros(3), 1]])
        matrices.append(group["proj_mat"][i] @ view)
        assert np.allclose(matrices[-1], group["view_proj_mat"][i], atol=1e-5)

    def on_screen(place, matrix):
        """(16, 16, 2): row and column."""
        x, y, depth, w = np.einsum("ij,jhw->ihw", matrix, np.concatenate(
            [place, np.ones_like(place[:1])]))
        assert ((depth / w > 0) & (depth / w <= 1)).all()
        return np.stack([(1 - y / w) * 8, (1 + x / w) * 12], -1)

    place = group["position"][2, ..., 0].astype(np.float64)
    pixel = np.moveaxis(np.indices((16, 16)), 0, -1) + np.array((0.5, 4.5))
    assert tuple(group["crop_offset"][2]) == (0, 4)
    assert np.allclose(on_screen(place, matrices[1]), pixel, atol=1e-3)
    depth, id = (sequence.read_frame(2)[name] for name in ("depth", "id"))
    motion = motion_in_pixels(*(Matrices(*sequence.read_matrices(i)) for i in (1, 2)), depth, id)
    assert np.abs(motion).max() > 0.5
    was = on_screen(place + group["motion"][2, ..., 1], matrices[0])
    near = id[:, cut] >= 0
    assert np.allclose((was - pixel)[near], motion[:, cut][near][:, ::-1], atol=0.02)

    rgbe, (low, high) = group["color"][2].astype(np.float64), group["exposure"][2]
    color = rgbe[:3] / 255 * np.exp(low + (high - low) * (rgbe[3] + 1) / 256)
    for k in (0, 1):
        expected = made.sequence(1, k).read_frame(2)["color"][:, cut].transpose(2, 0, 1)
        assert np.abs(color[..., k] - expected).max() <= 0.006 * expected.max()
        assert abs(color[..., k].mean() / expected.mean() - 1) < 0.01
    assert np.array_equal(group["reference"][2], sequence.read_reference(
        2).color[:, cut].transpose(2, 0, 1))


def test_what_cannot_be_exported_is_told(made, tmp_path, monkeypatch):
    with pytest.raises(InputError, match="use zarr, webdataset, noisebase"):
        export.export(made, "tfrecord", tmp_path / "z")
    (tmp_path / "x").write_text("x")
    with pytest.raises(InputError, match="holds files already"):
        export.export(made, "zarr", tmp_path)
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(InputError, match="pip install 'onespp\\[zarr\\]'"):
        export.export(made, "zarr", tmp_path / "z")
