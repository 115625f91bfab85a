"""Rare bright pixels: against a plain count, and what is not to be taken from."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.filters.peaks import (
    BEFORE_FILTER,
    BEFORE_HISTORY,
    Energies,
    Limits,
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
    (signal,), energies = without_peaks(
        limits, [kind], [Signal(2 * x, x, x)], [stencil.opaque(twice)],
        stencil.opaque(bent) if bent else None, planes.taps(AROUND, [0]),
        planes.taps(AROUND, [1]).named(single))
    assert signal.red is not None
    red, before, after = (stencil.image(Color(v, v, v))[..., 0] for v in (
        signal.red, energies.before[0], energies.after[0]))
    np.testing.assert_allclose(before, light, rtol=1e-6)
    return red, after / np.maximum(light, 1e-30)


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


def test_what_was_taken_comes_back_where_light_is():
    stencil = Stencil(1, 4, 1)
    light = Signal(stencil.Float(2), stencil.Float(1), stencil.Float(0))
    around = Energies([stencil.Float([1.5, 0.0, 19, 1.0])], [stencil.Float([1, 0, 1, 1.0001])])
    (whole,) = with_their_light([light], around)
    assert whole.red is not None
    np.testing.assert_allclose(whole.red.numpy(), [3, 2, 12, 2], rtol=1e-6)


def without_negative(color: np.ndarray) -> np.ndarray:
    """Of the luminance of `color`, on the way from it to grey."""
    grey = np.full(3, color @ LUMINANCE)
    for way in np.linspace(1, 0, 10001):
        if (found := grey + way * (color - grey)).min() >= -1e-9:
            return found
    raise AssertionError


@pytest.mark.parametrize("color", [(0.5, 0.4, 0.3), (-0.05, 0.01, 0.09), (0.9, -0.1, -0.2)])
def test_colour_without_luminance_is_neither_cut_nor_multiplied(color: tuple[float, ...]):
    stencil = Stencil(1, 1, 1)
    linear = np.array(color)
    x = float(linear @ LUMINANCE)
    light = Signal(*(stencil.Float(v) for v in (color[0], x, color[2])))
    (whole,) = with_their_light([light], Energies([stencil.Float(3)], [stencil.Float(1)]))
    red, luminance, blue = (v.numpy()[0] for v in whole if v is not None)
    wanted = linear + 2 * without_negative(linear)
    np.testing.assert_allclose([red, blue], wanted[[0, 2]], atol=1e-3)
    np.testing.assert_allclose(luminance, 3 * x, rtol=1e-5)
