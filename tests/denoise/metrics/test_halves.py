"""Products of halves: without bias, with the right error, against closed forms.

The truth and the image are fixed, and what is random is the noise of the reference's four parts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from statistics import NormalDist

import numpy as np
import pytest

from onespp.denoise.geometry.correspondence import NOWHERE
from onespp.denoise.metrics.errors import PSNR_CAP, decibels, mse
from onespp.denoise.metrics.estimate import Estimate, error, number, pooled, product_of, value
from onespp.denoise.metrics.flicker import Step, difference_square, flicker_square
from onespp.denoise.metrics.halves import block_of, block_sums, display_halves, mean_product
from onespp.denoise.metrics.image import (
    Target,
    display_error,
    energy,
    pair,
    relative_error,
)
from onespp.denoise.metrics.tonemap import linear_from_srgb, srgb_from_linear

HEIGHT, WIDTH = 48, 80
NARROW = 32  # pixels, where many references are judged
RATE = 1e-3  # chance that a correct estimator fails a whole table of levels


def scene(width: int = WIDTH) -> tuple[np.ndarray, np.ndarray]:
    """Linear truth, dark to bright, and an image that is off by 0.02 to 0.06 on the display."""
    y, x = np.mgrid[:HEIGHT, :width]
    shown = np.stack([0.15 + 0.6 * x / width, 0.2 + 0.5 * y / HEIGHT, 0.4 + 0 * x], axis=-1)
    wrong = shown + 0.04 * np.sin(0.4 * x + 0.2 * y)[..., None] + 0.02
    return linear_from_srgb(shown), linear_from_srgb(wrong)


def parts_of(truth: np.ndarray, sigma: float, rng: np.random.Generator,
             correlated: bool = False) -> np.ndarray:
    """Four parts whose mean has a relative noise of sigma."""
    noise = rng.standard_normal((4, *truth.shape))
    if correlated:  # the colours of a path rise and fall together
        noise = 0.8 * noise[..., :1] + 0.6 * noise
    return (truth * (1 + 2 * sigma * noise)).astype(np.float32)


def judged(truth, image, sigma, rng, correlated=False):
    parts = parts_of(truth, sigma, rng, correlated)
    return pair(image.astype(np.float32), Target(parts.mean(axis=0), parts))


def assert_no_bias(estimate: Callable[[float, np.random.Generator], float], wanted: float,
                   levels: np.ndarray, repeats: int, second: float = 0.0) -> None:
    """z-tests at all levels with RATE in all; `second`: what a bias may be, relative."""
    limit = -NormalDist().inv_cdf(0.5 * (1 - (1 - RATE) ** (1 / len(levels))))
    for level in levels:
        rng = np.random.default_rng(int(1e6 * level))
        found = np.array([estimate(level, rng) for _ in range(repeats)])
        deviation = found.std(ddof=1) / math.sqrt(repeats)
        assert abs(found.mean() - wanted) < limit * deviation + second * wanted, level


# Bias


LEVELS = np.geomspace(0.002, 0.05, 20)


def test_the_error_on_the_display_has_no_bias_at_20_levels_of_gaussian_noise():
    """Noise on the display values, at 0.002 to 0.05 of the white: exact, no curve."""
    truth, image = (srgb_from_linear(i) for i in scene())
    wanted = mse(image, truth)

    def estimate(sigma, rng):
        parts = truth + 2 * sigma * rng.standard_normal((4, *truth.shape))
        a, b, c, d = parts
        halves = type(display_halves(np.zeros((4, 1, 1, 3))))(
            (a + b) / 2, (c + d) / 2, (a - b) / 2, (c - d) / 2)
        found = mean_product(image, halves)
        assert found is not None
        return found.mean

    assert_no_bias(estimate, wanted, LEVELS, 12)


@pytest.mark.parametrize("correlated", [False, True])
def test_psnr_has_no_bias_through_the_curve_at_20_levels(correlated):
    """Relative noise of the mean from 0.002 to 0.05; what fourth orders leave is below 0.3 %."""
    truth, image = scene()
    wanted = mse(srgb_from_linear(image), srgb_from_linear(truth))
    assert_no_bias(lambda sigma, rng: display_error(
        judged(truth, image, sigma, rng, correlated)).mean, wanted, LEVELS, 12, 0.003)


def test_relmse_has_no_bias():
    """Noise of the mean of 0.5, 2 and 10 %: a bias of fourth order is left."""
    truth, image = scene()
    wanted = float(np.mean((image - truth) ** 2 / (truth ** 2 + 0.01)))
    for sigma, second in ((0.005, 1e-4), (0.02, 1e-3), (0.1, 0.02)):
        assert_no_bias(lambda s, rng: relative_error(judged(truth, image, s, rng)).mean, wanted,
                       np.array([sigma]), 30, second)


def test_the_square_of_the_energy_error_has_no_bias():
    truth, image = scene()
    for scale in (1.0, 0.93):
        wanted = (scale * image.mean() / truth.mean() - 1) ** 2
        assert_no_bias(
            lambda sigma, rng, k=scale: energy(judged(truth, k * image, sigma, rng)).mean, wanted,
            LEVELS[::5], 40, 1e-3)
    assert energy(judged(truth, truth, 0.02, np.random.default_rng(0))).mean < 1e-6


def steps(sigma: float, rng: np.random.Generator, width: int = WIDTH) -> Step:
    """Two frames of which the second is the first moved by three pixels, with other errors."""
    truth, image = scene(width)
    old, now = judged(truth, image, sigma, rng), judged(
        np.roll(truth, 3, axis=1), np.roll(truth, 3, axis=1) * 1.05, sigma, rng)
    source = np.roll(np.arange(HEIGHT * width).reshape(HEIGHT, width), 3, axis=1)
    source[:, :3] = NOWHERE
    carried = old.target.srgb_halves.apply(
        lambda i: i.reshape(-1, 3)[np.maximum(source, 0)])
    return Step(now.srgb, old.srgb, source, None, now.target.srgb_halves.minus(carried),
                now.target.srgb_halves.minus(old.target.srgb_halves))


@pytest.mark.parametrize("measure", [flicker_square, difference_square])
def test_changes_have_no_bias(measure):
    truth = steps(0.0, np.random.default_rng(0))
    wanted = measure(truth)
    assert wanted.variance == 0
    plain = (truth.now[0] - truth.now[1]) - (truth.before[0] - truth.before[1])
    if measure is difference_square:
        assert wanted.mean == pytest.approx(np.mean(plain ** 2, dtype=float), rel=1e-5)
    assert_no_bias(lambda sigma, rng: measure(steps(sigma, rng)).mean, wanted.mean,
                   LEVELS[::4], 30, 0.003)


def test_the_square_against_the_mean_has_the_noise_on_top():
    truth, image = scene()
    sigma = 0.05
    images = judged(truth, image, sigma, np.random.default_rng(3))
    shown, wanted = srgb_from_linear(truth), mse(srgb_from_linear(image), srgb_from_linear(truth))
    slope = (srgb_from_linear(truth * 1.001) - shown) / 0.001
    floor = float(np.mean((sigma * slope) ** 2))
    assert mse(*images.srgb) == pytest.approx(wanted + floor, rel=0.05)
    assert display_error(images).mean == pytest.approx(wanted, rel=0.05)


# Error


REPEATS = 200


def coverage(found: list[tuple[float, float]], wanted: float) -> float:
    return float(np.mean([abs(v - wanted) < 1.96 * e for v, e in found]))


@pytest.mark.parametrize("measure", [display_error, relative_error, energy])
@pytest.mark.parametrize("sigma", [0.005, 0.05, 0.1])
@pytest.mark.parametrize("correlated", [False, True])
def test_the_interval_holds_the_truth(measure, sigma, correlated):
    """In 90 to 99 % of 200 references of the same truth, for the same image."""
    truth, image = scene(NARROW)
    truth, image = 0.5 * truth, 0.5 * image  # nothing near the clip
    exact = measure(judged(truth, image, 0.0, np.random.default_rng(0))).mean
    found = [measure(judged(truth, image, sigma, np.random.default_rng([i, 5]), correlated))
             for i in range(REPEATS)]
    # Intervals around what is measured: a bias of second order is another test's.
    wanted = exact if sigma < 0.1 else float(np.mean([e.mean for e in found]))
    assert 0.9 <= coverage([(e.mean, math.sqrt(e.variance)) for e in found], wanted) <= 0.99


@pytest.mark.parametrize("scale", ["dB", "root"])
def test_the_interval_of_a_sequence_holds_the_truth(scale):
    truth, image = scene(NARROW)
    shown = mse(srgb_from_linear(image), srgb_from_linear(truth))
    wanted = decibels(shown) if scale == "dB" else math.sqrt(shown)
    found = []
    for i in range(REPEATS):
        rng = np.random.default_rng([i, 8])
        found.append(number(scale, [display_error(judged(truth, image, 0.08, rng))
                                    for _ in range(3)]))
    assert not any(n.bound or n.together for n in found)
    assert 0.9 <= coverage([(n.value, n.error) for n in found], wanted) <= 0.99


@pytest.mark.parametrize("measure", [flicker_square, difference_square])
def test_the_interval_of_a_change_holds_the_truth(measure):
    wanted = measure(steps(0.0, np.random.default_rng(0), NARROW)).mean
    found = [measure(steps(0.03, np.random.default_rng([i, 6]), NARROW)) for i in range(REPEATS)]
    assert 0.9 <= coverage([(e.mean, math.sqrt(e.variance)) for e in found], wanted) <= 0.99


def test_methods_on_the_same_halves_are_paired():
    """The error of a difference is that of the differences, far below either's own."""
    truth, image = scene(NARROW)
    better = truth + 0.9 * (image - truth)
    wanted = (mse(srgb_from_linear(image), srgb_from_linear(truth))
              - mse(srgb_from_linear(better), srgb_from_linear(truth)))
    rows = []
    for i in range(REPEATS):
        parts = parts_of(truth, 0.05, np.random.default_rng([i, 7]))
        target = Target(parts.mean(axis=0), parts)
        a, b = (display_error(pair(x.astype(np.float32), target)) for x in (image, better))
        variance = a.variance + b.variance - 2 * product_of(a.noise, b.noise)
        rows.append((a.mean - b.mean, math.sqrt(variance), math.sqrt(a.variance)))
    assert 0.9 <= coverage([row[:2] for row in rows], wanted) <= 0.99
    assert np.mean([row[1] for row in rows]) < 0.2 * np.mean([row[2] for row in rows])


# Numbers


def test_a_number_in_decibels_has_no_bias_of_the_logarithm():
    rng = np.random.default_rng(0)
    deviation = 0.15
    drawn = 1e-3 * (1 + deviation * rng.standard_normal(50_000))
    found = [value("dB", Estimate(m, (1e-3 * deviation) ** 2)) for m in drawn]
    kept = [v for v in found if v is not None]
    assert len(kept) > 0.999 * len(found)  # the rest is within three errors of 0
    without = np.mean([decibels(m) for m in drawn])
    assert abs(np.mean(kept) - 30) < 0.015 < 0.04 < without - 30
    roots = [v for m in drawn if (v := value("root", Estimate(m, (1e-3 * deviation) ** 2)))]
    assert len(roots) == len(kept)
    assert np.mean(roots) == pytest.approx(math.sqrt(1e-3), rel=5e-3)


def test_what_is_too_good_for_the_reference_is_a_bound():
    clear, unclear, negative = Estimate(1e-3, 1e-10), Estimate(1e-5, 1e-10), Estimate(-1e-5, 1e-10)
    assert value("dB", unclear) is value("root", negative) is None
    assert value("mean", negative) == -1e-5
    alone = number("dB", [negative, negative])
    assert alone.bound
    assert alone.error is None
    assert alone.value == pytest.approx(decibels(2 * math.sqrt(1e-10 / 2)))
    mixed = number("dB", [clear, unclear])
    assert mixed.together
    assert not mixed.bound
    assert mixed.value == pytest.approx(decibels(5.05e-4), abs=1e-3)
    assert mixed.error == pytest.approx(error("dB", pooled([clear, unclear])))
    assert number("root", [Estimate(0.0, 0.0)]).value == 0.0
    assert number("dB", [Estimate(0.0, 0.0)]).value == PSNR_CAP


def test_blocks_cover_an_image_of_any_size():
    plane = np.random.default_rng(0).random((19, 30, 3))
    sums, block = block_sums(plane), block_of(19, 30)
    assert sums == pytest.approx(np.bincount(block.ravel(), plane.sum(axis=2).ravel()))


def test_pixels_that_a_part_lacks_are_not_judged():
    truth, image = scene()
    parts = parts_of(truth, 0.01, np.random.default_rng(0))
    parts[2, 4, 5, 1] = np.nan
    target = Target(parts.mean(axis=0), parts)
    found = display_error(pair(image.astype(np.float32), target))
    assert target.unknown.sum() == 1
    assert math.isfinite(found.mean)
    assert math.isfinite(found.variance)
