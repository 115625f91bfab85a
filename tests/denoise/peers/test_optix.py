"""NVIDIA's denoiser where there is a device for it; elsewhere these are marked as not run."""

from __future__ import annotations

import os

import numpy as np
import pytest

from onespp.denoise.catalog import PEERS, build
from onespp.denoise.peers import optix
from onespp.denoise.peers.optix import _flow
from onespp.render.errors import InputError
from onespp.render.host.cuda_driver import has_cuda
from tests.support.frames import make_frame, noisy

H, W = 64, 80

needs_cuda = pytest.mark.skipif(
    not has_cuda() or os.environ.get("ONESPP_DEVICE") == "llvm" or not optix.has_weights(),
    reason="not run: no CUDA device, or no weights of OptiX")


def test_a_driver_without_the_network_is_said_in_a_sentence(monkeypatch, tmp_path):
    """OptiX itself would end the process."""
    monkeypatch.setattr(optix.backend, "choose", lambda device="auto": "cuda")
    monkeypatch.setattr(optix.sys, "platform", "linux")
    monkeypatch.setattr(optix, "WEIGHTS", tmp_path / "nvoptix.bin")
    assert not PEERS["optix"].available()  # so that `--method all` goes without it
    with pytest.raises(InputError, match=r"nvoptix\.bin.*driver"):
        build("optix").init(H, W)


@needs_cuda
@pytest.mark.parametrize("name", ["optix", "optix-temporal"])
def test_noise_goes_and_the_picture_stays(name):
    clean = make_frame(H, W, wall_end=1e9)
    frames = [noisy(clean, seed=i) for i in range(3)]
    method = build(name)
    state = method.init(H, W)
    for frame in frames:
        image, state = method(frame, state)
        assert image.shape == (H, W, 3)
        assert np.isfinite(image).all()
    before = np.mean((frames[-1]["color"] - clean["color"])**2)
    assert np.mean((image - clean["color"])**2) < 0.3 * before


@needs_cuda
def test_the_last_result_is_reused():
    clean = make_frame(H, W, wall_end=1e9)
    method = build("optix-temporal")
    state = method.init(H, W)
    for seed in range(4):
        image, state = method(noisy(clean, seed=seed), state)
    alone, _ = method(noisy(clean, seed=3), method.init(H, W))
    assert np.abs(image - alone).max() > 1e-4


def test_a_camera_that_stands_still_gives_no_flow_and_a_first_frame_none():
    frame = make_frame(H, W)
    assert not _flow(None, frame).any()
    flow = _flow(frame, frame)
    assert flow.shape == (H, W, 2)
    assert not flow.any()
