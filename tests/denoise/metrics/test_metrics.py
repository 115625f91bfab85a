"""The tone map and the measures, against definitions written out differently, and their laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onespp.denoise.metrics.errors import PSNR_CAP, decibels, energy_error, mse, psnr, relmse, smape
from onespp.denoise.metrics.image import non_finite
from onespp.denoise.metrics.noise_floor import reference_floor
from onespp.denoise.metrics.perceptual import flip
from onespp.denoise.metrics.perceptual.ssim import ssim
from onespp.denoise.metrics.table import HEADLINE, METRICS, measure
from onespp.denoise.metrics.tonemap import bytes_from_linear, linear_from_srgb, srgb_from_linear
from onespp.render.files.frame_ranges import spread


def images(seed: int = 0, height: int = 7, width: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """An image and a reference with dark, mid-grey and clipped pixels."""
    rng = np.random.default_rng(seed)
    reference = rng.gamma(0.7, 0.6, (height, width, 3)).astype(np.float32)
    noisy = reference * rng.gamma(2.0, 0.5, reference.shape)
    return noisy.astype(np.float32), reference


def srgb_scalar(x: float) -> float:
    """The standard's definition for one value, in plain Python."""
    x = min(max(x, 0.0), 1.0)
    return 12.92 * x if x <= 0.0031308 else 1.055 * math.pow(x, 1 / 2.4) - 0.055


# The tone map


@pytest.mark.parametrize(("linear", "srgb"), [
    (-1.0, 0.0), (0.0, 0.0), (0.0031308, 0.04044994), (0.18, 0.46135613), (0.5, 0.73535698),
    (1.0, 1.0), (7.0, 1.0), (math.inf, 1.0)])
def test_srgb_has_the_published_values(linear, srgb):
    assert srgb_from_linear(np.array(linear)) == pytest.approx(srgb, abs=1e-7)


def test_srgb_is_continuous_where_its_two_pieces_meet():
    around = 0.0031308 * np.array([1 - 1e-9, 1 + 1e-9])
    assert np.ptp(srgb_from_linear(around)) < 1e-7


@given(st.floats(0, 1))
def test_linear_undoes_srgb(x):
    assert linear_from_srgb(srgb_from_linear(np.float64(x))) == pytest.approx(x, abs=1e-8)


@given(st.floats(-1, 3), st.floats(-1, 3))
def test_srgb_never_decreases(x, y):
    low, high = srgb_from_linear(np.sort(np.array([x, y])))
    assert low <= high


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_tone_map_keeps_the_type(dtype):
    assert srgb_from_linear(np.full(3, 0.5, dtype)).dtype == dtype
    assert linear_from_srgb(np.full(3, 0.5, dtype)).dtype == dtype


def test_bytes_are_rounded_and_nan_is_black():
    linear = np.array([0.0, 0.18, 0.5, 1.0, 4.0, np.nan, np.inf, -np.inf])
    assert bytes_from_linear(linear).tolist() == [0, 118, 188, 255, 255, 0, 255, 0]


# The measures


def test_psnr_and_relmse_equal_their_definitions_written_as_loops():
    image, reference = images()
    squared = relative = 0.0
    for a, b in zip(map(float, image.flat), map(float, reference.flat)):
        squared += (srgb_scalar(a) - srgb_scalar(b)) ** 2
        relative += (a - b) ** 2 / (b * b + 0.01)
    values = measure(image, reference)
    assert values["psnr_srgb"] == pytest.approx(
        20 * math.log10(1 / math.sqrt(squared / image.size)), abs=1e-4)
    assert values["relmse"] == pytest.approx(relative / image.size, rel=1e-6)


def test_a_uniform_error_of_a_tenth_is_20_db():
    assert psnr(np.full((4, 4, 3), 0.6), np.full((4, 4, 3), 0.5)) == pytest.approx(20.0)


def test_identical_images_score_the_cap_and_no_relative_error():
    image, _ = images()
    best = {"psnr_srgb": PSNR_CAP, "psnr_plain": PSNR_CAP, "ssim": pytest.approx(1.0)}
    assert measure(image, image) == {name: best.get(name, 0.0) for name in METRICS}


def test_decibels_never_exceed_the_cap():
    assert decibels(1e-20) == decibels(0.0) == PSNR_CAP
    assert decibels(1e-14) == pytest.approx(140.0)


@pytest.mark.parametrize("metric", METRICS.values(), ids=lambda m: m.name)
def test_a_metric_gets_worse_with_more_noise(metric):
    image, reference = images()
    scores = [measure(reference + k * (image - reference), reference)[metric.name]
              for k in (0.1, 0.3, 1.0)]
    assert scores == sorted(scores, reverse=metric.higher_is_better)
    assert len(set(scores)) == 3


@pytest.mark.parametrize("metric", METRICS.values(), ids=lambda m: m.name)
def test_a_metric_does_not_care_which_way_up_an_image_is(metric):
    image, reference = images()
    colours = 1 if metric.name.startswith("flip") else -1  # the eye tells red from blue
    flipped = measure(image[::-1, :, ::colours], reference[::-1, :, ::colours])[metric.name]
    rel = {"ssim": 1e-6, "flip": 1e-4, "flip_hdr": 1e-4}.get(metric.name, 1e-9)  # of float32
    assert flipped == pytest.approx(measure(image, reference)[metric.name], rel=rel)


def test_mse_is_symmetric_and_quadratic():
    a, b = (i.astype(np.float64) for i in images())
    assert mse(a, b) == mse(b, a)
    assert mse(3 * a, 3 * b) == pytest.approx(9 * mse(a, b))


def test_ten_times_the_squared_error_costs_ten_db():
    a, b = (i.astype(np.float64) for i in images())
    assert psnr(a, b) - psnr(b + math.sqrt(10) * (a - b), b) == pytest.approx(10.0)


def test_relmse_of_bright_pixels_does_not_depend_on_exposure():
    a, b = (100 + i for i in images())
    assert relmse(50 * a, 50 * b) == pytest.approx(relmse(a, b), rel=1e-4)


def test_what_the_display_clips_costs_no_psnr_but_counts_linearly():
    reference, image = np.full((2, 2, 3), 2.0), np.full((2, 2, 3), 9.0)
    values = measure(image, reference)
    assert values["psnr_srgb"] == PSNR_CAP
    assert values["relmse"] == pytest.approx(49 / 4.01)


def test_the_score_sees_less_than_one_step_of_8_bits():
    reference = np.full((4, 4, 3), 0.5, np.float32)
    image = reference + np.float32(1e-4)
    assert 70 < measure(image, reference)["psnr_srgb"] < 90


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_non_finite_pixel_is_counted_and_scored_as_black(value):
    image, reference = images()
    broken, black = image.copy(), image.copy()
    broken[2, 3, 1] = value
    black[2, 3] = 0
    values = measure(broken, reference)
    assert non_finite(broken).sum() == 1
    assert values == measure(black, reference)
    assert np.isnan(broken[2, 3, 1]) or np.isinf(broken[2, 3, 1])  # the argument is left alone


def test_a_pixel_that_the_reference_does_not_know_is_not_judged():
    image, reference = images()
    hole = reference.copy()
    hole[2, 3] = np.nan
    values = measure(image, hole)
    agreed = image.copy()
    agreed[2, 3] = hole[2, 3] = reference[2, 3] = 0
    assert values == measure(agreed, reference)


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_extreme_radiance_gives_finite_scores(scale):
    image, reference = images()
    for values in (measure(image * np.float32(scale), reference),
                   measure(image, reference * np.float32(scale))):
        assert all(math.isfinite(v) for v in values.values() if v is not None)


@pytest.mark.parametrize(("count", "chosen"), [
    (None, [3, 4, 7, 9, 11]), (5, [3, 4, 7, 9, 11]), (3, [3, 7, 11]), (2, [3, 11])])
def test_frames_of_a_slow_metric_are_spread_evenly(count, chosen):
    assert spread([3, 4, 7, 9, 11], count) == chosen


# SMAPE, SSIM and FLIP


def test_smape_equals_its_definition_written_as_a_loop():
    image, reference = images()
    total = sum(abs(a - b) / (abs(a) + abs(b) + 0.01)
                for a, b in zip(map(float, image.flat), map(float, reference.flat)))
    assert smape(image, reference) == pytest.approx(total / image.size, rel=1e-6)


def ssim_by_the_paper(a: np.ndarray, b: np.ndarray) -> float:
    """Wang et al. 2004, eq. 13 to 16, one window at a time."""
    offsets = np.arange(-5, 6)
    weight = np.exp(-(offsets[:, None]**2 + offsets**2) / (2 * 1.5**2))
    weight /= weight.sum()
    values = []
    for y in range(5, a.shape[0] - 5):
        for x in range(5, a.shape[1] - 5):
            for c in range(3):
                p, q = (i[y - 5:y + 6, x - 5:x + 6, c].astype(np.float64) for i in (a, b))
                mp, mq = (weight * p).sum(), (weight * q).sum()
                vp, vq = (weight * (p - mp)**2).sum(), (weight * (q - mq)**2).sum()
                covariance = (weight * (p - mp) * (q - mq)).sum()
                values.append((2 * mp * mq + 1e-4) * (2 * covariance + 9e-4)
                              / ((mp**2 + mq**2 + 1e-4) * (vp + vq + 9e-4)))
    return float(np.mean(values))


def test_ssim_equals_the_papers_formula():
    a, b = map(srgb_from_linear, images(height=14, width=17))
    assert ssim(a, b) == pytest.approx(ssim_by_the_paper(a, b), rel=1e-6)


def test_ssim_has_the_value_of_scikit_image():
    y, x = np.mgrid[:24, :31]
    a = np.stack([0.5 + 0.4 * np.sin(0.3 * x + 0.1 * y), x / 31, y / 24], axis=-1)
    assert ssim(a, a[::-1]) == pytest.approx(0.26839913684219324, rel=1e-6)  # 0.26


def test_an_image_smaller_than_the_window_is_mirrored():
    image, reference = images(height=3, width=4)
    assert ssim(image, image) == pytest.approx(1.0)
    assert 0 < ssim(*map(srgb_from_linear, (image, reference))) < 1


def test_flip_of_opposites_is_one_and_of_a_just_visible_step_is_small():
    black, white = np.zeros((40, 40, 3), np.float32), np.ones((40, 40, 3), np.float32)
    assert flip.flip(white, black) > 0.9
    assert 0 < flip.flip(black + np.float32(1 / 255), black) < 0.03
    assert flip.flip_map(white, black).shape == (40, 40)


@pytest.mark.parametrize("size", [(3, 4), (33, 70), (130, 161)])
@pytest.mark.parametrize("change", ["noise", "shift", "negative"])
def test_flip_is_that_of_its_authors_library(size, change):
    library = pytest.importorskip("flip_evaluator")
    y, x = np.mgrid[:size[0], :size[1]]
    reference = np.stack([0.5 + 0.5 * np.sin(0.05 * x + 0.02 * y), 0.5 + 0.5 * np.sin(0.3 * x),
                          0.8 * ((x // 9 + y // 7) % 2)], axis=-1) ** 2
    noise = np.random.default_rng(0).normal(0, 0.05, reference.shape)
    image = {"noise": np.maximum(reference + noise, 0), "shift": np.roll(reference, 2, axis=1),
             "negative": 1 - reference}[change]
    a, b = image.astype(np.float32), reference.astype(np.float32)
    wanted = library.evaluate(*map(srgb_from_linear, (b, a)), "LDR", True, False, False)[0][..., 0]
    found = flip.flip_map(*map(srgb_from_linear, (a, b)))
    assert np.abs(found - wanted).max() < 1e-3
    assert found.mean(dtype=float) == pytest.approx(wanted.mean(dtype=float), abs=1e-4)
    reference = flip.FlipReference(4 * b)
    wanted = library.evaluate(4 * b, 4 * a, "HDR", False, False, False)[0][..., 0]
    found = reference.hdr_map(4 * a)
    assert np.abs(found - wanted).max() < 1e-3
    assert found.mean(dtype=float) == pytest.approx(wanted.mean(dtype=float), abs=1e-4)
    assert np.abs(flip.FlipReference(b).map(a)
                  - flip.flip_map(*map(srgb_from_linear, (a, b)))).max() < 1e-3


def test_hdr_flip_has_the_exposures_that_the_library_finds_itself():
    library = pytest.importorskip("flip_evaluator")
    image, reference = images(height=32, width=32)
    _, score, found = library.evaluate(reference, image, "HDR", False, False)
    assert flip.exposures(reference) == pytest.approx(
        (found["startExposure"], found["stopExposure"]), abs=1e-3)
    assert flip.hdr_flip(image, reference) == pytest.approx(score, rel=1e-3)


@pytest.mark.parametrize("reference", [
    np.full((5, 6, 3), 3.0), np.full((5, 6, 3), 1e30),
    1e-20 + np.eye(6)[..., None] * [9.0, 0.0, 1.0]])
def test_hdr_flip_survives_references_without_a_range(reference):
    value = flip.hdr_flip(np.full(reference.shape, 0.4, np.float32), reference.astype(np.float32))
    assert value is not None
    assert 0 < value <= 1
    start, stop = flip.exposures(reference)
    assert start <= stop <= start + 24


def test_hdr_flip_is_not_measured_where_a_display_shows_everything():
    image, _ = images()
    assert flip.hdr_flip(image, np.full(image.shape, 0.9)) is None


# The reference's own noise


def noisy_references(level: float, sigma: float, count: int = 40):
    """The truth, and noisy measurements of it."""
    rng = np.random.default_rng(3)
    truth = level * rng.uniform(0.8, 1.2, (48, 48, 3))
    return truth, [truth + sigma * rng.standard_normal(truth.shape) for _ in range(count)]


@pytest.mark.parametrize(("level", "sigma"), [
    (0.3, 0.02),      # smooth part of the curve
    (0.001, 0.0008),  # the toe, and clipping at 0
    (1.0, 0.05),      # half of it clipped at 1
    (0.004, 0.002),   # across the knee between the curve's pieces
])
def test_the_floor_is_what_a_perfect_image_scores_against_noisy_references(level, sigma):
    truth, references = noisy_references(level, sigma)
    display = srgb_from_linear(truth)
    scored = decibels(float(np.mean([mse(display, srgb_from_linear(b)) for b in references])))
    floor = reference_floor(truth, np.full(truth.shape, sigma ** 2))
    assert floor == pytest.approx(scored, abs=0.2)


@pytest.mark.parametrize(("level", "sigma"), [(0.3, 0.02), (0.01, 0.001), (1.0, 0.05)])
def test_the_floor_of_a_noisy_reference_is_that_of_the_truth(level, sigma):
    truth, references = noisy_references(level, sigma, count=1)
    variance = np.full(truth.shape, sigma ** 2)
    assert reference_floor(references[0], variance) == pytest.approx(
        reference_floor(truth, variance), abs=0.15)


def test_in_the_smooth_part_the_floor_is_the_delta_method():
    b, sigma = np.full((8, 8, 3), 0.4), 1e-3
    slope = 1.055 / 2.4 * 0.4 ** (1 / 2.4 - 1)
    expected = -20 * math.log10(slope * sigma)
    assert reference_floor(b, np.full(b.shape, sigma ** 2)) == pytest.approx(expected, abs=0.01)


def test_four_times_the_samples_raise_the_floor_by_6_db():
    b = np.random.default_rng(0).uniform(0.1, 0.8, (9, 9, 3))
    variance = 1e-5 * b
    gain = reference_floor(b, variance / 4) - reference_floor(b, variance)
    assert gain == pytest.approx(10 * math.log10(4), abs=0.01)


def test_a_noise_free_reference_has_no_floor():
    _, reference = images()
    assert reference_floor(reference, np.zeros_like(reference)) == PSNR_CAP


def test_noise_that_the_display_clips_does_not_lower_the_floor():
    assert reference_floor(np.full((3, 3, 3), 5.0), np.full((3, 3, 3), 0.01)) == PSNR_CAP


# The table of metrics


def test_every_metric_says_what_it_is():
    for name, metric in METRICS.items():
        assert name == metric.name
        assert metric.space in ("linear", "srgb", "flip")
        assert metric.about
        assert metric.label
        assert f"{1.0:{metric.format}}"
    assert HEADLINE.name in METRICS


def test_energy_error_is_the_difference_of_the_means():
    reference = np.full((3, 4, 3), 2.0, np.float32)
    assert energy_error(reference * [0.9, 1.0, 1.3], reference) == pytest.approx(0.2 / 3, rel=1e-6)
    assert energy_error(reference, 0 * reference) is None
