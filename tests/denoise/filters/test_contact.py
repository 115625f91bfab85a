"""How close other surfaces are: against geometry, and against numbers that are none."""

from __future__ import annotations

import numpy as np

from onespp.denoise.filters.contact import (
    Contact,
    contact_falloff,
    contact_samples,
    dark_in_slits,
)
from onespp.denoise.jit.arrays import Color
from onespp.denoise.jit.grid import Stencil


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
    np.testing.assert_allclose(falloff.diffuse.numpy(), [0, 0.5 / 4, 2 * 9 / 12], rtol=1e-6)
    assert falloff.glossy is None
    falloff = contact_falloff(around._replace(of_lobes=stencil.Float([0, 0.5, 1])), lengths)
    assert falloff.glossy is not None
    np.testing.assert_allclose(falloff.glossy.numpy(), [0, 0.5 / 4, 9 / 12], rtol=1e-6)


def test_a_pixel_is_as_dark_as_its_frame_where_both_of_its_rays_met_something_at_once():
    """Both at once, one alone, both half a pixel away; a bright frame; black and below."""
    stencil = Stencil(1, 6, 1)
    own = Contact(stencil.Float([1, 1, 0.5, 1, 1, 1]), stencil.Float([1, 0, 0.5, 1, 1, 1]))
    image, frame = ([0.4, 0.4, 0.4, 0.4, 0, -0.1], [0.1, 0.1, 0.1, 3, 1, 1])
    dark = dark_in_slits(*(Color(*[stencil.Float(c) * share for share in (1, 0.5, 0.2)])
                           for c in (image, frame)), own)
    expected = np.array([0.4 * (1 - 0.75 * 0.75), 0.4, 0.4 * (1 - 0.75 * 0.5**0.5 * 0.75), 0.4,
                         0, -0.1])
    for found, share in zip(dark, (1, 0.5, 0.2), strict=True):
        np.testing.assert_allclose(found.numpy(), expected * share, rtol=1e-5, atol=1e-7)
