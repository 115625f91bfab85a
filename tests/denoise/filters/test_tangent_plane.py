"""Tangent planes that count less where a surface is rough."""

from __future__ import annotations

import numpy as np

from onespp.denoise.filters.tangent_plane import RING, SurfaceTap, loosened, roughness
from onespp.denoise.inputs.surface import TangentPlane
from onespp.denoise.jit.grid import Stencil, single
from onespp.denoise.jit.taps import window

SCALE = 100.0  # a hundredth is tolerated


def share(inverse_depth, id_=None, dx=0.0, dy=0.0):
    """What a plane counts for, (h, w): of these 1/z and slopes."""
    inverse_depth = np.asarray(inverse_depth, np.float32)
    shape = inverse_depth.shape
    stencil = Stencil(*shape, 2)
    planes = stencil.planes([-1e15, -1.0, 0.0])
    images = inverse_depth, np.zeros(shape) if id_ is None else id_
    loaded = [stencil.load(np.asarray(image, np.float32))[0] for image in images]
    planes.store(loaded)
    taps = planes.taps([*window(1), (0, 0)], [0, 1]).named(SurfaceTap)
    plane = TangentPlane(loaded[0], *(stencil.Float(v) for v in (dx, dy, SCALE)))
    rough = roughness(taps, plane)
    planes.store(rough.share, first=2)
    after = loosened(planes.taps(RING, [2]).named(single), rough, plane)
    scale, of_x, of_y = (stencil.image([value]) for value in (after.scale, after.dx, after.dy))
    np.testing.assert_allclose(of_x, scale / SCALE * dx, rtol=1e-6)
    np.testing.assert_allclose(of_y, scale / SCALE * dy, rtol=1e-6)
    return scale / SCALE


def test_a_plane_an_edge_a_crease_and_a_bend_are_not_rough():
    y, x = np.mgrid[:9, :9]
    np.testing.assert_allclose(share(1 + 0.1 * x - 0.2 * y, dx=0.1, dy=-0.2), 1, rtol=1e-4)
    np.testing.assert_array_equal(share(1 + (x > 4))[1:-1], 1)
    np.testing.assert_allclose(share(1 + 0.1 * np.maximum(x - 4, 0))[1:-1, :5], 1, rtol=1e-6)
    np.testing.assert_allclose(share(1 + 0.1 * np.abs(x - y) * (x > y))[1:-1, 1:-1][
        np.tril_indices(7)], 1, rtol=1e-6)


def test_where_every_line_leaves_the_plane_it_counts_by_the_least_line():
    around = 1 + np.array([[0.3, -0.02, 0.4], [0.5, 0, 0.1], [-0.2, 0.03, 0.6]])
    # The greater distances of the lines: \\ 0.6, | 0.03, / 0.4, - 0.5.
    assert np.isclose(share(around)[1, 1], 1 / (1 + 0.03 * SCALE), rtol=1e-4)


def test_neighbours_of_other_objects_and_lamps_make_nothing_rough():
    around = 1 + np.array([[0.3, -0.02, 0.4], [0.5, 0, 0.1], [-0.2, 0.03, 0.6]])
    alone = np.ones((3, 3))
    alone[1, 1] = 0
    assert share(around, alone)[1, 1] == 1
    lamps = np.full((3, 3), -2e8)
    lamps[1, 1] = 1
    assert share(lamps)[1, 1] == 1
    assert share(-lamps)[1, 1] == 1


def test_leaves_that_are_objects_of_their_own_are_rough_and_corners_are_not():
    leaves = 1 + np.random.default_rng(0).uniform(-0.5, 0.5, (12, 12))
    rough = share(leaves)[2:-2, 2:-2]
    assert rough.max() < 0.7
    np.testing.assert_allclose(share(leaves, np.arange(144).reshape(12, 12))[2:-2, 2:-2], rough,
                               rtol=1e-5)
    y, x = np.mgrid[:12, :12]
    nearer = np.abs(x - 5.5) + np.abs(y - 5.5) < 4  # no line follows its corners
    assert share(1 + nearer).min() < 0.1
    np.testing.assert_array_equal(share(1 + nearer, nearer), 1)
