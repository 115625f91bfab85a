"""Data of vertices and faces are shown where they are: in frames, moved, merged, multiplied."""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest

from onespp.render.mitsuba import merged
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.textures import PRODUCT, STEP
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import meshes
from onespp.scenes.animation import compose, spin
from onespp.scenes.description import Camera, Mesh, Rectangle, Scene, SceneError, Shape
from onespp.scenes.materials import diffuse
from onespp.scenes.transforms import look_at, rotate, scale, translate

HEIGHT, WIDTH = 24, 32
CORNERS = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
FACES = np.array([(0, 1, 2), (0, 2, 3)])
COLORS = np.array([(0.9, 0.1, 0.2), (0.2, 0.8, 0.1), (0.1, 0.3, 0.9), (0.6, 0.7, 0.5)])


def shows(name: str, **more) -> dict:
    return {"type": "mesh_attribute", "name": name, **more}


def quad(uv: bool = False, **attributes: np.ndarray) -> Mesh:
    return Mesh(CORNERS, FACES, None, CORNERS[:, :2] / 2 + 0.5 if uv else None,
                attributes)


def scene(*shapes: Shape) -> Scene:
    lamp = Shape("lamp", Rectangle(), diffuse((0, 0, 0)), translate((0, 0, 9)) @ scale((-1, 1, 1)),
                 emission=5.0)
    return Scene("t", "", (*shapes, lamp), Camera(look_at((0, 0, 4), (0, 0, 0)), 40), 4, WIDTH,
                 HEIGHT, 3, environment=0.5)


def seen(made: Scene, *names: str, frame: int = 0) -> list[np.ndarray]:
    images = Renderer(made, HEIGHT, WIDTH).frame(frame, 0, ("id", *names)).images
    return [images[name] for name in ("id", *names)]


def places(world_from_object: np.ndarray) -> np.ndarray:
    """(h, w, 2) object space x and y of what pixels see of the plane z = 0."""
    camera = Camera(look_at((0, 0, 4), (0, 0, 0)), 40)
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    pixels = np.stack([x, y, np.ones_like(x), np.ones_like(x)], -1)  # at depth 1
    rays = pixels @ np.linalg.inv(camera.screen_from_camera(HEIGHT, WIDTH)).T
    world_from_camera = camera.world_from_camera_at(0)
    directions = rays[..., :3] @ world_from_camera[:3, :3].T
    origin = world_from_camera[:3, 3]
    inverse = np.linalg.inv(world_from_object)
    start, along = inverse[:3, :3] @ origin + inverse[:3, 3], directions @ inverse[:3, :3].T
    return (start - along * (start[2] / along[..., 2])[..., None])[..., :2]


def between(values: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(h, w, k) what is linear in each triangle of the quad, of (4, k) values."""
    a, b, c, d = values
    x, y = x[..., None], y[..., None]
    return np.where(x > y, b + (x - 1) / 2 * (b - a) + (y + 1) / 2 * (c - b),
                    d + (x + 1) / 2 * (c - d) + (y - 1) / 2 * (d - a))


@pytest.mark.parametrize("uv", [False, True])
@pytest.mark.parametrize("wrap", [
    lambda texture: diffuse(texture),
    lambda texture: {"type": "principled", "base_color": texture, "roughness": 0.7}],
    ids=["diffuse", "principled"])
def test_the_albedo_is_the_colour_between_the_vertices(uv: bool, wrap):
    mesh = quad(uv, vertex_color=COLORS)
    ids, albedo = seen(scene(Shape("a", mesh, wrap(shows("vertex_color", scale=0.9)))), "albedo")
    x, y = np.moveaxis(places(np.eye(4)), -1, 0)
    there = ids == 0
    assert there.sum() > 200
    np.testing.assert_allclose(albedo[there], 0.9 * between(COLORS, x, y)[there], atol=2e-6)


def test_faces_are_of_one_colour_each_also_mirrored():
    mesh = quad(face_color=np.array([(0.8, 0.1, 0.2), (0.1, 0.3, 0.9)]))
    place = rotate((0, 0, 1), 20) @ scale((-0.8, 0.9, 1))
    ids, albedo = seen(scene(Shape("a", mesh, diffuse(shows("face_color")), place)), "albedo")
    x, y = np.moveaxis(places(place), -1, 0)
    clear = (ids == 0) & (abs(x - y) > 1e-3)
    np.testing.assert_allclose(albedo[clear], mesh.attributes["face_color"][
        (x < y).astype(int)][clear], atol=1e-6)


def test_what_moves_takes_its_colours_along():
    mesh, turn = quad(vertex_color=COLORS), spin((0, 0, 1), 8)
    flips = compose(turn, lambda frame: scale((-1 if frame > 1 else 1, 1, 1)))
    material = diffuse(shows("vertex_color"))
    renderer = Renderer(scene(Shape("a", mesh, material, flips)), HEIGHT, WIDTH)
    for frame in (0, 1, 2, 3, 0):
        moved = renderer.frame(frame, 0, ("albedo", "id")).images
        still = seen(scene(Shape("a", mesh, material, flips(frame))), "albedo")[1]
        np.testing.assert_allclose(moved["albedo"], still, atol=1e-5)
        assert np.ptp(moved["albedo"][moved["id"] == 0], axis=0).min() > 0.2


def test_roughness_and_holes_are_those_of_the_vertices():
    rough = np.linspace(0.2, 0.8, 4)[:, None]
    holes = np.array([[0.0], [1], [1], [0]])  # x / 2 + 1 / 2
    mesh = quad(vertex_rough=rough, vertex_alpha=holes)
    metal = {"type": "roughconductor", "material": "none", "distribution": "ggx",
             "alpha": shows("vertex_rough")}
    back = Shape("b", Rectangle(), diffuse((0.2, 0.2, 0.2)), translate((0, 0, -1)) @ scale(3))
    ids, alpha = seen(scene(Shape("a", mesh, metal), back), "roughness")
    x, y = np.moveaxis(places(np.eye(4)), -1, 0)
    np.testing.assert_allclose(alpha[ids == 0], between(rough, x, y)[ids == 0, 0], atol=1e-5)
    step = {"type": STEP, "stepped": shows("vertex_alpha"), "at_least": 0.6}
    ids, = seen(scene(Shape("a", mesh, {"type": "mask", "opacity": step, "b": diffuse((1, 1, 1))}),
                      back))
    inside = (abs(x) < 0.99) & (abs(y) < 0.99) & (abs(x - 0.2) > 1e-3)
    np.testing.assert_array_equal(ids[inside], np.where(x > 0.2, 0, 1)[inside])


def test_a_product_is_that_of_both():
    picture = {"type": "bitmap", "bitmap": np.random.default_rng(1).random((4, 4, 3)), "raw": True}
    mesh = quad(True, vertex_color=COLORS)
    product = {"type": PRODUCT, "factor_0": picture, "factor_1": shows("vertex_color")}
    both, one, other = (seen(scene(Shape("a", mesh, diffuse(texture))), "albedo")[1]
                        for texture in (product, picture, shows("vertex_color")))
    np.testing.assert_allclose(both, one * other, atol=1e-6)
    color = seen(scene(Shape("a", mesh, diffuse({
        "type": PRODUCT, "factor_0": (0.5, 0.7, 0.9), "factor_1": shows("vertex_color")}))),
        "albedo")[1]
    np.testing.assert_allclose(color, other * (0.5, 0.7, 0.9), atol=1e-6)


def test_mitsubas_own_path_shows_them_too():
    mesh = quad(True, vertex_color=COLORS)
    stage = MitsubaScene(scene(Shape("a", mesh, diffuse(shows("vertex_color")))))
    image = mi.render(stage.mi_scene, sensor=stage.sensor(HEIGHT, WIDTH), spp=64,
                      integrator=mi.load_dict({"type": "path", "max_depth": 3}))
    ours = Renderer(stage.description, HEIGHT, WIDTH).sample_sum(0, 1, 0, 64, antialias=True) / 64
    np.testing.assert_allclose(np.array(image)[..., :3].mean((0, 1)), ours.mean((0, 1)), rtol=0.01)


def crowd(spread: bool) -> Scene:
    """72 boxes of one material, whose colours differ; `spread`: a few have other attributes."""
    rng, block, material = np.random.default_rng(2), meshes.box((0.3, 0.3, 0.3)), diffuse(
        shows("vertex_color"))
    made = []
    for i in range(72):
        attributes = {"vertex_color": rng.random((len(block.vertices), 3))}
        if spread and i % 9 == 0:
            attributes["face_w"] = rng.random((len(block.faces), 1))
        place = translate((0.4 * (i % 9 - 4), 0.4 * (i // 9 - 4), 0)) @ rotate((1, 1, 0), 40)
        if i % 5 == 0:
            place = place @ scale((-1, 1, 1))
        made.append(Shape(f"block {i:02d}", replace(block, attributes=attributes), material, place))
    return scene(*made)


def test_merged_meshes_keep_their_colours(monkeypatch: pytest.MonkeyPatch):
    for spread in (False, True):
        made = crowd(spread)
        assert len(MitsubaScene(made).mi_scene.shapes()) == 2 + spread
        together = seen(made, "albedo")
        with monkeypatch.context() as few:
            few.setattr(merged, "MANY", 1000)
            assert len(MitsubaScene(made).mi_scene.shapes()) == 73
            apart = seen(made, "albedo")
        for a, b in zip(together, apart):
            np.testing.assert_allclose(a, b, atol=1e-5)


def test_scenes_that_show_them_leave_nothing_behind():
    made, numbers = scene(Shape("a", quad(vertex_color=COLORS), diffuse(shows("vertex_color")))), []
    for _ in range(4):
        stage = MitsubaScene(made)
        numbers.append(len(stage.id_from_registry))
        del stage
        gc.collect()
    assert len(set(numbers[1:])) == 1, numbers


@pytest.mark.parametrize(("material", "words"), [
    ({"type": "roughplastic", "diffuse_reflectance": shows("vertex_color")}, "such as a mesh_attr"),
    ({"type": "bumpmap", "a": shows("vertex_w"), "b": {"type": "diffuse"}}, "such as a mesh_attr"),
    (diffuse(shows("vertex_color", colour=1.0)), "has a property 'colour'"),
    (diffuse({"type": PRODUCT, "factor_0": 0.5}), "factor_1"),
])
def test_what_cannot_be_shown_is_refused_in_a_sentence(material, words: str):
    mesh = quad(vertex_color=COLORS, vertex_w=COLORS[:, :1])
    with pytest.raises(SceneError, match=words) as caught:
        MitsubaScene(scene(Shape("a", mesh, material)))
    assert "the material of shape 'a'" in str(caught.value)
    assert str(caught.value).isprintable()
