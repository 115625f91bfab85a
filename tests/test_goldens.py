"""Small renders against stored means and variances.

`pytest tests/test_goldens.py --regenerate` renders the goldens anew: look at the difference, say in
the commit why the images changed. A failure leaves both images in a folder that it names.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from onespp.denoise.metrics.tonemap import bytes_from_linear
from onespp.render.host import backend
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog
from tests.support.statistics import assert_same_mean

GOLDENS = Path(__file__).parent / "goldens"
HEIGHT, WIDTH, GOLDEN_SPP, SPP = 24, 32, 2048, 256


def estimate(name: str, frame: int, seed: int, spp: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of the mean, (h, w, 3); 32 passes, so that the variance is known well."""
    renderer = Renderer(catalog.load(name), HEIGHT, WIDTH)
    size = spp // 32
    passes = [renderer.sample_sum(frame, seed, number, size) / size for number in range(32)]
    return np.mean(passes, 0), np.var(passes, 0, ddof=1) / 32


def blocks_of(mean: np.ndarray, variance: np.ndarray, size: int = 4):
    """Mean of blocks and its variance: pixels are independent."""
    shape = (HEIGHT // size, size, WIDTH // size, size, 3)
    return (mean.reshape(shape).mean((1, 3), dtype=np.float64),
            variance.reshape(shape).sum((1, 3), dtype=np.float64) / size**4)


@pytest.mark.parametrize(("name", "frame"), [("box", 0), ("box", 13), ("room", 0), ("room", 47)])
def test_renders_match_their_goldens(name, frame, request, tmp_path):
    path = GOLDENS / f"{name}_{frame:04d}.npz"
    if request.config.getoption("--regenerate"):
        mean, variance = estimate(name, frame, 1, GOLDEN_SPP)
        GOLDENS.mkdir(exist_ok=True)
        np.savez_compressed(path, mean=mean, variance=variance)
        pytest.skip(f"regenerated {path.name}")
    if backend.choose() == "cuda":
        pytest.skip("not run on CUDA: OptiX shows another surface at 0.03 % of the pixel centres "
                    "(edges), and these are of LLVM")
    golden = np.load(path)
    mean, variance = estimate(name, frame, 0, SPP)
    try:
        assert_same_mean(*blocks_of(mean, variance),
                         *blocks_of(golden["mean"], golden["variance"]))
    except AssertionError as failure:
        both = np.concatenate([golden["mean"], mean], axis=1)
        Image.fromarray(bytes_from_linear(both)).resize((16 * WIDTH, 8 * HEIGHT), 0).save(
            tmp_path / "golden_and_render.png")
        raise AssertionError(f"{failure}; see {tmp_path}/golden_and_render.png") from None
