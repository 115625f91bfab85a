"""What references are worth: the numbers from known noise, and both sides on a real scene."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.render.study.efficiency import Measured, compare, measure, size_of
from onespp.render.study.mitsuba_path import MitsubaPath
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance

GREY = 0.2  # linear; the slope of sRGB there is 1.055 / 2.4 x GREY^(1 / 2.4 - 1)
SLOPE = 1.055 / 2.4 * GREY ** (1 / 2.4 - 1)


def noisy(sigma: float, seconds: float, renders: int, samples: int, seed: int) -> Measured:
    """Means of samples of deviation sigma, which took about that long."""
    rng = np.random.default_rng(seed)
    deviation = sigma / np.sqrt(samples)
    return Measured(GREY + deviation * rng.standard_normal((renders, 16, 16, 3)),
                    seconds * (1 + 0.05 * rng.standard_normal(renders)), samples)


def test_variance_is_that_of_one_sample_in_srgb():
    expected = (SLOPE * 0.1) ** 2
    for samples in (64, 256):
        assert noisy(0.1, 1, 8, samples, 0).variance() == pytest.approx(expected, rel=0.05)


def test_efficiency_is_the_product_within_its_error():
    """Noise 3 times as high and samples half as dear: 9 / 2. Over 100 repetitions."""
    rows = [compare("x", noisy(0.01, 2, 5, 256, 2 * k), noisy(0.03, 0.25, 5, 64, 2 * k + 1), 3, 2)
            for k in range(100)]
    better = np.array([row.better for row in rows])
    assert better.mean() == pytest.approx(9 / 2, rel=0.03)
    assert rows[0].better == rows[0].variance * rows[0].time
    # Of five renders each, and of a median: right within a third.
    assert 2 / 3 < np.mean([row.error for row in rows]) / better.std() < 3 / 2


def test_path_through_centres_has_the_mean_of_our_samples():
    renderer = Renderer(catalog.load("box"), 16, 16)
    renderer.stage.set_frame(3)
    theirs = [blocks(MitsubaPath(renderer).through_centres(k, 64), 4) for k in range(24)]
    ours = [blocks(renderer.sample_sum(3, 0, k, 64) / 64, 4) for k in range(24)]
    assert_same_mean(*mean_and_variance(ours), *mean_and_variance(theirs))


def test_a_scene_is_measured_in_turns_and_told_of():
    told = []
    row = measure(catalog.load("box"), 12, 12, 16, 3, lambda *step: told.append(step))
    assert told == [(k, 3, "box") for k in (1, 2, 3)]
    assert (row.scene, row.lights, row.candidates) == ("box", 1, 2)
    assert row.variance > 1
    assert min(row.time, row.seconds, row.error) > 0


def test_an_image_has_the_shape_of_its_scene():
    room = catalog.load("room")
    height, width = size_of(room, 4096)
    assert height * width == pytest.approx(4096, rel=0.02)
    assert width / height == pytest.approx(room.width / room.height, rel=0.05)
    assert size_of(room, 1) == (1, 1)
