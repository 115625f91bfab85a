from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

from onespp.denoise.history.reprojection import locate, motion_between, motion_table
from onespp.denoise.inputs.surface import read_surface
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.temporal import Temporal
from onespp.denoise.oracles import filters as oracles
from tests.support.frames import make_frame, translation, turn, with_images

# With alpha tiny and a clamp box that never binds, what comes out is the history itself.
HISTORY = {"alpha": 1e-6, "color_box": 1e6}


def history(previous, frame, **parameters):
    """(h, w, 3) history of each pixel, NaN where there is none."""
    marked = with_images(frame, color=np.full(frame["color"].shape, 100.0)
                         + np.random.default_rng(0).normal(0, 1, frame["color"].shape))
    method = Temporal(**HISTORY, **parameters)
    _, state = method(previous, method.init(frame.height, frame.width))
    result, _ = method(marked, state)
    return np.where(result > 50, np.nan, result)


MOTIONS = {
    "still": (np.eye(4), np.eye(4)),
    "camera moves": (translation(0.2, -0.1, 0.15), np.eye(4)),
    "camera turns": (turn(0.03), np.eye(4)),
    "board moves": (np.eye(4), translation(0.35, 0.2, 0.1)),
    "board turns": (np.eye(4), turn(0.1) @ translation(0, 0.1, 0)),
    "board turns far": (np.eye(4), translation(0, 0, 6) @ turn(0.7) @ translation(0, 0, -6)),
    "all move": (translation(0.1, 0.1, 0.2) @ turn(-0.02),
                 translation(-0.3, 0.05, 0.0) @ turn(0.05)),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_agrees_with_the_chain_of_matrices_in_float64(name):
    camera, board = MOTIONS[name]
    previous = make_frame(23, 30)
    frame = make_frame(23, 30, index=1, camera=camera, board=board)
    expected = oracles.reproject_bilinear(previous, frame, previous["color"])
    result = history(previous, frame)
    agree = np.isfinite(expected) == np.isfinite(result)
    assert agree.mean() > 0.995  # taps right at a test's limit may fall either way
    both = np.isfinite(expected) & np.isfinite(result)
    assert both.mean() > 0.5
    np.testing.assert_allclose(result[both], expected[both], atol=2e-3)


@pytest.mark.parametrize("board", [
    np.eye(4), turn(0.4) @ translation(0.2, 0, 0), np.diag([1.3, 0.8, 1, 1]),
    turn(0.2) @ np.diag([2, 2, 2, 1.0]), np.array([[1, .3, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0],
                                                   [0, 0, 0, 1.0]]),
    np.diag([-1.0, 1, 1, 1])],
    ids=["still", "turns", "stretches", "grows", "shears", "is mirrored"])
def test_planes_turn_by_the_inverse_transpose_of_the_motion(board):
    """A normal expected in the previous frame, and the plane that its neighbours must lie on."""
    tilted = turn(0.5)
    previous = make_frame(9, 11, board=tilted)
    frame = make_frame(9, 11, index=1, camera=translation(0.1, 0, 0.2) @ turn(0.1), board=tilted)
    frame = replace(frame, world_from_object=frame.world_from_object
                    @ np.stack([np.eye(4), np.linalg.inv(board)]))
    stencil = Stencil(9, 11, 1)
    surface = read_surface(frame, stencil)
    place = locate(stencil, surface.sample, motion_between(previous, frame, stencil),
                   stencil.opaque(0.02))
    motion = (previous.camera_from_world @ previous.world_from_object
              @ np.linalg.inv(frame.world_from_object) @ np.linalg.inv(frame.camera_from_world))
    turning = np.linalg.inv(motion[:, :3, :3]).transpose(0, 2, 1)
    normal = stencil.image(surface.normal)
    expected = (turning[frame["id"]] @ normal[..., None])[..., 0]
    seen = frame["id"] >= 0
    expected[seen] /= np.linalg.norm(expected[seen], axis=-1, keepdims=True)
    np.testing.assert_allclose(stencil.image(place.normal)[seen], expected[seen], atol=2e-6)
    position = stencil.image(surface.position)
    moved = (motion[frame["id"]] @ np.pad(position, ((0, 0), (0, 0), (0, 1)),
                                          constant_values=1)[..., None])[..., :3, 0]
    inside = seen & (stencil.image([dr.select(place.inside, stencil.Float(1), 0)]) > 0)
    assert inside.mean() > 0.3
    np.testing.assert_allclose(stencil.image([place.offset])[inside],
                               (expected * moved).sum(-1)[inside], rtol=1e-5)


@pytest.mark.parametrize("nearest", [False, True])
def test_what_does_not_move_lands_on_its_pixel_exactly(nearest):
    """Also with a camera that is turned, far away and with an odd focal length."""
    camera = translation(0.37, -1.21, 0.113) @ turn(0.7)
    board = camera @ translation(0.1, 0.1, 0.2)
    frames = [make_frame(31, 37, index=i, camera=camera, board=board, origin=(1e3, -777.7, 31.4))
              for i in (0, 1)]
    color = np.random.default_rng(1).random((31, 37, 3))
    previous = with_images(frames[0], color=color)
    seen = frames[0]["id"] >= 0
    result = history(previous, frames[1], nearest=nearest)
    assert seen.any()
    np.testing.assert_allclose(result[seen], color[seen], atol=2e-4)
    table = motion_table(frames[0], frames[1])
    assert (table[:, :12] == 0).all()


def test_pure_translation_by_whole_pixels_reprojects_exactly():
    """A fronto-parallel board that moves by exactly three pixels: history is the shifted image."""
    size, f = 33, 1.2 * 33
    step = 3 * 6.0 / f
    previous = make_frame(size, size, wall_end=-1e9)
    frame = make_frame(size, size, index=1, wall_end=-1e9, board=translation(step, 0, 0))
    color = np.random.default_rng(2).random((size, size, 3))
    previous = with_images(previous, color=color)
    for nearest in (False, True):
        result = history(previous, frame, nearest=nearest)
        on = (frame["id"] == 1)[:, 3:] & (previous["id"] == 1)[:, :-3]
        assert on.sum() > 100
        np.testing.assert_allclose(result[:, 3:][on], color[:, :-3][on], atol=2e-4)


def test_a_million_units_from_the_origin_reprojects_as_well_as_at_it():
    camera, board = MOTIONS["all move"]
    results = []
    for origin in ((0, 0, 0), (1e6, -1e6, 1e6)):
        previous = make_frame(23, 30, origin=origin)
        frame = make_frame(23, 30, index=1, camera=camera, board=board, origin=origin)
        results.append((history(previous, frame), motion_table(previous, frame)))
    (near, near_table), (far, far_table) = results
    assert np.abs(far_table - near_table).max() < 1e-6  # pixels a pixel
    np.testing.assert_array_equal(np.isfinite(near), np.isfinite(far))
    np.testing.assert_allclose(far, near, atol=1e-2)


def test_disoccluded_and_new_pixels_have_no_history():
    previous = make_frame(24, 32)
    frame = make_frame(24, 32, index=1, board=translation(1.0, 0, 0))
    uncovered = (previous["id"] == 1) & (frame["id"] == 0)
    assert uncovered.sum() > 20
    for nearest in (False, True):
        assert np.isnan(history(previous, frame, nearest=nearest)[uncovered]).all()


def test_what_comes_in_from_the_side_has_no_history():
    previous = make_frame(20, 24, wall_end=1e9)
    frame = make_frame(20, 24, index=1, wall_end=1e9, camera=turn(0.3))
    result = history(previous, frame)
    x, y, _ = np.moveaxis(oracles.previous_screen(previous, frame), -1, 0)
    assert (x >= 24).sum() > 20
    assert np.isnan(result[x >= 24]).all()
    assert np.isfinite(result[(x < 23) & (y > 1) & (y < 19)]).all()


def test_background_has_no_history():
    frame = make_frame(20, 24, wall_end=0.5)
    result = history(frame, make_frame(20, 24, index=1, wall_end=0.5))
    assert (frame["id"] < 0).any()
    assert np.isnan(result[frame["id"] < 0]).all()


def test_the_plane_and_normal_tests_reject_another_surface_of_the_same_object():
    previous = make_frame(20, 24, wall_end=1e9)
    frame = make_frame(20, 24, index=1, wall_end=1e9)
    wall = np.argwhere(frame["id"] == 0)[5]
    for channel, value in (("depth", 1.2 * previous["depth"]), ("normal", -previous["normal"])):
        other = with_images(previous, **{channel: value})
        assert np.isnan(history(other, frame)[tuple(wall)]).all()
        assert np.isfinite(history(other, frame, nearest=True)[tuple(wall)]).all()


def test_the_object_test_rejects_another_object_on_the_same_plane():
    previous, frame = make_frame(20, 24, wall_end=1e9), make_frame(20, 24, index=1, wall_end=1e9)
    id_ = np.array(previous["id"])
    id_[:10][id_[:10] == 0] = 1
    other = with_images(previous, id=id_)
    wall = (frame["id"] == 0) & (np.arange(20)[:, None] < 10)
    for nearest in (False, True):
        result = history(other, frame, nearest=nearest)
        assert np.isnan(result[wall]).all()
        assert np.isfinite(result[15:][frame["id"][15:] == 0]).all()


def test_an_object_shrunk_to_nothing_has_no_history():
    previous = make_frame(9, 9)
    frame = make_frame(9, 9, index=1)
    matrices = frame.world_from_object.copy()
    matrices[1] = 0
    object.__setattr__(frame, "world_from_object", matrices)
    assert np.isnan(history(previous, frame)[frame["id"] == 1]).all()
    assert np.isfinite(history(previous, frame)[frame["id"] == 0]).all()
