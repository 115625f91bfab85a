"""Training: what may be trained on, to what, and that a killed one goes on to the same weights."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import onespp
from onespp.datasets.folder import DataSet
from onespp.denoise.methods.recurrent.weights import read_network
from onespp.render.errors import InputError
from onespp.training import train as training
from onespp.training.batches import KEPT, Batches
from onespp.training.checkpoint import Checkpoint


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> DataSet:
    """Sequences of seven frames of 32x32: two to train on, one to validate."""
    return onespp.dataset("simple", tmp_path_factory.mktemp("data") / "set", sequences=3, frames=7,
                          size=(32, 32), reference_spp=4, changes={"split.validation": 0.3})


@pytest.mark.parametrize("scene", ["box", "room", "hard/mirror", "generated/12",
                                   "docs/slow_box.py"])
def test_scenes_that_results_are_measured_on_are_refused(made, tmp_path, scene):
    folder = tmp_path / "set"
    shutil.copytree(made.folder, folder)
    manifest = folder / "validation/000001/seed0/manifest.json"
    manifest.write_text(json.dumps({**json.loads(manifest.read_text()), "scene": scene}))
    with pytest.raises(InputError, match=r"000001 is of the scene '.*', which results are"):
        Batches.of(folder, 32, 1, 0)


def test_scenes_to_develop_on_are_not_kept_back():
    assert {"generated/12", "generated/23", "hard/mirror"} <= KEPT
    assert not {"generated/0", "generated/11"} & KEPT


def test_what_cannot_be_trained_on_is_refused(made, tmp_path, monkeypatch):
    for folder, crop, words in (
            (made.folder / "train/000000/seed0", 32, "is a sequence, not a data set"),
            (tmp_path, 32, "is not a data set"), (made.folder, 40, "--crop is 40: use a multiple"),
            (made.folder, 32, "sequences of 3 frames: use a data set of 7 or more")):
        with pytest.raises(InputError, match=words):
            Batches.of(folder, crop, 1, 0)
    for options, words in (({"width": "wide"}, "--width is wide: use full"),
                           ({"batch": 0}, "--batch is 0"), ({"seed": -1}, "--seed is -1")):
        with pytest.raises(InputError, match=words):
            training.Settings(**options)
    monkeypatch.setattr(training, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"jax and optax: run `pip install 'onespp\[train\]'`"):
        training.train(made.folder, tmp_path / "x.npz", 1, training.Settings())


def test_a_checkpoint_of_another_training_or_a_damaged_one_is_refused(tmp_path):
    path = tmp_path / "x.checkpoint.npz"
    Checkpoint({"seed": 1}, {"a": np.ones(3)}, [0.5, 0.25], {2: 0.3}, 9.0).write(path)
    again = Checkpoint.read(path, {"seed": 1})
    assert (again.losses, again.validation, again.seconds) == ([0.5, 0.25], {2: 0.3}, 9.0)
    with pytest.raises(InputError, match=r"seed is 1 there, 2 here\): use another --out"):
        Checkpoint.read(path, {"seed": 2})
    path.write_bytes(path.read_bytes()[:-99])
    with pytest.raises(InputError, match=r"is damaged.*: remove it"):
        Checkpoint.read(path, {"seed": 1})


def test_the_rate_grows_tenfold_and_falls_as_the_root():
    rate, ramp = training.RATE, training.RAMP
    assert training.rate_of(0) == pytest.approx(rate / 10)
    assert training.rate_of(ramp) == pytest.approx(rate, rel=0.01)
    assert training.rate_of(4 * ramp - 1) == pytest.approx(rate / 2)


def test_the_loss_is_that_of_the_paper_on_errors_without_edges():
    pytest.importorskip("jax")
    from onespp.training.loss import FRAME_WEIGHTS, loss

    error = np.array([0.5, -0.25, 0, 0, 1, 1, 3])
    truth = np.random.default_rng(0).random((2, 7, 8, 9, 3))
    change = np.abs(np.diff(error, prepend=error[0]))
    expected = FRAME_WEIGHTS @ (0.8 * np.abs(error) + 0.1 * change) / np.sum(FRAME_WEIGHTS)
    wide = error[:, None, None, None]
    assert float(loss(truth + wide, truth)) == pytest.approx(expected, rel=1e-4)
    spot = np.zeros((1, 1, 33, 33, 3))
    spot[0, 0, 16, 16] = 1  # the blurred spot has a Laplacian that is as much below 0 as above
    mean = 1 / 33**2
    log = (float(loss(spot, 0 * spot)) - 0.8 * mean) / 0.1 / mean
    assert log == pytest.approx(2 * 0.3278, rel=0.05)  # 2/(sigma^2 e), sampled


@pytest.mark.slow
def test_a_batch_follows_from_seed_and_step(data):
    batches = Batches.of(data.folder, 32, 2, 5)
    planes, truth = batches.read(3)
    assert (planes.shape, truth.shape) == ((2, 7, 32, 32, 7), (2, 7, 32, 32, 3))
    batches.read(4)
    again = Batches.of(data.folder, 32, 2, 5).read(3)
    for a, b in zip((planes, truth), again):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(planes, Batches.of(data.folder, 32, 2, 6).read(3)[0])


@pytest.mark.slow
def test_a_killed_training_goes_on_to_the_same_weights(data, tmp_path):
    pytest.importorskip("jax")

    def command(out, steps):
        return [sys.executable, "-m", "onespp", "train", "rae", data.folder, "--out", out,
                "--steps", str(steps), "--width", "sixteenth", "--crop", "32", "--batch", "2",
                "--checkpoint", "3"]

    whole, killed = tmp_path / "whole.npz", tmp_path / "killed.npz"
    subprocess.run(command(whole, 8), check=True, capture_output=True)
    with subprocess.Popen(command(killed, 1000), stderr=subprocess.DEVNULL) as process:
        checkpoint, end = killed.with_suffix(".checkpoint.npz"), time.monotonic() + 120
        while not checkpoint.exists():
            assert process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.005)
        os.kill(process.pid, signal.SIGKILL)
    with np.load(checkpoint) as stand:
        assert 3 <= len(stand["losses"]) < 8
    subprocess.run(command(killed, 8), check=True, capture_output=True)
    assert killed.read_bytes() == whole.read_bytes()
    assert killed.with_suffix(".png").stat().st_size > 5000
    losses = [json.loads(path.with_suffix(".json").read_text())["loss"] for path in (whole, killed)]
    assert losses[0] == losses[1]
    assert len(losses[0]) == 8
    assert read_network(killed).about["steps"] == 8
