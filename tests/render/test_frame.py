"""A frame made by hand: what it may hold, and what is refused in one sentence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from onespp.denoise.catalog import build
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from tests.support.frames import make_frame

FRAME = make_frame(12, 16)


def changed(channel: str, change) -> Frame:
    return replace(FRAME, images={**FRAME.images, channel: change(FRAME[channel])})


@pytest.mark.parametrize(("channel", "change", "words"), [
    ("color", lambda x: (255 * x).astype(np.uint8), "of uint8: use float32"),
    ("color", lambda x: x + 1j, "of complex64"),
    ("color", lambda x: x.astype(str), "of <U32"),
    ("color", lambda x: x > 0.5, "of bool"),
    ("color", lambda x: x.tolist(), "is a list: use a NumPy array"),
    ("color", lambda x: None, "is a NoneType"),
    ("color", lambda x: x[..., :2], r"shape \(12, 16, 2\)"),
    ("id", lambda x: x.astype(complex), "use float32 or int32"),
    ("id", lambda x: x + 0.5, "whole numbers"),
    ("id", lambda x: x.astype(np.int64) + 2**32, "whole numbers"),
    ("id", lambda x: np.full(x.shape, np.nan, np.float32), "whole numbers")])
def test_images_that_no_method_can_take_are_refused(channel, change, words):
    with pytest.raises(InputError, match=f"channel '{channel}' of frame 0 .*{words}"):
        changed(channel, change)


@pytest.mark.parametrize(("name", "value"), [
    ("camera_from_world", np.eye(4)[None]), ("screen_from_world", "abc"),
    ("screen_from_world", [[1, 2], [3]]), ("world_from_object", np.eye(4)),
    ("world_from_object", None)])
def test_matrices_of_another_shape_are_refused(name, value):
    with pytest.raises(InputError, match=f"{name} of frame 0 is not (a )?finite 4x4"):
        replace(FRAME, **{name: value})


@pytest.mark.parametrize("images", [{}, [np.zeros((2, 2), np.float32)],
                                    {"depth": np.zeros((0, 3), np.float32)}])
def test_a_frame_without_pixels_is_refused(images):
    with pytest.raises(InputError, match="frame 0 has no"):
        replace(FRAME, images=images)


@pytest.mark.parametrize("change", [
    np.asfortranarray, lambda x: x[::-1].copy()[::-1],
    lambda x: x.astype(np.float64 if x.dtype == np.float32 else np.int64),
    lambda x: x.astype(x.dtype.newbyteorder(">"))])
@pytest.mark.parametrize("name", ["assignment", "svgf", "onespp"])
def test_the_layout_of_an_array_changes_no_result(name, change):
    method, results = build(name), []
    other = replace(FRAME, images={k: change(v) for k, v in FRAME.images.items()})
    for frame in (FRAME, other):
        state = method.init(12, 16)
        for index in range(2):
            image, state = method(replace(frame, index=index), state)
        results.append(image)
    np.testing.assert_array_equal(*results)


ARRAYS = {"color": np.ones((6, 8, 3)), "depth": np.full((6, 8), 2.0),
          "normal": np.tile([0.0, 0.0, -1.0], (6, 8, 1))}


def test_plain_arrays_make_a_frame():
    depth = np.full((6, 8), 2.0)
    depth[0, :4] = 0, -1, np.inf, np.nan
    frame = Frame.from_arrays(**{**ARRAYS, "depth": depth}, albedo=np.full((6, 8, 3), 0.5))
    assert {image.dtype for name, image in frame.images.items() if name != "id"} == {
        np.dtype(np.float32)}
    np.testing.assert_array_equal(frame["id"][0], [-1, -1, -1, -1, 0, 0, 0, 0])
    np.testing.assert_array_equal(frame["motion"], 0)
    assert frame.world_from_object.shape == (1, 4, 4)
    assert np.isfinite(frame.screen_from_world).all()


def test_matrices_that_are_given_are_taken():
    camera = np.diag([1.0, -1.0, -1.0, 1.0])
    frame = Frame.from_arrays(**ARRAYS, id=np.full((6, 8), 3), camera_from_world=camera,
                              screen_from_world=camera)
    np.testing.assert_array_equal(frame.camera_from_world, camera)
    assert "motion" not in frame
    assert len(frame.world_from_object) == 4


@pytest.mark.parametrize(("arrays", "words"), [
    ({"camera_from_world": np.eye(4)}, "give both, or neither"),
    ({"colour": np.ones((6, 8, 3))}, "unknown channel 'colour'"),
    ({"depth": np.ones((6, 8, 1))}, "expected (h, w)"),
    ({"motion": np.ones((6, 8, 3))}, "expected (h, w, 2)"),
    ({"normal": np.ones((5, 8, 3))}, "the others are 8x6"),
    ({"color": "red"}, "use float32"),
    ({"color": np.ones((6, 8))}, "expected (h, w, 3)"),
    ({"id": np.full((6, 8), 1 << 20)}, "number objects from 0 on"),
    ({"id": np.full((6, 8), 0.5)}, "whole numbers"),
])
def test_arrays_that_make_no_frame_are_refused(arrays, words):
    with pytest.raises(InputError) as caught:
        Frame.from_arrays(**{**ARRAYS, **arrays})
    assert words in str(caught.value)
