"""Primary surface replacement: images are where mirrors and glass put them; the mean stays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from onespp.render.channels import CAUSTIC, FRAME, GLOSS, LAYER
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Camera, Disk, Rectangle, Scene, Shape, Sphere
from onespp.scenes.hard import HARD
from onespp.scenes.materials import checks, cutout, diffuse, glass, mirror, pane, varnish
from onespp.scenes.meshes import box
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance

H, W = 36, 48
X, Y = (1, 0, 0), (0, 1, 0)
FLOOR = Shape("floor", Rectangle(), diffuse(checks((0.7, 0.7, 0.7), (0.2, 0.3, 0.4))),
              rotate(X, -90) @ scale(5))
BALL = Shape("ball", Sphere(), diffuse((0.6, 0.1, 0.1)),
             lambda f: translate((-0.6 + 0.2 * f, 0.5, 0.4)) @ rotate(Y, 10 * f) @ scale(0.4))
LAMP = Shape("lamp", Disk(), diffuse((0, 0, 0)), translate((0, 4, 1)) @ rotate(X, 90),
             (12.0, 11.0, 9.0))
CAMERA = Camera(look_at((0.2, 1.4, 5), (0, 0.8, 0)), fov=40)


def seen(*shapes: Shape, frame: int = 2, camera: Camera = CAMERA, depth: int = 5):
    """A frame, and the names of what its IDs stand for."""
    scene = Scene("seen", "for a test", (FLOOR, BALL, LAMP, *shapes), camera, 6, W, H, depth)
    renderer = Renderer(scene, H, W, direct="resampled")
    return renderer.frame(frame, channels=renderer.channels), renderer.stage.images.names()


def reflection(point, normal) -> np.ndarray:
    n, moved = np.asarray(normal, float) / np.linalg.norm(normal), np.eye(4)
    moved[:3, :3] -= 2 * np.outer(n, n)
    moved[:3, 3] = 2 * n * (n @ point)
    return moved


def guides_of(frame, mask) -> dict[str, np.ndarray]:
    return {name: frame[name][mask] for name in ("position", "normal", "depth", "albedo")}


def at_image(mask) -> np.ndarray:
    """Without borders, where a rounding decides what is seen."""
    inner = mask.copy()
    for axis in (0, 1):
        for step in (1, -1):
            inner &= np.roll(mask, step, axis)
    return inner


def test_a_flat_mirror_shows_what_would_be_behind_it():
    """The guides are those of a scene in which all of it stands behind the mirror's place."""
    place = translate((0, 1, -1)) @ rotate(Y, 9) @ rotate(X, 4) @ scale((1.5, 1, 1))
    frame, names = seen(Shape("mirror", Rectangle(), mirror((0.9, 0.8, 0.5)), place))
    r = reflection(place[:3, 3], place[:3, 2])
    world = [replace(shape, world_from_object=lambda f, s=shape: r @ s.world_from_object_at(f))
             for shape in (FLOOR, BALL, LAMP)]
    scene = Scene("behind", "for a test", tuple(world), CAMERA, 6, W, H)
    behind = Renderer(scene, H, W).frame(2)
    for name, fewest in (("floor", 80), ("ball", 4)):
        image = at_image(frame["id"] == names.index(f"{name} in mirror"))
        assert image.sum() > fewest
        assert (behind["id"][image] == scene.object_names.index(name)).all()
        expected = guides_of(behind, image)
        expected["albedo"] = expected["albedo"] * np.array((0.9, 0.8, 0.5), np.float32)
        for guide, value in guides_of(frame, image).items():
            np.testing.assert_allclose(value, expected[guide], rtol=2e-3, atol=2e-3, err_msg=guide)


def test_images_in_flat_mirrors_move_by_their_matrices():
    """Of a mirror that turns, and a ball that rolls: the surface that a pixel shows was, one frame
    before, where its image's matrix says; algebra of two reflections says where that is."""
    place = lambda f: translate((0, 1, -1)) @ rotate(Y, 5 * f) @ scale((1.5, 1, 1))  # noqa: E731
    shape = Shape("mirror", Rectangle(), mirror(), place)
    (now, names), (before, _) = seen(shape, frame=2), seen(shape, frame=1)
    for name, moved in (("floor", FLOOR), ("ball", BALL)):
        i = names.index(f"{name} in mirror")
        image = now["position"][now["id"] == i].astype(np.float64)
        assert len(image) > 9
        step = before.world_from_object[i] @ np.linalg.inv(now.world_from_object[i])
        r, s = (reflection(place(f)[:3, 3], place(f)[:3, 2]) for f in (2, 1))
        point = image @ r[:3, :3].T + r[:3, 3]
        motion = moved.world_from_object_at(1) @ np.linalg.inv(moved.world_from_object_at(2))
        point = point @ motion[:3, :3].T + motion[:3, 3]
        expected = point @ s[:3, :3].T + s[:3, 3]
        np.testing.assert_allclose(image @ step[:3, :3].T + step[:3, 3], expected, atol=1e-6)
        assert np.abs(expected - image).max() > 0.05


def test_what_is_seen_in_two_mirrors_has_been_reflected_twice():
    """Two of them at a right angle turn what they show by half a turn."""
    walls = (Shape("left", Rectangle(), mirror(),
                   translate((-1, 1, -1)) @ rotate(Y, 45) @ scale((1.41, 1, 1))),
             Shape("right", Rectangle(), mirror(),
                   translate((1, 1, -1)) @ rotate(Y, -45) @ scale((1.41, 1, 1))))
    frame, names = seen(*walls, frame=5)
    image = at_image(frame["id"] == names.index("ball in several"))
    assert image.sum() > 3
    corner = np.array([0, 0, -2])  # where the mirrors would meet; y stays
    point = frame["position"][image] * (-1, 1, -1) + 2 * corner
    centre = BALL.world_from_object_at(5)[:3, 3]
    np.testing.assert_allclose(np.linalg.norm(point - centre, axis=1), 0.4, atol=2e-3)
    np.testing.assert_allclose(frame["normal"][image] * (-1, 1, -1), (point - centre) / 0.4,
                               atol=1e-2)
    np.testing.assert_allclose(frame["albedo"][image], np.tile((0.486, 0.081, 0.081), (
        image.sum(), 1)), atol=1e-3)


def _in_a_mirror(s: float, r: float) -> float:
    return s / (1 + 2 * s / r)


def _in_glass(s: float, r: float) -> float:
    """Through the far side of a ball of glass, and then through the near one."""
    in_ball = 2 * r + s / (2 / 3 - s / (3 * r))
    return in_ball / (1.5 - 0.5 * in_ball / r)


@pytest.mark.parametrize(("material", "place", "s", "image"), [
    (mirror(), translate((0, 0, 5)), 4.5, _in_a_mirror),
    (glass(), translate((0, 0, -0.6)), 0.1, _in_glass),  # upright, and far
    (glass(), translate((0, 0, -2.5)), 2.0, _in_glass)], ids=["mirror", "near", "upside down"])
def test_images_in_a_ball_are_where_the_paraxial_equations_say(material, place, s, image):
    """Along the axis, where those are exact."""
    r, eye = 0.5, 4.0
    wall = Shape("wall", Rectangle(), diffuse((0.5, 0.5, 0.5)), place @ scale(9))
    scene = Scene("axis", "for a test", (Shape("ball", Sphere(), material, scale(r)), wall, LAMP),
                  Camera(look_at((0, 0, eye), (0, 0, 0)), fov=2), 2, 9, 9, 6)
    frame = Renderer(scene, 9, 9).frame(0)
    assert frame["id"][4, 4] == 2 + 3
    assert frame["depth"][4, 4] == pytest.approx(eye - r + image(s, r), rel=5e-3)


def test_normals_behind_glass_turn_as_light_does():
    """Behind one surface of glass, at 30 degrees: by Snell's law, in float64."""
    camera = Camera(look_at((0, 0, 4), (0, 0, 0)), fov=2)
    tilted = rotate(Y, 30)
    wall = Shape("wall", Rectangle(), diffuse((0.5, 0.5, 0.5)), translate((0, 0, -3)) @ scale(9))
    scene = Scene("snell", "for a test", (Shape("glass", Rectangle(), glass(), tilted), wall, LAMP),
                  camera, 1, 9, 9, 6)
    frame = Renderer(scene, 9, 9).frame(0)
    d, m = np.array([0, 0, -1.0]), tilted[:3, 2]
    cosine, eta = -d @ m, 1.5 / 1.000277  # of air, as Mitsuba has it
    onward = d / eta + (cosine / eta - np.sqrt(1 - (1 - cosine**2) / eta**2)) * m
    v = np.cross(onward, d)
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    turn = np.eye(3) + cross + cross @ cross / (1 + onward @ d)
    assert frame["id"][4, 4] == 2
    np.testing.assert_allclose(frame["normal"][4, 4], turn @ (0, 0, 1), atol=1e-5)
    assert abs(frame["normal"][4, 4, 0]) > 0.1


def test_what_is_behind_a_pane_or_a_hole_is_itself():
    """Its ID, its place but for what the pane's glass shifts it by, and its matrices."""
    plain, _ = seen()
    stripes = np.zeros((8, 8), bool)
    stripes[:, ::2] = True
    panes = {"pane": (Shape("pane", box((2, 1.6, 0.05)), glass(), translate((0, 1, 1.5))), 0.03),
             "sheet": (Shape("sheet", Rectangle(), pane(), translate((0, 1, 1.5))), 1e-3),
             "holes": (Shape("holes", Rectangle(), cutout(diffuse((0.2, 0.5, 0.1)), stripes),
                             translate((0, 1, 1.5))), 3e-4)}
    for name, (shape, off) in panes.items():
        frame, names = seen(shape)
        ball = at_image(frame["id"] == names.index("ball"))
        assert ball.sum() > 4, name
        same = at_image(plain["id"] == 0) & ball
        assert same.sum() > 0.7 * ball.sum()
        for guide in ("position", "normal"):
            np.testing.assert_allclose(frame[guide][same], plain[guide][same], atol=4 * off,
                                       err_msg=f"{guide} of {name}")
        expected = plain["albedo"][same]
        left = frame["albedo"][same] / expected
        assert (left == 1).all() if name == "holes" else ((left < 0.95) & (left > 0.8)).all()


def veils() -> Scene:
    """Varnish and glass of many opacities, one behind the other."""
    half = {"type": "checkerboard", "color0": 0.3, "color1": 0.8}
    materials = (varnish((0.6, 0.3, 0.1)), glass(), diffuse((0.2, 0.5, 0.7)))
    return Scene("veils", "for a test", (FLOOR, BALL, LAMP, *(
        Shape(f"veil {i}", Rectangle(), {"type": "mask", "opacity": half, "bsdf": material},
              translate((0.3 * i, 1, 0.9 + 0.4 * i)) @ rotate(Y, 12 * i))
        for i, material in enumerate(materials))), CAMERA, 6, W, H)


@pytest.mark.parametrize("name", ["moving-mirror", "glass-ball", "veils"])
def test_frames_have_the_mean_of_the_reference(name):
    """Which goes through all of it by chance."""
    scene = veils() if name == "veils" else HARD[name].make()
    depth = 3 if name == "veils" else 6  # (how long paths may be counts what they went through)
    renderer = Renderer(replace(scene, max_depth=depth), 24, 36, direct="resampled",
                        sampler="zsobol")
    ours = [renderer.frame(4, seed, ("color",))["color"] for seed in range(100)]
    reference = [renderer.sample_sum(4, 9, k, 32) / 32 for k in range(16)]
    a, b = (mean_and_variance([blocks(image, 6) for image in i]) for i in (ours, reference))
    assert_same_mean(*a, *b)


def test_half_open_masks_under_an_even_sky_are_as_bright_as_in_closed_form():
    """1 - o of the sky, and o of what the surface leaves of it: diffuse ones have as much by light
    sampling as by what directions run into, so both densities have to have the opacity in them."""
    albedo, quarters = 0.9, [(o, is_mirror) for is_mirror in (False, True) for o in (0.3, 0.7)]
    shapes = tuple(
        Shape(f"veil {i}", Rectangle(), {"type": "mask", "opacity": o, "bsdf":
              mirror((albedo,) * 3) if is_mirror else diffuse((albedo,) * 3)},
              translate((2 * (i % 2) - 1, 1 - 2 * (i // 2), 0)))
        for i, (o, is_mirror) in enumerate(quarters))
    scene = Scene("sky", "for a test", shapes, Camera(look_at((0, 0, 4), (0, 0, 0)), fov=20), 1, 8,
                  8, 3, environment=1.0)
    renderer = Renderer(scene, 8, 8, direct="resampled")
    ours = [renderer.frame(0, seed, ("color",))["color"][..., :1] for seed in range(64)]
    expected = np.array([1 - o + o * albedo for o, _ in quarters]).reshape(2, 2, 1)
    assert_same_mean(*mean_and_variance([blocks(image, 4) for image in ours]), expected)


def test_what_glass_reflects_of_the_lamp_is_emission_beside_light_of_its_own():
    frame, _ = seen(Shape("sheet", Rectangle(), pane(), translate((0, 1, 1.5)) @ rotate(X, -50)))
    both = (frame["roughness"] == 0) & (frame["id"] >= 0)
    assert both.sum() > 50
    assert frame["emission"][both].mean() > 0
    assert np.all(frame["specular"] <= frame["indirect"] + 1e-6)


@pytest.mark.parametrize("opacity", [0.3, 0.7])
def test_a_mask_is_looked_through_below_a_half(opacity):
    veil = Shape("veil", Rectangle(), {"type": "mask", "opacity": opacity, "bsdf": diffuse(
        (0.2, 0.5, 0.1))}, translate((0, 1, 1.5)) @ scale(2))
    (frame, names), (plain, _) = seen(veil), seen()
    ball = at_image(plain["id"] == 0)
    assert ball.sum() > 10
    if opacity < 0.5:
        assert (frame["id"][ball] == 0).all()
        np.testing.assert_allclose(frame["albedo"][ball], 0.7 * plain["albedo"][ball], rtol=1e-3)
    else:
        assert (frame["id"][ball] == names.index("veil")).all()
        np.testing.assert_allclose(frame["albedo"][ball], np.tile((0.14, 0.35, 0.07), (
            ball.sum(), 1)), rtol=2e-3)
    assert frame["specular"][ball].mean() > 0


def test_scenes_without_such_surfaces_have_no_images():
    frame, names = seen()
    assert names == ("ball", "floor", "lamp")
    assert len(frame.world_from_object) == 3


def test_images_have_names_of_their_own():
    odd = Shape("ball in mirror", Sphere(), diffuse((0.5, 0.5, 0.5)), translate((9, 0, 0)))
    _, names = seen(odd, Shape("mirror", Rectangle(), mirror(), translate((0, 1, -1))))
    assert len(set(names)) == len(names) == 5 * 3
    assert {"ball in mirror", "ball in mirror'"} < set(names)


def test_no_more_images_than_a_methods_tables_are_for():
    """The largest mirrors have rows of their own; what is in the others is "in several"."""
    balls = [Shape(f"mirror {i:02}", Sphere(), mirror(), translate((i - 10, 1, -1))
                   @ scale(0.2 + 0.01 * i)) for i in range(20)]
    _, names = seen(*balls)
    assert len(names) == 23 * (1 + 16 + 1)
    assert {"ball in mirror 04", "ball in mirror 19", "ball in several"} < set(names)
    assert "ball in mirror 03" not in names


def test_blends_with_glass_are_met_by_chance():
    half = {"type": "blendbsdf", "weight": 0.5, "a": glass(), "b": diffuse((0.5, 0.5, 0.5))}
    scene = Scene("seen", "for a test", (FLOOR, LAMP, Shape("it", Sphere(), half)), CAMERA, 1, W, H)
    assert not Renderer(scene, 8, 8).stage.images.any


def test_channels_of_gloss_caustics_and_layers_come_with_what_they_tell_of():
    shapes = {"mirror": (Rectangle(), mirror()), "pane": (Rectangle(), pane()),
              "metal ball": (Sphere(), mirror()), "glass ball": (Sphere(), glass())}
    found = {}
    for name, parts in shapes.items():
        scene = Scene("seen", "for a test", (FLOOR, LAMP, Shape("it", *parts)), CAMERA, 1, W, H)
        found[name] = Renderer(scene, 8, 8).channels
    assert found == {"mirror": FRAME, "pane": FRAME + GLOSS + LAYER, "metal ball": FRAME + CAUSTIC,
                     "glass ball": FRAME + GLOSS + CAUSTIC + LAYER}
