"""Rare bright pixels: against a plain count, and what is not to be taken from."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.filters.peaks import (
    BEFORE_FILTER,
    BEFORE_HISTORY,
    Limits,
    Trimmed,
    with_their_light,
    without_peaks,
)
from onespp.denoise.inputs.signals import Signal, SignalKind
from onespp.denoise.jit.arrays import Color
from onespp.denoise.jit.color import LUMINANCE
from onespp.denoise.jit.grid import Stencil, single
from onespp.denoise.jit.taps import window

AROUND = [*window(2), (0, 0)]


def trimmed(light: np.ndarray, ids: np.ndarray,
            kind: SignalKind = SignalKind.DIFFUSE, twice: float = 0,
            limits: Limits = BEFORE_FILTER, bent: float = 0) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) red of what is left of a light whose red is twice its luminance, and its share."""
    stencil = Stencil(*light.shape, 2)
    planes = stencil.planes([0.0, -1.0])
    (x,), (id_,) = stencil.load(light.astype(np.float32)), stencil.load(ids.astype(np.int32))
    planes.store([x, stencil.Float(id_)], gutters=True)
    (signal,), taken = without_peaks(
        limits, [kind], [Signal(2 * x, x, x)], [stencil.opaque(twice)],
        stencil.opaque(bent) if bent else None, planes.taps(AROUND, [0]),
        planes.taps(AROUND, [1]).named(single))
    assert signal.red is not None
    red, left, more = (stencil.image(Color(v, v, v))[..., 0] for v in (
        signal.red, taken.left[0], taken.taken[0].luminance))
    np.testing.assert_allclose(left + more, light, rtol=1e-6)
    return red, left / np.maximum(light, 1e-30)


@pytest.mark.parametrize(("limits", "kind", "times"), [
    (BEFORE_FILTER, SignalKind.DIFFUSE, 2.5), (BEFORE_FILTER, SignalKind.GLOSSY, 1.5),
    (BEFORE_HISTORY, SignalKind.GLOSSY, 4)])
def test_a_peak_keeps_so_many_times_the_mean_around(limits: Limits, kind: SignalKind,
                                                    times: float):
    light = np.ones((7, 7))
    light[3, 3], light[3, 4] = 100, 1.25
    red, share = trimmed(light, np.zeros((7, 7)), kind, limits=limits)
    mean = (23 + 1.25) / 24
    np.testing.assert_allclose(share[3, 3], times * mean / 100, rtol=1e-5)
    np.testing.assert_allclose(red[3, 3], 2 * times * mean, rtol=1e-5)
    share[3, 3] = 1
    np.testing.assert_array_equal(share, 1)  # neighbours of a peak are none


@pytest.mark.parametrize(("limits", "share"), [(BEFORE_FILTER, 0.75), (BEFORE_HISTORY, 3)])
def test_a_peak_that_frame_and_history_have_keeps_a_share_of_the_lesser(limits: Limits,
                                                                        share: float):
    light = np.ones((7, 7))
    light[3, 3] = 100
    _, left = trimmed(light, np.zeros((7, 7)), SignalKind.GLOSSY, 20, limits)
    np.testing.assert_allclose(left[3, 3], share * 20 / 100, rtol=1e-5)


@pytest.mark.parametrize(("kind", "times"), [(SignalKind.DIFFUSE, 2.5), (SignalKind.GLOSSY, 6.5)])
def test_on_a_bent_surface_glossy_light_may_be_brighter_than_around(kind: SignalKind,
                                                                    times: float):
    light = np.ones((7, 7))
    light[3, 3] = 100
    _, share = trimmed(light, np.zeros((7, 7)), kind, bent=0.5)
    np.testing.assert_allclose(share[3, 3], times / 100, rtol=1e-5)


def test_another_object_or_the_dark_around_makes_no_peak():
    light, ids = np.zeros((7, 7)), np.zeros((7, 7), int)
    light[3, 3] = 100  # alone in the dark: nothing is known
    light[:3], ids[:3] = 0.01, 1
    _, share = trimmed(light, ids)
    assert share[3, 3] == 1


def test_what_was_taken_comes_back_where_light_is_in_its_own_colour():
    stencil = Stencil(1, 4, 1)
    light = Signal(stencil.Float(2), stencil.Float(1), stencil.Float(0))
    taken = stencil.Float([0.5, 0, 18, 0])
    around = Trimmed([stencil.Float([1, 0, 1, 1])], [Signal(0 * taken, taken, 3 * taken)])
    (whole,) = with_their_light([light], around)
    red, luminance, blue = (v.numpy() for v in whole if v is not None)
    np.testing.assert_allclose(luminance, [1.5, 1, 6, 1], rtol=1e-6)
    np.testing.assert_allclose(red, 2, rtol=1e-6)
    np.testing.assert_allclose(blue, [1.5, 0, 15, 0], rtol=1e-6)


def without_negative(color: np.ndarray) -> np.ndarray:
    """Of the luminance of `color`, on the way from it to grey."""
    grey = np.full(3, max(color @ LUMINANCE, 0))
    for way in np.linspace(1, 0, 10001):
        if (found := grey + way * (color - grey)).min() >= -1e-9:
            return found
    raise AssertionError


@pytest.mark.parametrize("color", [(90, 100, 80), (-50, 100, 120), (90, 100, -200)])
def test_a_peak_is_light_and_colour_without_luminance_stays(color: tuple[float, ...]):
    stencil = Stencil(7, 7, 2)
    linear = np.array(color)
    images = np.zeros((7, 7, 3))
    images[3, 3] = linear
    luminance = np.maximum(images @ LUMINANCE, 1)
    planes = stencil.planes([0.0, -1.0])
    x, red, blue = (stencil.load(image.astype(np.float32))[0]
                    for image in (luminance, images[..., 0], images[..., 2]))
    planes.store([x, 0 * x], gutters=True)
    _, (_, (taken,)) = without_peaks(
        BEFORE_FILTER, [SignalKind.DIFFUSE], [Signal(red, x, blue)], [stencil.opaque(0)], None,
        planes.taps(AROUND, [0]), planes.taps(AROUND, [1]).named(single))
    share = 1 - 2.5 / luminance[3, 3]
    wanted = share * without_negative(linear)
    for found, component in ((taken.red, wanted[0]), (taken.blue, wanted[2]),
                             (taken.luminance, wanted @ LUMINANCE)):
        image = stencil.image(Color(found, found, found))[..., 0]
        np.testing.assert_allclose(image[3, 3], component, atol=0.02)


@pytest.mark.parametrize("color", [(-1, -1, -1), (-0.5, -0.2, 0.7), (0, 0, 0)])
def test_what_has_no_luminance_stays_as_it_is(color: tuple[float, ...]):
    stencil, values = Stencil(1, 1, 2), (color[0], np.dot(color, LUMINANCE), color[2])
    planes = stencil.planes([0.0, -1.0])
    planes.store([stencil.constant(0), stencil.constant(0)], gutters=True)
    ((signal,), _) = without_peaks(
        BEFORE_FILTER, [SignalKind.DIFFUSE], [Signal(*(stencil.Float(v) for v in values))],
        [stencil.opaque(0)], None, planes.taps(AROUND, [0]), planes.taps(AROUND, [1]).named(single))
    np.testing.assert_allclose([np.ravel(v)[0] for v in signal if v is not None], values, atol=1e-7)
