"""How far glossy light may be filtered on a bent surface: along a tube, and not across."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.filters.bent import BESIDE, along, bend, bent_share, with_history
from onespp.denoise.jit.arrays import Vector3
from onespp.denoise.jit.grid import Stencil, single

SIZE = 9


def bend_of(normals, roughness, ids=0.0):
    """(h, w, 3) the bend of each pixel, (h, w) how bent it is, and the stencil and bend."""
    stencil = Stencil(SIZE, SIZE, 1)
    buffer, surfaces = stencil.planes([0.0] * 3), stencil.planes([-1.0])
    buffer.store(stencil.load(np.broadcast_to(normals, (SIZE, SIZE, 3)).astype(np.float32)),
                 gutters=True)
    surfaces.store(stencil.load(np.broadcast_to(ids, (SIZE, SIZE)).astype(np.float32)))
    bent = bend(buffer.taps(BESIDE, range(3)).named(Vector3),
                surfaces.taps(BESIDE, [0]).named(single), stencil.constant(roughness))
    return stencil.image(list(bent)), stencil.image([bent_share(bent)]), stencil, bent


def tube(turn, slope=(1, 0)):
    """Normals that turn by an angle a pixel, along a direction (x, y) on the screen."""
    y, x = np.mgrid[:SIZE, :SIZE] - SIZE // 2
    angle = turn * (slope[0] * x + slope[1] * y)
    return np.stack([np.sin(angle) * slope[0], np.sin(angle) * slope[1], -np.cos(angle)], -1)


def test_a_flat_surface_is_not_bent_nor_is_one_without_a_lobe():
    for normals, roughness in (([0, 0.6, -0.8], 0.1), (tube(0.1), 1.0)):
        image, share, *_ = bend_of(normals, roughness)
        assert not image.any()
        assert not share.any()


@pytest.mark.parametrize(("slope", "free", "across"), [
    ((1, 0), (1, 0), (0, 1)), ((0, 1), (0, 1), (1, 0)),
    ((0.7, 0.7), (-1, 1), (1, 1)), ((0.7, -0.7), (1, 1), (-1, 1))])
def test_along_a_tube_nothing_is_taken_off_and_across_it_much(slope, free, across):
    """`free` and `across` are offsets (dy, dx)."""
    _, share, stencil, bent = bend_of(tube(0.1, slope), 0.05)
    assert 0.5 < share[4, 4] < 1
    weakened = along(with_history(bent, stencil.constant(1e6)), stencil.opaque(1.0),
                     lambda x, _: x)

    def taken(offset):
        return -float(stencil.image([weakened(stencil.constant(0), offset)])[4, 4])

    assert taken(across) > 1.5
    assert taken(free) < 1e-3


def test_wide_lobes_see_nearly_the_same_and_a_short_history_asks_for_a_wider_filter():
    narrow, wide = (bend_of(tube(0.05), alpha)[0][4, 4, 0] for alpha in (0.05, 0.4))
    assert wide < 0.05 * narrow
    *_, stencil, bent = bend_of(tube(0.05), 0.1)
    image = stencil.image([with_history(bent, stencil.constant(n)).xx for n in (1, 3, 1e6)])
    np.testing.assert_allclose(image[4, 4, :2] / image[4, 4, 2], [0.25, 0.5], rtol=1e-4)


def test_neighbours_of_other_objects_and_of_no_image_do_not_bend_a_surface():
    ids = np.zeros((SIZE, SIZE))
    ids[:, 5:] = 1
    normals = np.where(ids[..., None] > 0, [0.6, 0, -0.8], [0, 0, -1.0])
    assert not bend_of(normals, 0.1, ids)[0].any()
    assert bend_of(normals, 0.1)[0][:, 4:6, 0].all()
