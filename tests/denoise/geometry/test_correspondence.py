"""Where each pixel's surface was in the frame before, against the scene itself."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.geometry.correspondence import NOWHERE, carry, previous_pixel
from onespp.render.frame import Frame
from tests.support.frames import make_frame, translation, turn, with_images

FAR = (2e6, -1e6, 3e6)


def moved(**changes) -> tuple[Frame, Frame]:
    origin = changes.pop("origin", (0, 0, 0))
    return (make_frame(31, 42, index=0, origin=origin),
            make_frame(31, 42, index=1, origin=origin, **changes))


def test_in_a_still_scene_each_surface_was_in_its_own_pixel():
    before, now = moved()
    source = previous_pixel(before, now)
    here = np.arange(31 * 42).reshape(31, 42)
    np.testing.assert_array_equal(source, np.where(now["id"] >= 0, here, NOWHERE))


@pytest.mark.parametrize("origin", [(0, 0, 0), FAR])
@pytest.mark.parametrize("changes", [
    {"camera": translation(0.3, 0.1, 0.2)}, {"camera": turn(0.05)},
    {"board": translation(0.7, -0.4, 0.1) @ turn(0.1)},
    {"camera": turn(-0.03), "board": translation(-0.5, 0, 0)}])
def test_the_pixel_found_shows_the_same_point_of_the_texture(origin, changes):
    before, now = moved(origin=origin, **changes)
    source = previous_pixel(before, now)
    there = source != NOWHERE
    assert there.mean() > 0.5
    np.testing.assert_array_equal(carry(before["id"], source)[there], now["id"][there])
    # Half a pixel of a texture of so many radians a unit, seen at a depth of 10:
    half_pixel = 0.5 * np.sqrt(2) * 10 / (1.2 * 42)
    difference = np.abs(carry(before["color"], source) - now["color"])[there]
    assert difference.max() < 0.4 * 1.7 * half_pixel * 1.3
    assert difference.mean() < 0.4 * half_pixel


def test_what_the_board_uncovers_was_not_seen():
    before, now = moved(board=translation(1.0, 0, 0))
    source = previous_pixel(before, now)
    uncovered = (before["id"] == 1) & (now["id"] == 0)
    assert uncovered.sum() > 20
    assert (source[uncovered] == NOWHERE).all()
    assert (source[now["id"] == 1] != NOWHERE).mean() > 0.9


def test_what_comes_into_view_was_not_seen():
    # A wall that faces the camera, on whose plane every pixel lies: only the border tells.
    flat = {"id": np.zeros((31, 42)), "depth": np.full((31, 42), 10.0),
            "normal": np.broadcast_to([0, 0, -1.0], (31, 42, 3))}
    for shift, new in ((-1.5, np.s_[:, :3]), (1.5, np.s_[:, -3:])):
        before, now = (with_images(make_frame(31, 42, camera=translation(i * shift, 0, 0)), **flat)
                       for i in range(2))
        source = previous_pixel(before, now)
        assert (source[new] == NOWHERE).all()
        assert (source != NOWHERE).mean() > 0.5


def test_a_surface_that_turned_away_or_lies_behind_is_another_one():
    before, now = moved()
    other = with_images(before, normal=-before["normal"])
    assert (previous_pixel(other, now) == NOWHERE).all()
    farther = with_images(before, depth=1.1 * before["depth"])
    assert (previous_pixel(farther, now) == NOWHERE).all()


@pytest.mark.parametrize("channel", ["normal", "depth"])
@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_pixels_with_broken_guides_have_no_surface(channel, value):
    before, now = moved()
    image = np.array(now[channel])
    image[3:6, 4:9] = value
    for pair in ((before, with_images(now, **{channel: image})),
                 (with_images(before, **{channel: image}), now)):
        source = previous_pixel(*pair)
        assert (source[3:6, 4:9] == NOWHERE).all()
        assert (source[10:20, 4:9] != NOWHERE).all()


def test_an_object_whose_matrix_cannot_be_inverted_was_not_seen():
    before, now = moved()
    matrices = np.array(now.world_from_object)
    matrices[1] = 0
    flat = Frame(1, now.images, now.camera_from_world, now.screen_from_world, matrices)
    source = previous_pixel(before, flat)
    assert (source[now["id"] == 1] == NOWHERE).all()
    assert (source[now["id"] == 0] != NOWHERE).all()
