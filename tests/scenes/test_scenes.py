"""Laws that every scene of the catalog keeps, and what happens to a scene file that breaks them."""

from functools import cache

import numpy as np
import pytest

from onespp.scenes.catalog import SCENES, load
from onespp.scenes.description import Cylinder, Mesh, Rectangle, Scene, SceneError, Sphere

FRAMES = (0, 1, 17.25, 19, 79, 121)
INSIDE = {"box": ((-1.04, -1.04, -1), (1.04, 1.04, 4)), "room": ((-3, 0, -2.7), (3, 2.8, 3.3))}
every_scene = pytest.mark.parametrize("name", sorted(SCENES))
scene_of = cache(load)


def places(scene: Scene, frame: float) -> np.ndarray:
    """(n + 1, 4, 4): the camera's matrix, then the shapes'."""
    return np.stack([scene.camera.world_from_camera_at(frame),
                     *(shape.world_from_object_at(frame) for shape in scene.shapes)])


def world_points(scene: Scene, frame: float, name: str) -> np.ndarray:
    """Points that span a shape, in the world."""
    shape = next(shape for shape in scene.shapes if shape.name == name)
    matrix = shape.world_from_object_at(frame)
    match shape.geometry:
        case Mesh():
            points = shape.geometry.vertices
        case Sphere():
            radius = np.cbrt(np.linalg.det(matrix[:3, :3]))
            return matrix[:3, 3] + radius * np.vstack([np.eye(3), -np.eye(3)])
        case _:
            points = np.array([(x, y, 0) for x in (-1, 1) for y in (-1, 1)])
    return points @ matrix[:3, :3].T + matrix[:3, 3]


@every_scene
def test_frames_are_pure_functions_of_their_number(name):
    forward = [places(scene_of(name), frame) for frame in FRAMES]
    again = load(name)
    backward = [places(again, frame) for frame in reversed(FRAMES)]
    for a, b in zip(forward, reversed(backward)):
        assert np.array_equal(a, b)


@every_scene
def test_matrices_are_affine_and_camera_is_rigid(name):
    for frame in FRAMES:
        matrices = places(scene_of(name), frame)
        assert matrices.dtype == np.float64
        assert np.array_equal(matrices[:, 3], np.tile((0, 0, 0, 1), (len(matrices), 1)))
        assert (abs(np.linalg.det(matrices)) > 0).all()
        camera = matrices[0, :3, :3]
        np.testing.assert_allclose(camera @ camera.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(camera) == pytest.approx(1)


@every_scene
def test_everything_is_inside_the_room_in_every_frame(name):
    scene = scene_of(name)
    low, high = INSIDE[name]
    for frame in range(0, scene.frames, 3):
        eye = scene.camera.world_from_camera_at(frame)[:3, 3]
        assert ((eye > low) & (eye < high)).all()
        for shape in scene.shapes:
            points = world_points(scene, frame, shape.name)
            assert (points > np.array(low) - 1e-9).all(), shape.name
            assert (points < np.array(high) + 1e-9).all(), shape.name


@every_scene
def test_what_is_a_function_moves_and_the_rest_has_a_matrix(name):
    scene = scene_of(name)
    start, later = places(scene, 0), places(scene, 7)
    movers = {part for part, a, b in zip(("camera", *scene.object_names), start, later)
              if not np.allclose(a, b)}
    assert movers == set(scene.moving)
    assert len(movers) >= 3


@every_scene
def test_motion_is_smooth_from_frame_to_frame(name):
    """Nothing jumps: no step is much longer than those beside it."""
    scene = scene_of(name)
    path = np.stack([places(scene, frame) for frame in np.arange(0, scene.frames, 0.25)])
    step = np.linalg.norm(np.diff(path, axis=0), axis=(2, 3))
    assert step.max() < 0.1
    assert (abs(np.diff(step, axis=0)) < 0.02).all()


@every_scene
def test_analytic_shapes_are_scaled_uniformly(name):
    for shape in scene_of(name).shapes:
        if isinstance(shape.geometry, Sphere | Cylinder):
            for frame in FRAMES:
                sizes = np.linalg.norm(shape.world_from_object_at(frame)[:3, :3], axis=0)
                np.testing.assert_allclose(sizes, sizes[0])


@every_scene
def test_colours_conserve_energy(name):
    def reflectances(part):
        if isinstance(part, dict):
            for key, value in part.items():
                if key != "uv_from_surface":
                    yield from reflectances(value)
        elif isinstance(part, tuple | np.ndarray):
            yield np.asarray(part)

    for shape in scene_of(name).shapes:
        for color in reflectances(shape.material):
            assert color.shape[-1] == 3
            assert color.min() >= 0, shape.name
            assert color.max() <= 1, shape.name


def test_room_is_closed():
    """The six walls cover the sphere of directions seen from the middle."""
    scene = scene_of("room")
    solid_angle = 0.0
    for shape in scene.shapes:
        if shape.name.startswith("wall") or shape.name in ("floor", "ceiling"):
            assert isinstance(shape.geometry, Rectangle)
            matrix = shape.world_from_object_at(0)
            square = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
            corner = square @ matrix[:3, :3].T + matrix[:3, 3] - (0.2, 1.3, 0.1)
            facing = matrix[:3, 2] @ corner[0]
            assert facing < 0, shape.name  # its front is inside
            solid_angle += _triangle(*corner[[0, 1, 2]]) + _triangle(*corner[[0, 2, 3]])
    assert solid_angle == pytest.approx(4 * np.pi)


def _triangle(a, b, c):
    """Solid angle of a triangle seen from the origin (Van Oosterom and Strackee 1983)."""
    la, lb, lc = (np.linalg.norm(x) for x in (a, b, c))
    return 2 * np.arctan2(abs(a @ np.cross(b, c)),
                          la * lb * lc + a @ b * lc + a @ c * lb + b @ c * la)


def test_ball_of_the_room_rolls_without_slipping():
    scene = scene_of("room")
    ball = next(shape for shape in scene.shapes if shape.name == "ball")
    for frame in (3, 20.5, 50):
        before, after = (ball.world_from_object_at(frame + d) for d in (-1e-4, 1e-4))
        touching = before[:3, 3] - (0, 0.17, 0)
        carried = after @ np.linalg.inv(before) @ (*touching, 1)
        moved = np.linalg.norm(after[:3, 3] - before[:3, 3])
        assert np.linalg.norm(carried[:3] - touching) < 1e-3 * moved


@pytest.mark.parametrize(("a", "b"), [("locomotive", "wagon_1"), ("wagon_1", "wagon_2"),
                                      ("locomotive", "rocking_chair"), ("locomotive", "drawers"),
                                      ("rocking_chair", "drawers"), ("ball", "rug"),
                                      ("mobile", "shelf")])
def test_furniture_does_not_collide(a, b):
    scene = scene_of("room")
    for frame in range(0, 80, 5):
        apart = world_points(scene, frame, a)[::2, None] - world_points(scene, frame, b)[::3]
        assert np.linalg.norm(apart, axis=2).min() > 0.03


def test_ball_of_the_box_stays_clear_of_the_boxes():
    scene = scene_of("box")
    shapes = {shape.name: shape for shape in scene.shapes}
    for frame in np.arange(0, 64 * 5, 0.5):  # the common period of the slow motions
        centre = shapes["ball"].world_from_object_at(frame)[:, 3]
        for name in ("tall_box", "small_box"):
            object_from_world = np.linalg.inv(shapes[name].world_from_object_at(frame))
            geometry = shapes[name].geometry
            assert isinstance(geometry, Mesh)
            local = (object_from_world @ centre)[:3]
            gap = local - np.clip(local, geometry.vertices.min(axis=0),
                                  geometry.vertices.max(axis=0))
            assert np.linalg.norm(gap) > 0.26, (name, frame)


def test_train_drives_forward():
    scene = scene_of("room")
    for shape in scene.shapes:
        if shape.name in ("locomotive", "wagon_1", "wagon_2"):
            before, after = (shape.world_from_object_at(10 + d) for d in (-0.01, 0.01))
            step = after[:3, 3] - before[:3, 3]
            heading = shape.world_from_object_at(10)[:3, 2]
            assert step @ heading > 0.999 * np.linalg.norm(step)


FILE = """
from onespp.scenes.description import Camera, Scene, Shape, Sphere
from onespp.scenes.animation import spin
from onespp.scenes.transforms import look_at, translate

def scene():
    lamp = Shape("lamp", Sphere(), {"type": "diffuse"}, spin((0, 1, 0), 5) @ translate((2, 0, 0)),
                 emission=(1, 1, 1))
    return Scene("mine", "one lamp", (lamp,), Camera(look_at((0, 0, 9), (0, 0, 0))), 3, 8, 8)
"""
MOTION = "spin((0, 1, 0), 5) @ translate((2, 0, 0))"


def test_scene_file_is_loaded(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(FILE)
    assert load(str(path)).object_names == ("lamp",)
    path.write_text(FILE + "\nSCENE = scene()\ndel scene\n")
    assert load(str(path)).moving == ("lamp",)


@pytest.mark.parametrize(("text", "words"), [
    ("def scene(:\n", r"line 1: SyntaxError"),
    ("x = 1\ny = 1 / 0\n", r"line 2: ZeroDivisionError"),
    ("def scene():\n    a = 1\n    raise RuntimeError('two\\nlines')\n", r"line 3: .*two lines"),
    ("import sys\nsys.exit(3)\n", r"line 2: SystemExit"),
    ("from onespp.scenes.animation import track\n\nt = track({})\n",
     "line 3: an animation has no key"),
    ("x = 1\n", "no scene here"),
    ("def scene():\n    return 4\n", "no scene here"),
    ("def scene(size):\n    return size\n", "TypeError"),
    (FILE.replace(MOTION, "lambda frame: translate((1 / (frame - 2), 0, 0))"),
     "line 7: the place of 'lamp' in frame 2 raises ZeroDivisionError"),
    (FILE.replace(MOTION, "lambda frame: (1, 2)"), "place of 'lamp' in frame 0"),
    ("\0", "mine.py"),
])
def test_broken_scene_file_is_named_in_one_sentence(tmp_path, text, words):
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(SceneError, match=words) as caught:
        load(str(path))
    assert "mine.py" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("name", "words"), [
    ("rom", "did you mean 'room'.*box, room"),
    ("nothing", "unknown scene 'nothing': there are box, room"),
    ("nowhere/mine.py", "no scene file 'nowhere/mine.py'"),
])
def test_missing_scene_is_named_with_what_there_is(name, words):
    with pytest.raises(SceneError, match=words):
        load(name)
