"""What a reference's parts say of the PSNR that they can tell, and what is grown by it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from onespp.render.reference_error import (
    LEFT,
    MOST_SPP,
    FrameNoise,
    expected_error,
    expected_spp,
    frame_noise,
    next_to_grow,
)
from onespp.show.srgb import srgb_from_linear

H, W = 40, 50
TRUTH = np.broadcast_to(np.linspace(0.1, 0.6, W)[:, None], (H, W, 3))


def noisy(rng: np.random.Generator, sigma: float, channels: int) -> np.ndarray:
    """Four parts around TRUTH; the noise is one in all channels (1), or in each another (3)."""
    return TRUTH + sigma * rng.standard_normal((4, H, W, channels))


def told_psnr(rng: np.random.Generator, parts: np.ndarray) -> float:
    """The PSNR of a method of 40 dB, by the product of the halves (no correction needed: flat)."""
    x = srgb_from_linear(TRUTH) + 1e-2 * rng.choice([-1.0, 1.0], (H, W, 1))
    a, b = (srgb_from_linear(half) for half in (parts[:2].mean(0), parts[2:].mean(0)))
    return -10 * math.log10(np.mean((x - a) * (x - b)))


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("sigma", [0.002, 0.01, 0.03])
def test_the_stated_error_is_the_spread_of_what_references_tell(sigma, channels):
    rng = np.random.default_rng(1)
    stated, told = [], []
    for _ in range(400):
        parts = noisy(rng, sigma, channels)
        stated.append(frame_noise(parts, 64).variance)
        told.append(told_psnr(rng, parts))
    # 400 repetitions: the spread's own deviation is 3.5 %; the curve bends 0.03 at 0.1.
    assert np.mean(stated) ** 0.5 == pytest.approx(np.std(told, ddof=1), rel=0.15)


def test_rare_large_errors_are_stated_as_they_are():
    """As fireflies: a variance that is measured between four parts alone has a square too large."""
    rng = np.random.default_rng(2)
    stated, told = [], []
    for _ in range(400):
        rare = rng.random((4, H, W, 1)) < 0.05
        parts = TRUTH + np.where(rare, 0.038, -0.002)
        stated.append(frame_noise(parts, 64).variance)
        told.append(told_psnr(rng, parts))
    assert np.mean(stated) ** 0.5 == pytest.approx(np.std(told, ddof=1), rel=0.15)


def test_noise_is_foreseen_as_of_independent_samples():
    rng = np.random.default_rng(3)
    few, many = (frame_noise(noisy(rng, 0.03 / n**0.5, 1), n) for n in (16, 256))
    foreseen = few.at(256)
    assert foreseen.spp == 256
    assert foreseen.crossed == pytest.approx(many.crossed, rel=0.1)
    assert foreseen.squared == pytest.approx(many.squared, rel=0.15)


def test_clipped_black_and_broken_pixels_add_nothing():
    parts = np.stack([TRUTH * 0 + 5, TRUTH * 0 + 7, TRUTH * 0 + 9, TRUTH * 0 + 4])
    assert frame_noise(parts, 64).variance == 0
    rng = np.random.default_rng(4)
    good = noisy(rng, 0.02, 3)
    broken = good.copy()
    broken[2, 0, 0] = np.nan
    assert 0 < frame_noise(broken, 64).variance < frame_noise(good, 64).variance


def test_what_the_curve_leaves_is_a_share_of_what_the_jackknife_takes_off():
    rng = np.random.default_rng(5)
    parts = 0.2 + 0.03 * rng.standard_normal((4, 200, 200, 3))
    second = 1.055 / 2.4 * (1 / 2.4 - 1) * 0.2 ** (1 / 2.4 - 2)
    taken_off = 10 / math.log(10) / 1e-4 * (second * 0.03**2 / 4) ** 2
    assert frame_noise(parts, 16).bent == pytest.approx(LEFT * taken_off, rel=0.1)
    assert frame_noise(parts, 16).at(64).bent == pytest.approx(LEFT * taken_off / 16, rel=0.1)


def test_a_bias_that_all_frames_share_does_not_average_away():
    assert expected_error([FrameNoise(64, 0.09, 0, 0.4)] * 9) == pytest.approx(math.hypot(0.1, 0.4))
    bent = {0: FrameNoise(16, 1e-4, 0, 0.3), 1: FrameNoise(16, 1e-3, 0, 0.1)}
    assert next_to_grow(bent, 0.1) == (0, 32)
    spp = expected_spp(bent, 0.1)
    assert expected_error(bent[i].at(n) for i, n in spp.items()) <= 0.1


def test_the_error_of_the_mean_is_that_of_frames_added_up():
    assert expected_error([FrameNoise(64, 0.09, 0.16)]) == pytest.approx(0.5)
    assert expected_error([FrameNoise(64, 0.25, 0.0)] * 4) == pytest.approx(0.25)
    assert expected_error([]) == 0


def test_what_gains_most_grows_first_and_no_further_than_asked_for():
    noises = {0: FrameNoise(64, 1e-4, 0), 3: FrameNoise(64, 0.64, 0), 7: FrameNoise(256, 1.0, 0)}
    assert next_to_grow(noises, 0.1) == (3, 128)
    assert next_to_grow({**noises, 3: FrameNoise(4096, 0.64, 0)}, 0.1) == (7, 512)
    assert next_to_grow(noises, 1.0) is None
    assert next_to_grow({5: FrameNoise(64, 1, 0), 2: FrameNoise(64, 1, 0)}, 0.1) == (2, 128)
    spp = expected_spp(noises, 0.1)
    assert expected_error(noises[i].at(n) for i, n in spp.items()) <= 0.1
    assert spp[3] > spp[0] == 64
    halved = {i: n // 2 if n > noises[i].spp else n for i, n in spp.items()}
    assert expected_error(noises[i].at(n) for i, n in halved.items()) > 0.1


def test_growing_ends_at_the_most_samples():
    assert next_to_grow({0: FrameNoise(MOST_SPP, 1, 0)}, 0.1) is None
    assert expected_spp({0: FrameNoise(64, 1e9, 0), 1: FrameNoise(64, 1, 1)}, 1e-3) == {
        0: MOST_SPP, 1: MOST_SPP}
    assert next_to_grow({0: FrameNoise(MOST_SPP - 8, 1, 0)}, 0.1) == (0, MOST_SPP)
