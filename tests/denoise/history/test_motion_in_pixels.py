"""Motion as pixels, where no matrices tell it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from onespp.denoise.catalog import METHODS, PEERS, build, channels_read
from onespp.denoise.geometry.correspondence import NOWHERE, previous_pixel
from onespp.denoise.history.reprojection import locate, motion_between
from onespp.denoise.inputs.surface import read_surface
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.temporal import Temporal
from onespp.render.frame import Frame
from onespp.render.guides_camera import camera_of_guides
from tests.support.frames import make_frame, noisy, translation, turn, with_images

H, W = 46, 60
MOVES = {
    "camera": {"camera": translation(0.3, 0.1, 0.05) @ turn(0.02)},
    "board": {"board": translation(0.5, -0.3, 0.05) @ turn(0.1)},
    "both": {"camera": turn(-0.03), "board": translation(-0.4, 0, 0)},
}
TEMPORAL = ("temporal", "assignment", "assignment-atrous", "svgf", "asvgf", "bmfr",
            "onespp", "temporal-oidn", "temporal-oidn-split")


def pair(move: str) -> tuple[Frame, Frame]:
    return make_frame(H, W), make_frame(H, W, index=1, **MOVES[move])


def motion_of(previous: Frame, current: Frame) -> np.ndarray:
    """(h, w, 2) float64, by the chain of matrices: P' V' M' M^-1 X; NaN where there is nothing."""
    y, x = np.mgrid[:H, :W] + 0.5
    world = np.concatenate([current["position"], np.ones((H, W, 1))], -1).astype(np.float64)
    chain = previous.world_from_object @ np.linalg.inv(current.world_from_object)
    was = (chain[np.maximum(current["id"], 0)] @ world[..., None])[..., 0]
    screen = was @ previous.screen_from_world.T
    there = (current["id"] >= 0)[..., None]
    motion = screen[..., :2] / np.where(there, screen[..., 3:], 1) - np.stack([x, y], -1)
    return np.where(there, motion, np.nan)


def with_motion(previous: Frame, current: Frame) -> Frame:
    return with_images(current, motion=motion_of(previous, current))


def alone(frame: Frame, motion: np.ndarray | None = None) -> Frame:
    """The same without a matrix."""
    images = {name: image for name, image in frame.images.items() if name != "position"}
    return Frame.from_arrays(index=frame.index, **images, motion=motion)


# With alpha tiny and a clamp box that never binds, what comes out is the history itself.
HISTORY = Temporal(alpha=1e-6, color_box=1e6)


def marked(frame: Frame) -> Frame:
    """The frame with a colour that no history has, and that varies, so that no clamp binds."""
    color = np.full((H, W, 3), 100.0) + np.random.default_rng(0).normal(0, 1, (H, W, 3))
    return with_images(frame, color=color)


def history(previous: Frame, current: Frame) -> np.ndarray:
    """(h, w, 3), NaN where there is none."""
    _, state = HISTORY(previous, None)
    image, _ = HISTORY(current, state)
    return np.where(image > 50, np.nan, image)


@pytest.mark.parametrize("move", MOVES)
def test_the_same_place_as_by_matrices(move):
    """All that a history's pixels are tested by, to float32's rounding."""
    previous, current = pair(move)
    stencil = Stencil(H, W, 1)
    places = []
    for frame in (current, with_motion(previous, current)):
        surface = read_surface(frame, stencil)
        place = locate(stencil, surface.sample, motion_between(previous, frame, stencil),
                       stencil.opaque(0.02))
        inside = stencil.image([stencil.Float(place.inside & surface.is_valid)]) > 0
        places.append((inside, stencil.image([place.x, place.y]), stencil.image(place.normal),
                       stencil.image([place.offset, place.nearness]), stencil.image(place.plane)))
    (inside, *first), (inside_too, *second) = places
    assert inside.mean() > 0.5
    assert (inside == inside_too).mean() > 0.998  # some lie on the screen's very border
    both = inside & inside_too
    for a, b, tolerance in zip(first, second, (1e-4, 0, 2e-6, 2e-6), strict=True):
        np.testing.assert_allclose(a[both], b[both], atol=tolerance)


@pytest.mark.parametrize("move", MOVES)
def test_scores_find_the_same_pixel(move):
    previous, current = pair(move)
    by_matrices = previous_pixel(previous, current)
    by_motion = previous_pixel(previous, with_motion(previous, current))
    assert (by_matrices != NOWHERE).mean() > 0.5
    assert (by_matrices == by_motion).mean() > 0.998


def test_motion_is_believed_where_matrices_say_otherwise():
    previous, current = pair("board")
    still = replace(with_motion(previous, current), world_from_object=previous.world_from_object)
    on_board = (current["id"] == 1) & (previous_pixel(previous, current) != NOWHERE)
    found = previous_pixel(previous, still)
    there = on_board & (found != NOWHERE)  # the board turns, and so some of it is off its plane
    assert there.sum() > 0.9 * on_board.sum()
    np.testing.assert_array_equal(found[there], previous_pixel(previous, current)[there])
    without = replace(current, world_from_object=previous.world_from_object)
    assert (previous_pixel(previous, without) == found)[on_board].mean() < 0.1


def test_a_steep_surface_that_moves_by_untold_matrices_keeps_its_history():
    """Its plane goes along with it: three pixels aside it is 6 % of its depth farther away."""
    steep = turn(1.1)
    around = translation(0, 0, 6) @ steep @ translation(0, 0, -6)
    previous = make_frame(H, W, board=around)
    current = make_frame(H, W, index=1, board=translation(0.25, 0, 0) @ around)
    still = replace(with_motion(previous, current), world_from_object=previous.world_from_object)
    on_board = (current["id"] == 1) & (previous_pixel(previous, current) != NOWHERE)
    assert on_board.sum() > 50
    assert (previous_pixel(previous, still) != NOWHERE)[on_board].mean() > 0.9
    assert np.isfinite(history(previous, marked(still))).all(-1)[on_board].mean() > 0.9


@pytest.mark.parametrize("move", MOVES)
def test_history_without_a_matrix_is_where_matrices_have_it(move):
    """Colour that sticks to surfaces, carried from frame to frame."""
    previous, current = pair(move)
    motion = motion_of(previous, current)
    histories = [history(previous, marked(current)),
                 history(alone(previous), alone(marked(current), motion))]
    there = [np.isfinite(h).all(-1) for h in histories]
    assert there[0].mean() > 0.5
    assert there[1][there[0]].mean() > 0.97
    both = there[0] & there[1]
    error = np.abs(histories[0] - histories[1])[both]
    assert np.quantile(error, 0.99) < 2e-3


def test_what_is_uncovered_has_no_history_without_a_matrix():
    previous, current = pair("board")
    found = history(alone(previous), alone(marked(current), motion_of(previous, current)))
    uncovered = (previous_pixel(previous, current) == NOWHERE) & (current["id"] == 0)
    assert uncovered.sum() > 20
    assert np.isnan(found[uncovered]).all(-1).mean() > 0.9
    assert np.isfinite(found)[current["id"] >= 0].mean() > 0.8


@pytest.mark.parametrize("name", TEMPORAL)
def test_every_temporal_method_gains_by_motion_alone(name):
    if name in PEERS and not PEERS[name].available():
        pytest.skip("Open Image Denoise is not installed")
    method, truth = build(name), []
    assert "motion" in channels_read(method, ("color", "motion"))
    errors, states = {}, {"motion": None, "first": None}
    previous = None
    for i in range(5):
        frame = make_frame(H, W, index=i, camera=translation(0.15 * i, 0, 0))
        motion = None if previous is None else motion_of(previous, frame)
        truth.append(frame["color"])
        bare = alone(noisy(frame, seed=i, sigma=0.6), motion)
        for key in states:
            image, state = method(bare, states[key])
            states[key] = state if key == "motion" else None
            errors[key] = float(np.square(image - frame["color"])[:, 8:-8].mean())
        previous = frame
    assert errors["motion"] < 0.85 * errors["first"]


def test_an_object_that_appears_has_no_history_and_the_others_have():
    previous, current = pair("camera")
    motion = motion_of(previous, current)
    fresh = current["id"].copy()
    fresh[:8] = np.where(fresh[:8] >= 0, 2, -1)
    found = history(alone(previous), alone(marked(with_images(current, id=fresh)), motion))
    assert np.isnan(found[:8]).all()
    assert np.isfinite(found[8:])[fresh[8:] >= 0].mean() > 0.8
    source = previous_pixel(alone(previous), alone(with_images(current, id=fresh), motion))
    assert (source[:8] == NOWHERE).all()
    assert (source[8:] != NOWHERE).mean() > 0.5


def test_unknown_motion_is_no_history():
    previous, current = pair("camera")
    unknown = alone(marked(current), np.full((H, W, 2), np.nan))
    assert np.isnan(history(alone(previous), unknown)).all()


def test_all_names_of_temporal_methods_are_known():
    assert set(TEMPORAL) <= {*METHODS, *PEERS}


@pytest.mark.parametrize("camera", [np.eye(4), turn(0.3), translation(1, 0, 1) @ turn(-0.2)])
def test_a_camera_is_found_by_guides(camera):
    """With a third plane, which makes it certain, a fifth of the screen high."""
    frame = make_frame(H, W, camera=camera, board=turn(0.6) @ translation(0, 0, 0))
    depth, normal = (frame[name].astype(np.float64) for name in ("depth", "normal"))
    floor = np.array([0.1, -1.0, -0.2]) / np.linalg.norm([0.1, -1.0, -0.2])
    in_camera = floor @ frame.camera_from_world[:3, :3].T
    y, x = np.mgrid[:H, :W] + 0.5
    f = 1.2 * W
    ray = np.stack([(x - W / 2) / f, (y - H / 2) / f, np.ones_like(x)], -1)
    below = y > 0.8 * H
    depth[below] = (-2 / (ray @ in_camera))[below]
    normal[below] = floor
    normal[~np.isfinite(depth)] = 0
    found, screen = camera_of_guides(depth, normal, (H, W))
    rotation = found[:3, :3] @ frame.camera_from_world[:3, :3].T
    assert np.degrees(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))) < 0.5
    assert (screen @ np.linalg.inv(found))[0, 0] == pytest.approx(f, rel=0.03)


def test_motion_is_stored(tmp_path):
    from onespp.render.files.manifest import Manifest
    from onespp.render.files.sequence import FrameSequence

    previous, current = pair("board")
    frame = alone(current, motion_of(previous, current))
    names = ("color", "normal", "depth", "id", "motion")
    sequence = FrameSequence.create(tmp_path / "s", Manifest(
        scene="made", frames=(1,), width=W, height=H, channels=names, objects=("wall", "board")))
    sequence.write_frame(frame)
    back = sequence.read_frame(1)
    np.testing.assert_array_equal(back["motion"], frame["motion"])
    np.testing.assert_array_equal(back.screen_from_world, frame.screen_from_world)
