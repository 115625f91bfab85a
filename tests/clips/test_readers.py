"""The examples of docs/datasets.md: clips through the loaders of PyTorch and of JAX's Grain."""

from __future__ import annotations

import runpy
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from onespp.clips.clips import Clips

EXAMPLES = Path(__file__).parents[2] / "docs/examples"


def needs(*modules: str) -> pytest.MarkDecorator:
    """Before there is a data set to read."""
    missing = [name for name in modules if find_spec(name) is None]
    return pytest.mark.skipif(bool(missing), reason=f"not installed: {', '.join(missing)}")


@needs("torch")
def test_torch_reads_batches(made):
    import torch

    clips = Clips(made.folder, frames=1, crop=16, channels=("color",))
    loader = torch.utils.data.DataLoader(clips, batch_size=2)
    for epoch in range(2):
        clips.set_epoch(epoch)
        batch = next(iter(loader))
        assert batch["color"].shape == (2, 1, 16, 16, 3)
        assert np.array_equal(batch["color"][1], clips[1]["color"])


@needs("grain", "jax")
def test_grain_reads_batches_for_jax(made):
    import grain
    import jax.numpy as numpy

    clips = Clips(made.folder, frames=1, crop=16, channels=("color",))
    loader = grain.MapDataset.source(clips).shuffle(seed=0).batch(2).to_iter_dataset()
    batch = next(iter(loader))
    assert numpy.asarray(batch["color"]).shape == (2, 1, 16, 16, 3)
    assert set(np.asarray(batch["frame"]).tolist()) <= {0, 1, 2}
    assert any(np.array_equal(batch["color"][0], clip["color"]) for clip in clips)


@needs("torch")
def test_the_network_of_the_example_begins_with_the_noisy_frame_and_is_trained(made):
    train = runpy.run_path(str(EXAMPLES / "unet_torch.py"))["train"]
    shares = train(str(made.folder), 2, crop=16, batch=3, workers=0)
    assert shares[0] == pytest.approx(1)
    assert shares[1] > 0
    assert shares[1] != pytest.approx(1, abs=1e-6)
