"""How close other surfaces are: against geometry, and against numbers that are none."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.filters.contact import (
    Contact,
    black_contact,
    contact_falloff,
    contact_samples,
    dark_in_slits,
    share_of_line,
)
from onespp.denoise.jit.arrays import Color
from onespp.denoise.jit.grid import Stencil, single
from onespp.denoise.jit.taps import window


def test_what_met_something_tells_how_many_pixels_away_it_is():
    stencil = Stencil(1, 4, 1)
    met = contact_samples(stencil.Float([1, 1, 0, 1]) > 0,
                          stencil.Float([0.0, 0.05, 0.05, 1e38]),
                          stencil.Float([0.5, 0.0, np.nan, np.inf]), stencil.Float(10.0))
    np.testing.assert_allclose(met.of_shadows.numpy(), [1, 0.5, 0, 0], rtol=1e-6)
    np.testing.assert_allclose(met.of_paths.numpy(), [1 / 101, 0, 0, 0], rtol=1e-6)
    assert met.of_lobes is None


def test_lobes_show_sharp_what_is_as_close_as_they_are_wide():
    stencil = Stencil(1, 4, 1)
    met = contact_samples(stencil.Float(0) > 0, stencil.Float(0),
                          stencil.Float([0.5, 0.5, 0.5, 0.0]), stencil.Float(10.0),
                          stencil.Float([0.0, 0.1, 1.0, 0.1]))
    assert met.of_lobes is not None
    np.testing.assert_allclose(met.of_lobes.numpy(), [1, 0.5, 0, 0], rtol=1e-6)


def test_light_narrows_with_the_length_of_its_history():
    stencil = Stencil(1, 3, 1)
    around = Contact(stencil.Float([0.0, 0.5, 1]), stencil.Float([0, 0, 0.5]))
    lengths = stencil.Float([1, 1, 9])
    falloff = contact_falloff(around, lengths)
    np.testing.assert_allclose(falloff.diffuse.numpy(), [0, 0.5 / 4, 1.5 * 9 / 12], rtol=1e-6)
    assert falloff.glossy is None
    falloff = contact_falloff(around._replace(of_lobes=stencil.Float([0, 0.5, 1])), lengths)
    assert falloff.glossy is not None
    np.testing.assert_allclose(falloff.glossy.numpy(), [0, 0.5 / 4, 9 / 12], rtol=1e-6)


def test_a_pixel_is_as_dark_as_its_frame_where_both_of_its_rays_met_something_at_once():
    """Both at once, one alone, but in a black line, both half
    a pixel away; a bright frame; black and below."""
    stencil = Stencil(1, 6, 1)
    own = Contact(stencil.Float([1, 1, 0.5, 1, 1, 1]), stencil.Float([1, 0, 0.5, 1, 1, 1]))
    image, frame = ([0.4, 0.4, 0.4, 0.4, 0, -0.1], [0.1, 0.1, 0.1, 3, 1, 1])
    dark = dark_in_slits(*(Color(*[stencil.Float(c) * share for share in (1, 0.5, 0.2)])
                           for c in (image, frame)), own,
                         stencil.Float([0.1, 0.9, 0, 1, 1, 1]))
    expected = [0.4 * (1 - 0.75 * 0.75), 0.4 * (1 - 0.9 * 0.75),
                0.4 * (1 - 0.75 * 0.5**0.5 * 0.75), 0.4, 0, -0.1]
    for found, share in zip(dark, (1, 0.5, 0.2), strict=True):
        np.testing.assert_allclose(found.numpy(), np.multiply(expected, share), rtol=1e-5,
                                   atol=1e-7)


def test_only_a_black_frame_counts_for_a_line():
    stencil = Stencil(1, 4, 1)
    frame = Color(*[stencil.Float(c) for c in ([0, 0.1, 0, np.nan], [0, 0, 0, 0], [0, 0, 1e-9, 0])])
    black = black_contact(frame, stencil.Float([0.5, 0.5, 0.5, 0.5]))
    np.testing.assert_allclose(black.numpy()[:3], [0.5, 0, 0])
    assert np.isfinite(black.numpy()).all()


@pytest.mark.parametrize("step", [(0, 1), (1, 0), (1, 1), (1, -1)])
def test_three_in_line_are_a_slit_and_two_or_a_bend_are_not(step):
    stencil = Stencil(7, 8, 1)
    near = np.zeros((7, 8), np.float32)
    for k, c in ((-1, 0.4), (0, 0.45), (1, 0.2)):
        near[3 + k * step[0], 4 + k * step[1]] = c
    near[0, :2] = near[1, 0] = 1  # a bend, at the edge of the image
    planes = stencil.planes([0.0])
    planes.store(list(stencil.load(near)), gutters=True)
    taps = planes.taps([*window(1), (0, 0)], [0]).named(single)
    share = stencil.rows(share_of_line(taps).numpy())
    expected = np.zeros((7, 8))
    expected[3, 4] = 0.2 / 0.25
    np.testing.assert_allclose(share, expected, rtol=1e-6)
