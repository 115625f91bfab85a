"""Frames: deterministic, one kernel each, and a G-buffer that agrees with the matrices."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

from onespp.render.channels import FRAME
from onespp.render.errors import InputError
from onespp.render.host import backend
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog
from onespp.scenes.description import Camera, Mesh, Rectangle, Scene, SceneError, Shape, Sphere
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.furnace import CORNERS, INWARD, furnace

HEIGHT, WIDTH = 18, 24
SIDE_BY_SIDE = 80  # operations, at most, of the kernel that lays the planes of colours so


def gray(value: float = 0.5) -> dict:
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": (value,) * 3}}


def small_scene(at=(0.0, 0.0, 0.0), **changes) -> Scene:
    """A ball that rolls over a floor under a light; `at` moves everything."""
    place = translate(at)
    parts: dict = {
        "name": "small", "about": "for tests", "frames": 8, "width": WIDTH, "height": HEIGHT,
        "max_depth": 3,
        "camera": Camera(lambda f: look_at(np.add(at, (0.1 * f, 2, 5)), np.add(at, (0, 0.4, 0)))),
        "shapes": (
            Shape("floor", Rectangle(), gray(), place @ rotate((1, 0, 0), -90) @ scale(3)),
            Shape("ball", Sphere(), gray(0.8),
                  lambda f: (place @ translate((0.2 * f - 1, 0.5, 0)) @ rotate((0, 0, 1), -20 * f)
                             @ scale(0.5))),
            Shape("light", Rectangle(), gray(0.0),
                  place @ translate((0, 3, 0)) @ rotate((1, 0, 0), 90), (8.0, 8.0, 8.0))),
    }
    return Scene(**(parts | changes))


def same_bytes(a, b) -> bool:
    return all(a[name].tobytes() == b[name].tobytes() for name in FRAME)


def kernels(action) -> list:
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        action()
        launched = dr.kernel_history([dr.KernelType.JIT])
    return [kernel for kernel in launched if kernel["size"] == HEIGHT * WIDTH
            and kernel["operation_count"] > SIDE_BY_SIDE]


@pytest.mark.parametrize("name", ["box", "room"])
def test_a_frame_has_the_same_bytes_in_any_order_and_with_any_number_of_threads(name):
    scene = catalog.load(name)
    renderer = Renderer(scene, HEIGHT, WIDTH)
    expected = renderer.frame(5, seed=3)
    renderer.frame(2)
    again = renderer.frame(5, seed=3)
    threads = dr.thread_count()
    try:
        dr.set_thread_count(1)
        alone = Renderer(scene, HEIGHT, WIDTH).frame(5, seed=3)
    finally:
        dr.set_thread_count(threads)
    assert same_bytes(expected, again)
    assert same_bytes(expected, alone)


def test_seed_frame_and_reference_draw_other_numbers():
    renderer = Renderer(furnace(0.5, 1.0, 3), HEIGHT, WIDTH)
    images = [renderer.frame(0, 0)["color"], renderer.frame(0, 1)["color"],
              renderer.frame(1, 0)["color"], renderer.sample_sum(0, 0, 0, 1),
              renderer.sample_sum(0, 0, 1, 1)]
    for i, a in enumerate(images):
        for b in images[i + 1:]:
            assert np.corrcoef(a.ravel(), b.ravel())[0, 1] < 0.3


def test_one_kernel_a_frame_and_the_same_one_for_every_frame_and_seed():
    renderer = Renderer(small_scene(), HEIGHT, WIDTH)
    first = kernels(lambda: renderer.frame(0))
    assert len(first) == 1
    if backend.choose() == "cuda":  # Mitsuba builds the scene's structure anew at the first move
        first = kernels(lambda: renderer.frame(2))[-1:]
    for index, seed in ((1, 0), (4, 7), (0, 2)):
        launched = kernels(lambda index=index, seed=seed: renderer.frame(index, seed))
        if backend.choose() == "cuda":  # and moves shapes by small kernels before
            launched = launched[-1:]
        assert [kernel["hash"] for kernel in launched] == [first[0]["hash"]]


def test_only_channels_asked_for_are_computed():
    renderer = Renderer(small_scene(), HEIGHT, WIDTH)
    frame = renderer.frame(0, channels=("depth",))
    assert set(frame.images) == {"depth"}
    depth, more, all_of_them = (
        kernels(lambda names=names: renderer.frame(1, channels=names))[0]["operation_count"]
        for names in (("depth",), ("depth", "albedo"), FRAME))
    assert depth < more < all_of_them


@pytest.mark.parametrize("name", ["box", "room", "far"])
def test_positions_project_to_pixel_centres_and_to_their_depth(name):
    scene = small_scene(at=(1e6, -1e6, 3e5)) if name == "far" else catalog.load(name)
    frame = Renderer(scene, HEIGHT, WIDTH).frame(5)
    hit = frame["id"] >= 0
    rows, columns = np.nonzero(hit)
    if name == "far":  # float32 positions have no such digits there, depth has
        world_from_camera = np.linalg.inv(frame.camera_from_world)
        screen_from_camera = (frame.screen_from_world @ world_from_camera)[[0, 1, 3], :3]
        pixel = np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))])
        local = frame["depth"][hit] * np.linalg.solve(screen_from_camera, pixel)
        position = world_from_camera @ np.vstack([local, np.ones(len(rows))])
        floor = frame["id"][hit] == scene.object_names.index("floor")
        np.testing.assert_allclose(position[1][floor], -1e6, atol=1e-5)
        return
    screen = frame.screen_from_world @ np.vstack([frame["position"][hit].T, np.ones(len(rows))])
    np.testing.assert_allclose(screen[3], frame["depth"][hit], rtol=1e-5)
    np.testing.assert_allclose(screen[0] / screen[3], columns + 0.5, atol=2e-3)
    np.testing.assert_allclose(screen[1] / screen[3], rows + 0.5, atol=2e-3)


def test_object_matrices_carry_a_surface_point_to_where_the_next_frame_sees_it():
    """A point of the ball at frame 2, moved by the matrices, lies on the ball at frame 3."""
    renderer = Renderer(small_scene(), 60, 80)
    now, later = renderer.frame(2), renderer.frame(3)
    ball = renderer.scene.object_names.index("ball")
    points = now["position"][now["id"] == ball]
    later_from_now = later.world_from_object[ball] @ np.linalg.inv(now.world_from_object[ball])
    screen = later.screen_from_world @ later_from_now @ np.vstack([points.T, np.ones(len(points))])
    x, y = (screen[:2] / screen[3]).astype(int)
    seen = (later["id"][y, x] == ball) & (np.abs(later["depth"][y, x] - screen[3]) < 0.05)
    assert seen.mean() > 0.8


def test_background_and_ids_follow_the_channel_table():
    frame = Renderer(small_scene(), HEIGHT, WIDTH).frame(0)
    background = frame["id"] == -1
    assert background.any()
    for name in ("albedo", "normal", "position", "depth", "color"):
        assert not frame[name][background].any(), name
    assert set(np.unique(frame["id"])) <= {-1, 0, 1, 2}
    assert (frame["depth"][~background] > 0).all()


def test_normals_have_unit_length_and_face_the_camera():
    for name in ("box", "room"):
        frame = Renderer(catalog.load(name), HEIGHT, WIDTH).frame(3)
        hit = frame["id"] >= 0
        normals = frame["normal"][hit]
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
        eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
        toward = np.einsum("ij,ij->i", normals, eye - frame["position"][hit])
        assert (toward > 0).mean() > 0.98  # interpolated normals may tip over at silhouettes


def test_normals_of_a_surface_seen_from_behind_face_the_camera():
    floor = next(s for s in small_scene().shapes if s.name == "floor")
    below = replace(floor, world_from_object=rotate((1, 0, 0), 90) @ scale(3))
    shapes = tuple(below if s.name == "floor" else s for s in small_scene().shapes)
    frame = Renderer(small_scene(shapes=shapes), HEIGHT, WIDTH).frame(0)
    seen = frame["id"] == 1
    assert seen.sum() > 50
    np.testing.assert_allclose(frame["normal"][seen], [[0, 1, 0]] * seen.sum(), atol=1e-6)


def test_gbuffer_agrees_with_mitsubas_own_at_the_same_points():
    renderer = Renderer(small_scene(), HEIGHT, WIDTH)
    frame = renderer.frame(4)
    sensor = renderer.stage.sensor(HEIGHT, WIDTH)
    x, y = np.meshgrid((np.arange(WIDTH) + 0.5) / WIDTH, (np.arange(HEIGHT) + 0.5) / HEIGHT)
    ray, _ = sensor.sample_ray(0, 0, mi.Point2f(x.ravel(), y.ravel()), mi.Point2f(0.5))
    si = renderer.stage.mi_scene.ray_intersect(ray)
    expected = np.where(si.is_valid().numpy(), si.t.numpy(), 0).reshape(HEIGHT, WIDTH)
    eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
    length = np.linalg.norm(frame["position"] - eye, axis=2)
    np.testing.assert_allclose(np.where(frame["id"] >= 0, length, 0), expected, atol=2e-4)


def test_albedo_is_one_where_a_surface_is_a_rough_mirror():
    mirror = {"type": "roughconductor", "material": "none"}
    shapes = tuple(replace(shape, material=mirror) if shape.name == "ball" else shape
                   for shape in small_scene().shapes)
    frame = Renderer(small_scene(shapes=shapes), HEIGHT, WIDTH).frame(4)
    ball = frame["id"] == 0
    assert ball.any()
    assert (frame["albedo"][ball] == 1).all()


def test_an_object_mirrored_by_its_transform_still_faces_outward():
    """Faces of a one-sided material that were turned inward would be black."""
    def render_with(flip: float):
        block = Shape("ball", Mesh(CORNERS, INWARD[:, ::-1]), gray()["bsdf"],
                      lambda f: translate((0.1, 0.6, 0)) @ scale((0.5, 0.5 * flip, 0.5)))
        shapes = tuple(block if s.name == "ball" else s for s in small_scene().shapes)
        frame = Renderer(small_scene(shapes=shapes), HEIGHT, WIDTH).frame(1)
        return frame["color"][frame["id"] == 0]

    assert render_with(1).mean() > 0.1
    assert render_with(-1).mean() == pytest.approx(render_with(1).mean(), rel=0.3)


def test_an_empty_size_and_a_stretched_ball_are_refused_in_a_sentence():
    with pytest.raises(InputError, match="0x4 is empty"):
        Renderer(small_scene(), 4, 0)
    shapes = (*small_scene().shapes, Shape("egg", Sphere(), gray(), scale((1, 2, 1))))
    with pytest.raises(SceneError, match=r"'egg'.*use a mesh"):
        Renderer(small_scene(shapes=shapes), 4, 4)
