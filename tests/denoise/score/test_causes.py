"""Pixels by cause, in scenes where each cause is known."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.geometry.correspondence import NOWHERE, previous_pixel
from onespp.denoise.score.causes import (
    CAUSES,
    HISTORIES,
    causes,
    changed_light,
    history_class,
    lengthen,
    near_edge,
)
from onespp.render.files.sequence import Reference
from tests.support.frames import make_frame, translation, with_images

NAMES = list(CAUSES)
H, W = 31, 42


def reference(frame, light=1.0, sigma=0.0) -> Reference:
    color = (frame["color"] * light).astype(np.float32)
    return Reference(color, np.full_like(color, sigma**2), 64)


def classified(before, now, light_before=1.0, light_now=1.0, sigma=0.0):
    source = previous_pixel(before, now)
    lit = changed_light(before, now, reference(before, light_before, sigma),
                        reference(now, light_now, sigma), source)
    return np.array(NAMES)[causes(before, now, source, lit)]


def plain(**changes):
    """A frame without texture, as one that is divided by its albedo."""
    frame = make_frame(H, W, **changes)
    return with_images(frame, color=np.full((H, W, 3), 0.5), albedo=np.ones((H, W, 3)))


def test_a_still_scene_is_static_but_for_edges_and_background():
    found = classified(plain(), plain(index=1))
    frame = plain()
    assert (found[frame["id"] < 0] == "background").all()
    edge = near_edge(frame) & (frame["id"] >= 0)
    assert (found[edge] == "edge").all()
    assert (found[~edge & (frame["id"] >= 0)] == "static").all()


def test_a_moving_board_is_moving_and_uncovers_what_was_behind():
    before, now = plain(), plain(index=1, board=translation(1.0, 0, 0))
    found = classified(before, now)
    board = now["id"] == 1
    assert (found[board] == "moving").mean() > 0.9
    assert not (found[~board] == "moving").any()
    uncovered = (before["id"] == 1) & (now["id"] == 0)
    assert (found[uncovered] == "disoccluded").all()


def test_a_light_that_dims_in_one_half_is_a_change_of_light_there():
    light = np.ones((H, W, 1))
    light[:, :W // 2] = 0.8
    found = classified(plain(), plain(index=1), 1.0, light, sigma=0.001)
    surface = plain()["id"] >= 0
    assert (found[:, :W // 2 - 2][surface[:, :W // 2 - 2]] == "light").all()
    assert not (found[:, W // 2 + 2:] == "light").any()


def test_reflections_are_apart_from_motion_light_and_edges_and_need_a_history():
    before, now = plain(), plain(index=1, board=translation(1.0, 0, 0))
    mirror = [with_images(f, roughness=np.full((H, W), 0.25)) for f in (before, now)]
    found, without = classified(*mirror, 1.0, 0.8), classified(before, now, 1.0, 0.8)
    assert set(found.ravel()) == {"background", "disoccluded", "glossy"}
    for name in ("background", "disoccluded"):
        np.testing.assert_array_equal(found == name, without == name)
    assert {"moving", "light"} <= set(without.ravel())
    assert "glossy" not in without


def test_a_dull_lobe_is_not_glossy():
    rough = [with_images(plain(index=i), roughness=np.full((H, W), 0.26)) for i in range(2)]
    assert "glossy" not in classified(*rough)


@pytest.mark.parametrize("change", [0.97, 1.03])
def test_a_change_below_5_percent_is_none(change):
    assert not (classified(plain(), plain(index=1), 1.0, change) == "light").any()


def test_noise_of_the_reference_is_no_change_of_light():
    rng = np.random.default_rng(0)
    before, now = plain(), plain(index=1)
    noisy = [1 + 0.3 * rng.standard_normal((H, W, 1)) for _ in range(2)]
    source = previous_pixel(before, now)
    lit = changed_light(before, now, reference(before, noisy[0], 0.15),
                        reference(now, noisy[1], 0.15), source)
    assert lit.mean() < 0.002
    unknown = changed_light(before, now, reference(before, noisy[0], np.nan),
                            reference(now, noisy[1], np.nan), source)
    assert not unknown.any()


def test_a_texture_that_moves_over_pixel_centres_is_no_change_of_light():
    before, now = make_frame(H, W), make_frame(H, W, index=1, camera=translation(0.3, 0.1, 0))
    fine = [np.random.default_rng(i).uniform(0.1, 1, (H, W, 3)) for i in range(2)]
    frames = [with_images(f, color=0.7 * a, albedo=a) for f, a in zip((before, now), fine)]
    found = classified(*frames, sigma=1e-4)
    assert not (found == "light").any()


def test_an_edge_is_one_pixel_wide_on_either_side():
    frame = plain()
    id_ = np.zeros((H, W), np.int32)
    id_[:, 20:] = 1
    flat = with_images(frame, id=id_, normal=np.broadcast_to([0, 0, -1.0], (H, W, 3)))
    assert near_edge(flat).all(axis=0).nonzero()[0].tolist() == [19, 20]
    corner = np.zeros((H, W), np.int32)
    corner[10, 10] = 1
    ring = near_edge(with_images(flat, id=corner))
    assert ring.sum() == 9
    assert ring[9:12, 9:12].all()


def test_history_grows_where_a_surface_stays_and_begins_where_it_is_new():
    still = np.arange(6).reshape(2, 3)
    history = lengthen(None, still)
    assert (history == 1).all()
    history = lengthen(lengthen(history, still), still)
    assert (history == 3).all()
    history[0, 0] = 9
    moved = np.array([[NOWHERE, 0, 1], [3, 4, 5]])
    assert lengthen(history, moved).tolist() == [[1, 10, 4], [4, 4, 4]]


@pytest.mark.parametrize(("frames", "name"), [
    (1, "1"), (2, "2-3"), (3, "2-3"), (4, "4-7"), (7, "4-7"), (15, "8-15"), (16, "16+"),
    (999, "16+")])
def test_histories_have_their_class(frames, name):
    assert list(HISTORIES)[history_class(np.array([frames]))[0]] == name
