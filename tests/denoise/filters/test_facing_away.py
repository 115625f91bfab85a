"""The mean of a frame's colour over pixels that face away."""

from __future__ import annotations

import numpy as np

from onespp.denoise.filters.facing_away import RADIUS, colors_facing_away


def test_it_is_the_mean_of_those_around_that_face_away_and_are_of_one_object():
    rng = np.random.default_rng(2)
    color, ids = rng.random((9, 12, 3)), rng.integers(0, 2, (9, 12))
    away = rng.random((9, 12)) < 0.3
    found = colors_facing_away(color, ids, away)
    for (y, x), value in zip(np.argwhere(away), found, strict=True):
        those = [color[v, u] for v, u in np.argwhere(away)
                 if max(abs(v - y), abs(u - x)) <= RADIUS and ids[v, u] == ids[y, x]]
        np.testing.assert_allclose(value, np.mean(those, 0), rtol=1e-6)


def test_a_lone_pixel_keeps_the_colour_of_its_frame():
    color, away = np.ones((3, 4, 3)), np.zeros((3, 4), bool)
    away[2, 3], color[2, 3] = True, (0, 0.5, 2)
    np.testing.assert_array_equal(colors_facing_away(color, np.zeros((3, 4)), away), [(0, 0.5, 2)])


def test_what_is_not_finite_does_not_count():
    color, ids, away = np.ones((1, 3, 3)), np.zeros((1, 3)), np.ones((1, 3), bool)
    color[0, 1, 0] = np.nan
    np.testing.assert_array_equal(colors_facing_away(color, ids, away), np.ones((3, 3)))
    color[:] = np.inf
    np.testing.assert_array_equal(colors_facing_away(color, ids, away), np.zeros((3, 3)))
