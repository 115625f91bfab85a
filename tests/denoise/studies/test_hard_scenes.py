"""The study of hard scenes: what it says a method is worth."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.metrics.errors import psnr
from onespp.denoise.metrics.image import Target
from onespp.denoise.metrics.tonemap import srgb_from_linear
from onespp.denoise.studies.hard_scenes import _decibels
from tests.support.halved import reference_of

SHAPE = (48, 64, 3)


def test_methods_are_judged_by_halves_of_the_reference():
    """Against the mean, whose noise is twice the method's error, it would be 7 dB less."""
    rng = np.random.default_rng(2)
    truth = rng.uniform(0.2, 0.6, SHAPE).astype(np.float32)
    image = (truth * (1 + 0.02 * rng.standard_normal(SHAPE))).astype(np.float32)
    reference = reference_of(truth, 0.04, [3])
    by_halves, against_mean = (_decibels([image], [target])[0] for target in (
        Target(reference.color, reference.parts), Target(reference.color)))
    exact = psnr(srgb_from_linear(image), srgb_from_linear(truth))
    assert by_halves == pytest.approx(exact, abs=0.5)
    assert against_mean < exact - 5
