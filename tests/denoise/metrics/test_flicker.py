"""Measures of change over time, against plain loops and cases with known answers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from onespp.denoise.geometry.correspondence import NOWHERE
from onespp.denoise.metrics.errors import PSNR_CAP
from onespp.denoise.metrics.flicker import Step, boiling, difference_psnr, flicker
from onespp.denoise.metrics.table import STABILITY


def step(seed: int = 0, height: int = 5, width: int = 6) -> Step:
    rng = np.random.default_rng(seed)
    now, before = (tuple(rng.uniform(0, 1, (2, height, width, 3)).astype(np.float32))
                   for _ in range(2))
    source = rng.integers(-1, height * width, (height, width))
    return Step(now, before, source, rng.random((height, width)) < 0.5)


def test_flicker_equals_its_formula_written_as_a_loop():
    s = step()
    squares = []
    for y, x in np.ndindex(5, 6):
        if s.source[y, x] != NOWHERE:
            row, column = divmod(int(s.source[y, x]), 6)
            for c in range(3):
                error = float(s.now[0][y, x, c]) - float(s.now[1][y, x, c])
                old = float(s.before[0][row, column, c]) - float(s.before[1][row, column, c])
                squares.append((error - old) ** 2)
    assert flicker(s) == pytest.approx(math.sqrt(np.mean(squares)))


def test_boiling_and_differences_equal_their_formulas_written_as_loops():
    s = step()
    still, differences = [], []
    for y, x, c in np.ndindex(5, 6, 3):
        a, b = (float(i[y, x, c]) for i in s.now)
        a0, b0 = (float(i[y, x, c]) for i in s.before)
        differences.append(((a - a0) - (b - b0)) ** 2)
        if s.still[y, x]:
            still.append((a - a0) ** 2)
    assert boiling(s) == pytest.approx(math.sqrt(np.mean(still)))
    assert difference_psnr(s) == pytest.approx(-10 * math.log10(np.mean(differences)))


def test_an_error_that_sticks_to_the_surface_does_not_flicker():
    rng = np.random.default_rng(1)
    truth, error = rng.uniform(0.2, 0.8, (2, 8, 9, 3))
    shifted = np.roll(error, 1, axis=1)  # everything moves a pixel to the right
    source = np.roll(np.arange(72).reshape(8, 9), 1, axis=1)
    s = Step((truth + shifted, truth), (truth + error, truth), source, None)
    assert flicker(s) == pytest.approx(0, abs=1e-12)
    assert difference_psnr(s) < 20  # which it does where nothing follows the motion


def test_independent_noise_flickers_by_the_root_of_two():
    rng = np.random.default_rng(2)
    truth = np.full((60, 60, 3), 0.5)
    noisy = [truth + 0.1 * rng.standard_normal(truth.shape) for _ in range(2)]
    here = np.arange(3600).reshape(60, 60)
    s = Step((noisy[1], truth), (noisy[0], truth), here, here >= 0)
    assert flicker(s) == pytest.approx(0.1 * math.sqrt(2), rel=0.02)
    assert boiling(s) == pytest.approx(flicker(s))


def test_a_constant_error_is_stable():
    s = step()
    constant = Step((s.now[1] + 0.25, s.now[1]), (s.before[1] + 0.25, s.before[1]), s.source, None)
    assert flicker(constant) == pytest.approx(0, abs=1e-6)
    assert difference_psnr(constant) > 120


def test_the_reference_itself_is_stable():
    s = step()
    same = Step((s.now[1], s.now[1]), (s.before[1], s.before[1]), s.source, s.still)
    assert flicker(same) == 0
    assert difference_psnr(same) == PSNR_CAP


def test_nothing_to_measure_on_is_none():
    s = step()
    nowhere = Step(s.now, s.before, np.full((5, 6), NOWHERE), np.zeros((5, 6), bool))
    assert flicker(nowhere) is boiling(nowhere) is None
    without = Step(s.now, s.before, None, None)
    assert flicker(without) is boiling(without) is None
    assert difference_psnr(without) == difference_psnr(s)


def test_every_row_says_what_it_is():
    for name, row in STABILITY.items():
        assert name == row.name
        assert row.space == "step"
        assert row.about
        assert f"{1.0:{row.format}}"
