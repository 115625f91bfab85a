"""Which meshes are boxes, and what they are as slabs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from onespp.render.mitsuba.boxes import half_edges, slab_words
from onespp.scenes.description import Mesh, Sphere
from onespp.scenes.meshes import box, merge, rounded_box

LINEAR = np.array([[0.6, 0.2, 0.1], [-0.3, 1.1, 0.2], [0.5, -0.1, 0.9]])


def moved(mesh: Mesh, linear: np.ndarray, by=(0.3, -2.0, 5.0)) -> Mesh:
    return replace(mesh, vertices=mesh.vertices @ linear.T + by, normals=None)


@pytest.mark.parametrize("linear", [np.eye(3), LINEAR, 1e-3 * LINEAR])
@pytest.mark.parametrize("size", [(1, 2, 3), (2, 2, 0.01)])
def test_boxes_are_found_however_they_lie(linear, size):
    found = half_edges(moved(box(size), linear))
    assert found is not None
    np.testing.assert_allclose(found[0], (0.3, -2, 5), atol=1e-9)
    ours = np.abs(np.linalg.inv(linear) @ found[1:].T).T
    np.testing.assert_allclose(ours[ours.argmax(0)], np.diag(size) / 2, atol=1e-9)


def test_what_is_no_box_is_none():
    whole = box((1, 2, 3))
    assert half_edges(whole) is not None
    assert whole.normals is not None
    open_ = replace(whole, faces=whole.faces[:-2])
    smooth = replace(whole, normals=whole.vertices)
    corner = (whole.vertices == [0.5, 1, 1.5]).all(1, keepdims=True)
    dented = replace(whole, vertices=whole.vertices + 0.2 * corner, normals=None)
    inside = replace(whole, faces=np.concatenate([whole.faces[:-1], [[0, 6, 11]]]), normals=None)
    flat = replace(whole, vertices=whole.vertices * (1, 1, 0), normals=None)
    for other in (open_, smooth, dented, inside, flat, rounded_box((1, 2, 3), 0.1),
                  merge(moved(whole, np.eye(3)), moved(whole, LINEAR)), Sphere()):
        assert half_edges(other) is None


def test_words_tell_the_thinnest_side():
    """Points on the sides of a slab, one apart from the middle of each, in its own coordinates."""
    found = half_edges(moved(box((2, 0.1, 3)), LINEAR))
    assert found is not None
    (words,) = slab_words(found[None], np.array([1.5]))
    centre, rows, normal = words[:3], words[3:12].reshape(3, 3), words[12:15]
    corners = moved(box((2, 0.1, 3)), LINEAR).vertices
    np.testing.assert_allclose(np.abs((corners - centre) @ rows.T), 1, rtol=1e-4)
    heights = (corners - centre) @ normal
    np.testing.assert_allclose(np.abs(heights), words[15] / 2, rtol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(normal), 1, rtol=1e-6)
    assert words[15] < 0.12
    assert words[16] == 1.5


def test_what_has_no_volume_has_no_words():
    """A box that a motion flattens, or shrinks to nothing, for a frame."""
    found = half_edges(box((2, 0.1, 3)))
    assert found is not None
    boxes = np.stack([0 * found, found * (1, 0, 1), found])
    words = slab_words(boxes, np.array([1.5, 1.5, 1.5]))
    assert not words[:2].any()
    assert words[2].any()
