"""Cameras and shapes of still scenes set in motion: from where they are, and through no surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import onespp
from onespp.render.mitsuba.variant import mi
from onespp.render.scene_files.camera_moves import CAMERA_MOVES, PERIOD, with_camera_move
from onespp.render.scene_files.extent import bounds
from onespp.render.scene_files.shape_moves import SHAPE_MOVES, with_shape_moves
from onespp.scenes.description import Camera, Rectangle, Scene, SceneError, Shape, Sphere
from onespp.scenes.materials import diffuse
from onespp.scenes.transforms import look_at, rotate, scale, translate

GRAY = diffuse((0.5, 0.5, 0.5))


def corridor(width: float, size: float = 1) -> Scene:
    """A camera between two walls, in front of a ball."""
    walls = [Shape(name, Rectangle(), GRAY, scale(size) @ translate((x, 0, 2))
                   @ rotate((0, 1, 0), 90) @ scale(8))
             for name, x in (("left", -width / 2), ("right", width / 2))]
    ball = Shape("ball", Sphere(), GRAY, scale(size * 0.2))
    return Scene("corridor", "", (*walls, ball), Camera(look_at((0, 0, 4 * size), (0, 0, 0))),
                 frames=24, width=8, height=8, environment=1.0)


def eyes(scene: Scene) -> np.ndarray:
    return np.array([scene.camera.world_from_camera_at(f)[:3, 3]
                     for f in np.arange(0, PERIOD, 0.25)])


@pytest.mark.parametrize("size", [1e-3, 1, 1e3])
@pytest.mark.parametrize("kind", [kind for kind in CAMERA_MOVES if kind != "still"])
def test_a_move_is_as_large_as_the_scene_and_begins_where_the_camera_is(kind: str, size: float):
    moved = with_camera_move(corridor(8, size), kind)
    path = eyes(moved)
    reach = np.linalg.norm(path - path.mean(0), axis=1).max() / size
    assert {"orbit": 1.2, "dolly": 0.8, "handheld": 0.05}[kind] < reach < 2
    assert np.linalg.norm(path[0] - (0, 0, 4 * size)) < 0.15 * size
    assert moved.moving == ("camera",)
    again = with_camera_move(corridor(8, size), kind)
    np.testing.assert_array_equal(eyes(again), path)


@pytest.mark.parametrize("width", [2, 1, 0.3])
def test_an_orbit_between_walls_stays_between_them(width: float):
    path = eyes(with_camera_move(corridor(width), "orbit"))
    assert abs(path[:, 0]).max() < width / 2
    assert abs(path[:, 0]).max() > width / 16
    walls = mi.load_dict({"type": "scene", **{
        f"w{i}": {"type": "rectangle", "to_world": mi.ScalarTransform4f(
            (translate((x, 0, 2)) @ rotate((0, 1, 0), 90) @ scale(8)).tolist())}
        for i, x in enumerate((-width / 2, width / 2))}})
    steps = np.diff(path, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    rays = mi.Ray3f(mi.Point3f(path[:-1].T), mi.Vector3f((steps / lengths[:, None]).T))
    rays.maxt = mi.Float(lengths)
    assert not np.array(walls.ray_test(rays)).any()


def test_a_camera_without_room_is_told_so():
    scene = corridor(8)
    back = Shape("back", Rectangle(), GRAY, translate((0, 0, 4.001)))
    shut = replace(scene, shapes=(*scene.shapes, back))
    with pytest.raises(SceneError, match="no room for the move 'dolly'"):
        with_camera_move(shut, "dolly")
    moving = with_camera_move(scene, "orbit")
    with pytest.raises(SceneError, match="moves already"):
        with_camera_move(moving, "dolly")
    assert with_camera_move(moving, "still").moving == ()
    with pytest.raises(SceneError, match="no camera move 'zoom': use still, orbit"):
        with_camera_move(scene, "zoom")


def test_shapes_move_about_their_own_middle():
    box = Shape("plank", Rectangle(), GRAY, translate((5, 1, 2)) @ rotate((0, 1, 0), 90)
                @ scale((2, 0.5, 1)))  # 4 along z, 1 along y, at x = 5
    scene = replace(corridor(8), shapes=(box,))

    def middle(kind: str, frame: float) -> np.ndarray:
        shape = with_shape_moves(scene, {"plank": kind}).shapes[0]
        np.testing.assert_allclose(shape.world_from_object_at(0), box.world_from_object_at(0),
                                   atol=1e-12)
        low, high = bounds(shape, frame)
        return np.array([*(low + high) / 2, *(high - low)])

    np.testing.assert_allclose(middle("spin", 24), (5, 1, 2, 4, 1, 0), atol=1e-9)
    np.testing.assert_allclose(middle("slide", 12), (5, 1, 4, 0, 1, 4), atol=1e-9)
    hung = middle("swing", 12)  # about z, through its upper edge
    assert hung[0] > 5.2
    np.testing.assert_allclose(hung[1] + hung[4] / 2, 1.5, atol=1e-9)


def test_what_there_is_not_is_told_with_what_there_is():
    with pytest.raises(SceneError, match="no shape 'bal': did you mean 'ball'"):
        with_shape_moves(corridor(8), {"bal": "spin"})
    with pytest.raises(SceneError, match=f"no move 'jump': use {', '.join(SHAPE_MOVES)}"):
        with_shape_moves(corridor(8), {"ball": "jump"})


def test_the_library_sets_any_scene_in_motion():
    scene = onespp.animate(corridor(8), camera="handheld", moves={"ball": "slide"}, frames=5)
    assert (scene.moving, scene.frames) == (("camera", "ball"), 5)
