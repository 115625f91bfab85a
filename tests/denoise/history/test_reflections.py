"""How far what a lobe reflects has moved, against float64 and by what is known of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from onespp.denoise.history.reflections import image_motion
from onespp.denoise.inputs.path_hits import read_hits
from onespp.denoise.inputs.surface import read_surface
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.filtered_innovation.method import FilteredInnovation
from onespp.denoise.oracles import filtered_innovation as oracle
from tests.denoise.methods.test_filtered_innovation import run, split
from tests.support.frames import make_frame, translation, turn, with_images

HEIGHT, WIDTH = 24, 30


def reflecting(board: np.ndarray, camera: np.ndarray, index: int = 0):
    """A wall and a board whose paths met wall, board, nothing known or nothing, anywhere."""
    frame = make_frame(HEIGHT, WIDTH, index=index, board=board, camera=camera)
    rng = np.random.default_rng(7)
    id_ = rng.integers(-1, 3, (HEIGHT, WIDTH))
    distance = np.where(id_ < 2, rng.uniform(0.1, 9, id_.shape), 0)
    return with_images(frame, hit_id=id_.clip(max=1), hit_distance=distance,
                       roughness=np.where(rng.random(id_.shape) < 0.2, 1,
                                          rng.uniform(0, 0.6, id_.shape)))


def motion_of(previous, frame):
    stencil = Stencil(HEIGHT, WIDTH, 1)
    surface = read_surface(frame, stencil)
    (roughness,) = stencil.load(frame["roughness"])
    return stencil.image([image_motion(stencil, read_hits(frame, previous, stencil), roughness,
                                       surface.sample.normal, surface.position)])


CAMERA = translation(0.2, 0.1, -0.3) @ turn(0.1)


def test_it_is_the_formula_where_what_is_met_turns_and_glides():
    frames = [reflecting(translation(0.1, 0, 0), np.eye(4)),
              reflecting(translation(0.1, 0, 0.2) @ turn(0.02), CAMERA, 1)]
    motion, seen = motion_of(*frames), frames[1]["id"] >= 0
    np.testing.assert_allclose(motion[seen], oracle.image_motion(*frames)[seen], rtol=2e-4,
                               atol=1e-5)
    moves = seen & (frames[1]["hit_id"] == 1) & (frames[1]["roughness"] < 1)
    moves &= frames[1]["hit_distance"] > 0
    assert (motion[moves] > 0).all()
    assert not motion[seen & ~moves].any()
    assert 0 < (motion[moves] == 1).sum() < moves.sum() / 2


def test_a_camera_that_moves_moves_no_reflection_of_what_is_at_rest():
    board = translation(0.3, 0, 0) @ turn(0.4)
    assert not motion_of(reflecting(board, np.eye(4)), reflecting(board, CAMERA)).any()


def test_what_was_not_there_before_has_moved_as_far_as_can_be():
    before, frame = (reflecting(np.eye(4), np.eye(4)) for _ in range(2))
    before = replace(before, world_from_object=before.world_from_object[:1])
    motion = motion_of(before, frame)
    there = (frame["hit_id"] == 1) & (frame["hit_distance"] > 0) & (frame["roughness"] < 1)
    there &= frame["id"] == 0
    assert there.any()
    assert (motion[there] == 1).all()
    assert not motion[(frame["hit_id"] < 1) & (frame["id"] == 0)].any()


@pytest.mark.parametrize("frames", [3, 4])
def test_frames_that_do_not_tell_what_was_met_are_as_if_nothing_was(frames):
    told = split(20, 24, frames)
    untold = [replace(f, images={k: v for k, v in f.images.items() if k != "hit_id"})
              for f in told]
    nothing = [with_images(f, hit_id=np.full(f["hit_id"].shape, -1)) for f in told]
    (image, _), (same, _), (other, _) = (run(FilteredInnovation(), each)
                                         for each in (untold, nothing, told))
    np.testing.assert_array_equal(image, same)
    assert np.abs(image - other).max() > 1e-3
