"""Training: what may be trained on, to what, and that a killed one goes on to the same weights."""

import json
import os
import shutil
import statistics
import subprocess
import sys
import time
from importlib.util import find_spec

import numpy as np
import pytest
from PIL import Image

import onespp
from onespp.datasets.folder import DataSet
from onespp.denoise.methods.learned.weights import read_network
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.training import train as training
from onespp.training.batches import KEPT, Batches
from onespp.training.checkpoint import Checkpoint
from onespp.training.log import Spread, read_logs, spreads, table

needs_jax = pytest.mark.skipif(
    find_spec("jax") is None or find_spec("optax") is None,
    reason="JAX or Optax is not installed: pip install 'onespp[train]'")


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
    for options, words in (({"network": "gan"}, "there is no network 'gan': use rae, unet"),
                           ({"width": "wide"}, "--width is wide: use full"),
                           ({"batch": 0}, "--batch is 0"), ({"seed": -1}, "--seed is -1")):
        with pytest.raises(InputError, match=words):
            training.Settings(**options)  # type: ignore[arg-type]
    monkeypatch.setattr(training, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"jax and optax: run `pip install 'onespp\[train\]'`"):
        training.train(made.folder, tmp_path / "x.npz", 1, training.Settings())


def test_a_checkpoint_of_another_training_or_a_damaged_one_is_refused(tmp_path):
    path = tmp_path / "x.checkpoint.npz"
    Checkpoint({"seed": 1}, {"a": np.ones(3)}, [0.5, 0.25], {2: 0.3}, 9.0).write(path)
    again = Checkpoint.read(path, {"network": "rae", "result": "", "seed": 1})  # (older: none)
    assert (again.losses, again.validation, again.seconds) == ([0.5, 0.25], {2: 0.3}, 9.0)
    with pytest.raises(InputError, match=r"seed is 1 there, 2 here\): use another --out"):
        Checkpoint.read(path, {"seed": 2})
    path.write_bytes(path.read_bytes()[:-99])
    with pytest.raises(InputError, match=r"is damaged.*: remove it"):
        Checkpoint.read(path, {"seed": 1})


def test_losses_of_seeds_are_told_with_their_spread(tmp_path):
    def log(name, seed, validation, network="unet", digest="a"):
        path = tmp_path / name
        path.write_text(json.dumps({
            "network": network, "width": "half", "seed": seed, "batch": 4, "crop": 128, "steps": 3,
            "data": {"name": "rooms", "seed": 1, "digest": digest, "sequences": 9},
            "versions": {}, "seconds": 1.0, "loss": [0.5, 0.3, 0.1], "validation": validation}))
        return path

    paths = [log("0", 0, {"2": 0.2, "3": 0.1}), log("1", 1, {"2": 0.4}), log("2", 2, {"2": 0.6}),
             log("other", 0, {"2": 0.7}, network="rae")]
    logs = read_logs(paths)
    assert spreads(logs) == {"unet-half": Spread(3, 2, statistics.mean((0.2, 0.4, 0.6)),
                                                 statistics.stdev((0.2, 0.4, 0.6)))}
    lines = table(logs).splitlines()
    assert lines[1].split() == ["unet-half", "0", "3", "0.3000", "0.1000", "3"]
    assert lines[-1] == "unet-half: 0.4000 +- 0.2000 on others at step 2, 3 seeds"
    for path, words in ((log("else", 0, {"2": 0.1}, digest="b"), "of trainings with another data"),
                        (log("none", 0, {}), "none has no losses on other scenes")):
        with pytest.raises(InputError, match=words):
            read_logs([paths[0], path])


def test_the_command_compares_losses_and_draws_them(call, tmp_path):
    logs = [tmp_path / f"{seed}.json" for seed in range(2)]
    for seed, path in enumerate(logs):
        path.write_text(json.dumps({
            "width": "half", "seed": seed, "batch": 4, "crop": 128, "steps": 3,
            "data": {"name": "rooms", "seed": 1, "digest": "a", "sequences": 9}, "versions": {},
            "seconds": 1.0, "loss": [0.5, 0.3, 0.1], "validation": {"3": 0.1 + seed}}))
    picture = tmp_path / "losses.png"
    code, out, _ = call("train", "losses", *map(str, logs), "--plot", str(picture))
    assert code == 0
    assert "rae-half: 0.6000 +- 0.7071 on others at step 3, 2 seeds" in out
    with Image.open(picture) as image:  # a colour for each, on white
        assert {(31, 119, 180), (255, 127, 14)} <= {color[:3] for _, color in
                                                   image.getcolors(1 << 24)}


def test_the_rate_grows_tenfold_and_falls_as_the_root():
    rate, ramp = training.RATE, training.RAMP
    assert training.rate_of(0) == pytest.approx(rate / 10)
    assert training.rate_of(ramp) == pytest.approx(rate, rel=0.01)
    assert training.rate_of(4 * ramp - 1) == pytest.approx(rate / 2)


@needs_jax
def test_the_loss_is_that_of_the_paper():
    """Of errors without edges, where only light and time count, and of a spot that stays."""
    import jax

    from onespp.training.loss import FRAME_WEIGHTS, loss

    loss_of, truth = jax.jit(loss), np.random.default_rng(0).random((1, 7, 33, 33, 3))
    error = np.array([0.5, -0.25, 0, 0, 1, 1, 3])
    change = np.abs(np.diff(error, prepend=error[0]))
    expected = FRAME_WEIGHTS @ (0.8 * np.abs(error) + 0.1 * change) / np.sum(FRAME_WEIGHTS)
    found = loss_of(truth + error[:, None, None, None], truth)
    assert float(found) == pytest.approx(expected, rel=1e-4)
    spot = np.zeros(truth.shape)
    spot[:, :, 16, 16] = 1  # the blurred spot has a Laplacian that is as much below 0 as above
    mean = 1 / 33**2
    log = (float(loss_of(truth + spot, truth)) - 0.8 * mean) / 0.1 / mean
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
def test_what_a_method_made_stands_in_the_place_of_noisy_frames(data, tmp_path):
    folder = tmp_path / "set"
    shutil.copytree(data.folder, folder)
    for path in folder.glob("*/*/seed*"):
        sequence = FrameSequence.open(path)
        for i in sequence.frames:
            sequence.write_result("darker", i, sequence.read_frame(i)["color"] / 4)
    (planes, truth), noisy = (Batches.of(folder, 32, 2, 5, result=name).read(3)
                              for name in ("darker", ""))
    np.testing.assert_array_equal(planes[..., 3:], noisy[0][..., 3:])
    assert (planes[..., :3] <= noisy[0][..., :3]).all()
    assert planes[..., :3].mean() < 0.8 * noisy[0][..., :3].mean()
    np.testing.assert_array_equal(truth, noisy[1])


@pytest.mark.slow
def test_the_clips_that_validate_are_the_same_whatever_the_seed(data):
    """Else the spread of losses over seeds would be that of the clips."""
    first, again = (training._validation(data.folder, training.Settings(seed=seed, crop=32), None)
                    for seed in (0, 7))
    assert first is not None
    assert again is not None
    np.testing.assert_array_equal(first[0], again[0])


@needs_jax
@pytest.mark.slow
def test_a_loss_that_is_no_number_stops_a_training_before_its_checkpoint(data, tmp_path,
                                                                         monkeypatch):
    monkeypatch.setattr(training._Optimizer, "step", lambda *_: float("nan"))
    with pytest.raises(InputError, match="the loss of step 1 is nan: look for frames of"):
        training.train(data.folder, tmp_path / "x.npz", 3,
                       training.Settings(width="sixteenth", batch=1, crop=32), every=1)
    assert not [*tmp_path.iterdir()]


def test_late_steps_count_more_in_the_mean_and_all_of_them_one():
    shares = np.array([training.share_of(step) for step in range(1000)])
    kept = np.cumprod(np.append(1, 1 - shares[:0:-1]))[::-1]  # of each in the last mean
    assert shares[0] == 1
    assert np.sum(shares * kept) == pytest.approx(1)
    assert np.sum((shares * kept)[:500]) < 0.01
    assert np.sum((shares * kept)[900:]) == pytest.approx(1 - 0.9**9, abs=0.02)


@needs_jax
@pytest.mark.slow
def test_a_killed_training_goes_on_to_the_same_weights(data, tmp_path):
    environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": str(tmp_path / "compiled"),
                   "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}

    def command(out, steps):
        return [sys.executable, "-m", "onespp", "train", "rae", str(data.folder), "--out", str(out),
                "--steps", str(steps), "--width", "sixteenth", "--crop", "32", "--batch", "2",
                "--checkpoint", "3"]

    def to(out, steps):
        subprocess.run(command(out, steps), check=True, capture_output=True, env=environment)

    whole, killed = tmp_path / "whole.npz", tmp_path / "killed.npz"
    checkpoint = killed.with_suffix(".checkpoint.npz")
    with subprocess.Popen(command(killed, 100_000), stderr=subprocess.DEVNULL,
                          env=environment) as process:
        while not checkpoint.exists():
            assert process.poll() is None
            time.sleep(0.005)
        process.kill()  # SIGKILL
    with np.load(checkpoint) as stand:
        count = len(stand["losses"]) + 4
    to(killed, count)
    to(whole, count)
    assert killed.read_bytes() == whole.read_bytes()
    assert killed.with_suffix(".png").stat().st_size > 5000
    logs = [json.loads(path.with_suffix(".json").read_text()) for path in (whole, killed)]
    assert logs[0]["loss"] == logs[1]["loss"]
    assert len(logs[0]["loss"]) == read_network(killed).about["steps"] == count
