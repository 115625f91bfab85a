"""On rendered frames: 64 samples in two halves say what 1024 say."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.metrics.estimate import Number, number
from onespp.denoise.metrics.image import Target, display_error, pair
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.box import box

SIZE, FRAMES = 48, (2, 7)


def parts_of(renderer: Renderer, frame: int, seed: int, spp: int) -> np.ndarray:
    return np.stack([renderer.sample_sum(frame, seed, k, spp // 4) / (spp // 4)
                     for k in range(4)]).astype(np.float32)


@pytest.mark.slow
def test_64_samples_in_halves_say_what_1024_say():
    renderer = Renderer(box(), SIZE, SIZE)
    few, many, plain = [], [], []
    for frame in FRAMES:
        image = renderer.sample_sum(frame, 1, 0, 8) / np.float32(8)
        small, large = (parts_of(renderer, frame, seed, spp) for seed, spp in ((2, 64), (3, 1024)))
        for parts, found in ((small, few), (large, many)):
            found.append(display_error(pair(image, Target(parts.mean(axis=0), parts))))
        noisy = pair(image, Target(small.mean(axis=0))).srgb
        plain.append(float(np.mean((noisy[0] - noisy[1]) ** 2, dtype=float)))
    little, much = number("dB", few), number("dB", many)
    assert isinstance(little, Number)
    assert abs(little.value - much.value) < 4 * np.hypot(little.error, much.error) + 0.05
    assert -10 * np.log10(np.mean(plain)) < much.value - 0.2
