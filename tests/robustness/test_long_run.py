"""Hundreds of frames of a still scene: no drift, no growth, and the noise that theory leaves.

2000 frames with `pytest -m slow`.
"""

from __future__ import annotations

import drjit as dr
import numpy as np
import pytest

from onespp.denoise.catalog import METHODS, build, parameters
from onespp.denoise.run.peak_memory import PeakMemory
from tests.support.frames import make_frame, noisy, with_images

HEIGHT, WIDTH, SIGMA, WARM = 48, 64, 0.1, 40
STILL = make_frame(HEIGHT, WIDTH, wall_end=1e9)
PLAIN = {"demodulate": "false", "radius": "3", "levels": "2", "output_levels": "2",
         "sharp_output_levels": "2"}

# A network's weights do not add up to one: it keeps no mean exactly.
LEARNED = {"rae-quarter", "unet-half"}

# Settings that leave accumulation alone: nothing is clamped, and no pixel is like another.
ALONE = {"color_box": "1e6", "sigma_color": "1e-12", "sigma_luminance": "1e-12"}


def made(name, settings):
    known = parameters(METHODS[name]())
    return build(name, {k: v for k, v in settings.items() if k in known})


def has_history(name):
    method = made(name, PLAIN)
    first, _ = method(noisy(STILL, 1), method.init(HEIGHT, WIDTH))
    again, _ = method(noisy(STILL, 1), method(noisy(STILL, 2), method.init(HEIGHT, WIDTH))[1])
    return not np.array_equal(first, again)


def gray_frames(count):
    """Frames of radiance 1 with Gaussian noise."""
    rng = np.random.default_rng(11)
    for _ in range(count):
        yield with_images(STILL, color=1 + SIGMA * rng.standard_normal((HEIGHT, WIDTH, 3)))


def kernels_of(function):
    """What a call launches, and how much of that it had to compile or load; its result."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        result = function()
        dr.sync_thread()
        history = dr.kernel_history([dr.KernelType.JIT])
    launched = [(k["hash"], k["size"], k["operation_count"]) for k in history]
    return launched, sum(not k["cache_hit"] for k in history), result


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("count", [200, pytest.param(2000, marks=pytest.mark.slow)])
def test_a_long_still_scene_neither_drifts_nor_grows(name, count):
    if not has_history(name) or (name in LEARNED and count == 200):  # whose frames take long
        count = WARM + 20
    method = made(name, PLAIN)
    state, given, got, first = method.init(HEIGHT, WIDTH), [], [], None
    memory = PeakMemory()
    for i, frame in enumerate(gray_frames(count)):
        launched, compiled, (image, state) = kernels_of(
            lambda frame=frame, state=state: method(frame, state))
        if i == WARM:
            first, memory = launched, PeakMemory()
        if i >= WARM:
            assert launched == first, i
            assert not compiled, i
            given.append(frame["color"].mean(dtype=np.float64))
            got.append(image.mean(dtype=np.float64))
    PeakMemory()  # gives back what the histories of kernels took: 3 MB a frame for a network
    memory.begin()
    method(STILL, state)
    memory.end()
    off = 0.1 if name in LEARNED else 1e-4  # share of the radiance, which is 1
    assert abs(np.mean(got) - np.mean(given)) < off
    later = len(got) // 2
    assert abs(np.mean(got[later:]) - np.mean(given[later:])) < off
    assert (memory.megabytes or 0) < 8  # a frame's history is 0.2 MB


def expected_variance(alpha, count, ramp):
    """Variance over the input's after 1, 2, ... frames of weight max(alpha, 1/n), or alpha."""
    v, values = 1.0, []
    for n in range(1, count + 1):
        a = 1.0 if n == 1 else max(alpha, 1 / n) if ramp else alpha
        v = (1 - a)**2 * v + a**2
        values.append(v)
    return values


def measured_variance(name, settings, count):
    method = made(name, {**PLAIN, **ALONE, **settings})
    state, values = method.init(HEIGHT, WIDTH), []
    for frame in gray_frames(count):
        image, state = method(frame, state)
        values.append(np.mean((image - 1.0)**2, dtype=np.float64) / SIGMA**2)
    return np.array(values)


@pytest.mark.parametrize(("name", "settings", "alpha", "ramp"), [
    ("temporal", {}, 0.2, False),
    ("temporal", {"alpha": "0.05"}, 0.05, False),
    ("assignment", {}, 0.2, False),
    ("assignment-atrous", {"alpha": "0.1"}, 0.1, False),
    ("svgf", {"alpha": "0.05", "levels": "1"}, 0.05, True),
    ("svgf", {"alpha": "1e-6", "levels": "1"}, 1 / 32, True)])
def test_noise_of_a_still_scene_falls_to_the_floor_of_alpha(name, settings, alpha, ramp):
    """As 1/n while weights are 1/n; to alpha / (2 - alpha) where they stay at alpha."""
    count = 150
    measured = measured_variance(name, settings, count)
    expected = np.array(expected_variance(alpha, count, ramp))
    np.testing.assert_allclose(measured, expected, rtol=0.08)  # 1.5 % deviation each
    if ramp:
        np.testing.assert_allclose(expected[:19], 1 / np.arange(1, 20))
    settled = expected < 1.01 * expected[-1]
    assert settled.sum() >= 40
    floor = alpha / (2 - alpha)
    assert expected[-1] == pytest.approx(floor, rel=0.01)
    assert measured[settled].mean() == pytest.approx(floor, rel=0.025)
