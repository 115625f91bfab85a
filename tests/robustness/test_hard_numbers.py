"""Numbers that break kernels: each kernel against float64 on them, and laws for every method."""

from __future__ import annotations

from functools import cache

import drjit as dr
import numpy as np
import pytest

from onespp.denoise.catalog import METHODS, build, parameters
from onespp.denoise.filters.color_box import RowPass, window_moments
from onespp.denoise.inputs.repair import repair
from onespp.denoise.jit.arrays import Color
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.oracles import filters as oracles
from onespp.render.channels import REPLAY
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.hard import HARD
from tests.support.frames import make_frame, noisy, with_images

from .hard_numbers import (
    CASES,
    EXACT,
    LEAST,
    SIZES,
    UNDERFLOW,
    bad_pixels,
    errors_of,
    filled,
    frames_of,
    run,
    small,
)

each_method = pytest.mark.parametrize("name", METHODS)
each_kernel = pytest.mark.parametrize("name", EXACT)

# Largest relative errors, twice over: `python -m tests.robustness.hard_numbers`. Negative radiance
# cancels.
BOUND = 2e-4
BOUNDS = {"negative radiance": 2.5e-3, "65504 radiance": 6e-4, "all denormal": 1e-2}


@each_kernel
@pytest.mark.parametrize("case", CASES)
def test_a_kernel_agrees_with_float64_on_hard_numbers(name, case):
    assert errors_of(name, case).max() < BOUNDS.get(case, BOUND)


@each_kernel
@pytest.mark.parametrize("size", SIZES)
def test_a_kernel_agrees_with_float64_at_any_size(name, size):
    assert errors_of(name, "plain", size).max() < BOUND


@pytest.mark.parametrize("name", [n for n in EXACT if not n.startswith("gaussian")])
def test_a_kernel_whose_weights_all_underflow_leaves_pixels_as_they_are(name):
    assert errors_of(name, "all far apart", **UNDERFLOW).max() < BOUND
    frame = frames_of("all far apart")[-1]
    np.testing.assert_allclose(run(name, [frame], **UNDERFLOW), frame["color"], rtol=2e-6)


def test_the_cases_are_as_hard_as_they_say():
    bad = {case for case in CASES if bad_pixels(frames_of(case)[-1]).any()}
    assert bad == {"NaN radiance", "+inf radiance", "-inf radiance", "one NaN channel",
                   "1e30 radiance"}
    tiny = frames_of("all denormal")[-1]["color"]
    assert 0 < tiny.max() < LEAST
    assert np.ptp(frames_of("1e4 +- 1e-3")[-1]["color"]) == pytest.approx(2e-3, rel=0.1)
    assert frames_of("ID too large")[-1]["id"].max() > 1000


BAD = (np.nan, np.inf, -np.inf, 1e30, -1e30, (np.nan, 0.3, 0.3), (0.3, 0.3, np.nan))


def with_bad_pixel(frame, value):
    color = np.array(frame["color"])
    color[12, 20] = value
    return with_images(frame, color=color)


@each_method
def test_a_bad_pixel_stays_one_its_neighbours_are_as_if_it_were_missing(name):
    """To the bit the same whatever is bad about it, now and in frames to come.

    Missing: filled in with the mean of its object's pixels around.
    """
    still = [noisy(make_frame(24, 40, index=i), seed=i) for i in range(4)]
    broken = with_bad_pixel(still[1], np.nan)
    whole = with_images(broken, color=filled(broken))
    images = history(name, [still[0], whole, *still[2:]])
    for value in BAD:
        again = history(name, [still[0], with_bad_pixel(still[1], value), *still[2:]])
        np.testing.assert_array_equal(again, images)


# A network sees all of an image this small, by its coarsest level and what is around there.
@pytest.mark.parametrize("name", [n for n in METHODS if n not in ("rae-quarter", "unet-half")])
def test_a_bad_pixel_changes_nothing_out_of_reach(name):
    frames = [noisy(make_frame(24, 40, index=i, wall_end=1e9), seed=i) for i in range(2)]
    good = history(name, frames, levels=1)[-1]
    broken = history(name, [frames[0], with_bad_pixel(frames[1], np.nan)], levels=1)[-1]
    y, x = np.mgrid[:24, :40]
    far = np.maximum(abs(y - 12), abs(x - 20)) > 11
    assert far.mean() > 0.3
    np.testing.assert_array_equal(broken[far], good[far])
    assert np.abs(broken - good).max() < 0.5


def history(name, frames, **settings):
    method = build(name, small(name, **settings))
    state, images = method.init(frames[0].height, frames[0].width), []
    for frame in frames:
        image, state = method(frame, state)
        images.append(image)
    return images


@pytest.mark.parametrize("radius", [3, 8])
def test_what_fills_a_bad_pixel_weighs_less_than_a_noisy_pixel_would(radius):
    """How far "filled in" is from "left out": of a pixel so bright that its weight is 0."""
    frame = noisy(make_frame(33, 37, wall_end=1e9), seed=3)
    color = np.array(frame["color"])
    color[16, 20] = 1e9
    left_out = oracles.bilateral(with_images(frame, color=color), radius)
    there = oracles.bilateral(frame, radius)
    color[16, 20] = np.nan
    result = run("bilateral", [with_images(frame, color=color)], radius=radius)
    others = np.ones((33, 37), bool)
    others[16, 20] = False
    assert abs(result - left_out)[others].max() < abs(there - left_out)[others].max() < 0.02


@cache
def rendered():
    """Three frames with a mirror, which have every channel there is."""
    renderer = Renderer(HARD["mirror"].make(), 16, 24, direct="resampled", sampler="zsobol")
    channels = (*renderer.channels, *REPLAY)
    return [renderer.frame(i, channels=channels) for i in range(3)]


@each_method
def test_a_broken_pixel_in_each_channel_leaves_finite_images(name):
    """Each channel at another pixel of a frame, with good ones before and after it."""
    method, frames = build(name, small(name, demodulate=True)), rendered()
    _, before = method(frames[0], method.init(16, 24))
    for value in (np.nan, np.inf, -np.inf, 1e30, -1.0, 0.0):
        images = {k: np.array(image) for k, image in frames[1].images.items()}
        for i, image in enumerate(images.values()):
            whole = image.dtype == np.int32
            at = i % 16, (i + 4) % 24
            image[at] = (-2**31 if value == -np.inf else 2**31 - 1) if whole else value
        result, state = method(with_images(frames[1], **images), before)
        assert np.isfinite(result).all(), value
        result, _ = method(frames[2], state)
        assert np.isfinite(result).all(), value
        assert np.abs(result).max() < 2 * max(f["color"].max() for f in frames), value


@each_method
@pytest.mark.parametrize("everywhere", [False, True])
def test_radiance_up_to_the_limit_over_a_dark_albedo_stays_finite(name, everywhere):
    """Divided by an albedo of 0.01, and squared for its variance."""
    frames = []
    for frame in frames_of("plain"):
        factor = np.ones((13, 17, 1))
        factor[slice(None) if everywhere else 6] = 3e17
        color = frame["color"] * factor
        frames.append(with_images(frame, color=color, direct=color, indirect=0 * color,
                                  albedo=np.full_like(color, 0.0101)))
    assert np.isfinite(run(name, frames, demodulate=True)).all()


@pytest.mark.parametrize("spread", [0.0, 1e-3])
def test_the_variance_of_a_constant_window_survives_cancellation(spread):
    """7x7 of 1e4 +- 1e-3, where E[x^2] - E[x]^2 in float32 would be off by 8, not by 1e-7.

    Floats there are 1e-3 apart, and the deviation is right to half of that.
    """
    color = (1e4 + np.random.default_rng(0).choice([-spread, spread], (15, 15, 3))).astype(
        np.float32)
    stencil = Stencil(15, 15, 3)
    lanes = [x + 0 for x in stencil.load(color)]
    dr.eval(lanes)
    along_rows = RowPass.make(stencil, 3)
    _, sigma = window_moments(stencil, along_rows.rows_around(along_rows(Color(*lanes))))
    low, high = oracles.clamp_box(color, 3, 1.0)
    assert abs(stencil.image(sigma) - (high - low) / 2).max() < 5e-4
    assert spread == 0 or (high - low).max() > 1e-3


@each_method
def test_a_bright_wall_that_is_all_but_constant_stays_within_its_own_values(name):
    frames = frames_of("1e4 +- 1e-3")[1:]
    color = frames[-1]["color"]
    result = run(name, [with_images(f, direct=f["color"], indirect=0 * f["color"])
                        for f in frames])
    np.testing.assert_allclose(result, color, rtol=1.3e-6)


def test_a_single_plane_is_filled_too():
    image = np.ones((5, 6, 1), np.float32)
    image[2, 3] = np.nan
    np.testing.assert_array_equal(repair(image, np.zeros((5, 6), np.int32)), np.ones((5, 6, 1)))


def test_filling_in_float64_agrees_with_the_kernels_repair():
    for case in ("NaN radiance", "1e30 radiance"):
        frame = frames_of(case)[-1]
        np.testing.assert_allclose(repair(frame["color"], frame["id"]), filled(frame), rtol=2e-7)


@each_method
def test_the_settings_here_are_small(name):
    known, chosen = parameters(METHODS[name]()), small(name)
    assert set(chosen) == set(known) & {"radius", "levels", "output_levels", "sharp_output_levels",
                                        "block_size", "demodulate"}
