"""Layers left aside: what they are, and that their lamps are the mean of what samples find."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from onespp.render.channels import FRAME, GLOSS, LAYER
from onespp.render.errors import InputError
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Camera, Disk, Mesh, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse, glass, pane
from onespp.scenes.meshes import box
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance

X, Y = (1, 0, 0), (0, 1, 0)
BACK = Shape("back", Rectangle(), diffuse((0.2, 0.4, 0.6)),
             translate((0, 0, 6)) @ rotate(Y, 180) @ scale(9))
WALL = Shape("wall", Rectangle(), diffuse((0.5, 0.5, 0.5)), translate((0, 0, -3)) @ scale(9))
CAMERA = Camera(look_at((0, 0, 4), (0, 0, 0)), fov=2)
r = ((1.5 / 1.000277 - 1) / (1.5 / 1.000277 + 1)) ** 2  # of one side, along the normal
SHEET = 2 * r / (1 + r)  # of both, one after another


def round_box() -> Mesh:
    """A cube that is shaded as if it were a ball."""
    cube = box((1, 1, 1))
    return replace(cube, normals=cube.vertices / np.linalg.norm(cube.vertices, axis=1)[:, None])


def through(*shapes: Shape, size: int = 9, **more) -> Renderer:
    scene = Scene("seen", "for a test", shapes, CAMERA, 1, size, size, 6, **more)
    return Renderer(scene, size, size, direct="resampled", sampler="zsobol")


@pytest.fixture(scope="module")
def quarters():
    """A pane, a slab of glass and two veils, one in each quarter of the picture: what is seen in
    the middle of each, with the names of objects."""
    corners = {"pane": (-1, 1), "slab": (1, 1), "thin veil": (-1, -1), "veil": (1, -1)}

    def veil(opacity):
        return {"type": "mask", "opacity": opacity, "bsdf": diffuse((0.2, 0.5, 0.1))}

    forms = {"pane": (Rectangle(), pane(), scale(0.03)),
             "slab": (box((0.06, 0.06, 0.5)), glass(), scale(1)),
             "thin veil": (Rectangle(), veil(0.3), scale(0.03)),
             "veil": (Rectangle(), veil(0.7), scale(0.03))}
    shapes = [Shape(name, form, material, translate((0.035 * x, 0.035 * y, 0)) @ size)
              for (name, (x, y)), (form, material, size) in zip(corners.items(), forms.values())]
    renderer = through(*shapes, WALL, replace(BACK, emission=(2.0, 1.0, 0.5)))
    frame, names = renderer.frame(0, 0, renderer.channels), renderer.stage.images.names()
    seen = {name: {c: frame[c][4 - 2 * y, 4 + 2 * x] for c in renderer.channels}
            for name, (x, y) in corners.items()}
    return {name: here | {c: names[here[c]] for c in ("id", "layer_id")}
            for name, here in seen.items()}


def test_a_pane_shows_what_is_behind_the_camera_beside_what_is_behind_the_pane(quarters):
    here = quarters["pane"]
    assert (here["id"], here["layer_id"]) == ("wall", "back in pane")
    assert here["layer_share"] == pytest.approx(SHEET, rel=1e-3)
    assert [here["depth"], here["layer_depth"]] == pytest.approx([7, 10], rel=1e-3)
    np.testing.assert_allclose(here["layer_albedo"], SHEET * np.array((0.2, 0.4, 0.6)), rtol=1e-3)
    np.testing.assert_allclose(here["layer_normal"], (0, 0, 1), atol=1e-5)
    np.testing.assert_allclose(here["emission"], SHEET * np.array((2.0, 1.0, 0.5)), rtol=1e-3)
    assert here["specular"].min() > 0  # what the wall lights there comes back as well


def test_all_layers_show_their_lamps_and_the_brightest_its_guides(quarters):
    """Of a thick pane the far side's, which has been through the near one twice, is the weaker."""
    here = quarters["slab"]
    np.testing.assert_allclose(here["emission"], (r + (1 - r) ** 2 * r) * np.array(
        (2.0, 1.0, 0.5)), rtol=1e-3)
    assert here["layer_share"] == pytest.approx(r / (r + (1 - r) ** 2), rel=1e-3)
    assert here["layer_depth"] == pytest.approx(4 - 0.25 + 6 - 0.25, rel=1e-3)


@pytest.mark.parametrize(("veil", "other", "albedo", "depth"), [
    ("thin veil", "thin veil", (0.06, 0.15, 0.03), 4), ("veil", "wall", (0.15, 0.15, 0.15), 7)])
def test_a_mask_has_the_other_layer_before_or_behind_its_hole(quarters, veil, other, albedo, depth):
    here = quarters[veil]
    assert here["layer_id"] == other
    assert here["layer_share"] == pytest.approx(0.3, rel=1e-4)
    assert here["layer_depth"] == pytest.approx(depth, rel=1e-3)
    np.testing.assert_allclose(here["layer_albedo"], albedo, rtol=2e-3)


def test_lamps_have_no_noise_and_the_mean_of_what_samples_find_of_them():
    """Behind and in a ball and a veil, under a sky: by rays that turn many ways."""
    half = {"type": "checkerboard", "color0": 0.3, "color1": 0.8}
    shapes = (Shape("ball", Sphere(), glass(), translate((-0.03, 0, 0)) @ scale(0.04)), WALL,
              Shape("lamp", Disk(), diffuse((0, 0, 0)), translate((0.1, 0.2, 1.5)) @ rotate(X, 90)
                    @ scale(0.1), (9.0, 7.0, 5.0)),
              Shape("veil", Rectangle(), {"type": "mask", "opacity": half, "bsdf": glass()},
                    translate((0.06, 0, 0)) @ rotate(Y, 30) @ scale((0.03, 0.06, 1))))
    renderer = through(*shapes, size=18, environment=(0.5, 1.0, 2.0))
    frames = [renderer.frame(0, seed, renderer.channels) for seed in range(48)]
    for name in ("emission", *LAYER):
        np.testing.assert_array_equal(frames[0][name], frames[1][name], err_msg=name)
    mean, variance = mean_and_variance([blocks(frame["color"], 6) for frame in frames])
    truth = mean_and_variance([blocks(renderer.sample_sum(0, 7, part, 64) / 64, 6)
                               for part in range(24)])
    assert_same_mean(mean, variance, *truth)


def shares_of_a_ball(renderer: Renderer, index: float) -> tuple[np.ndarray, np.ndarray]:
    """Of a unit ball in the middle: where it is, and what each of its surfaces reflects there."""
    size = renderer.height
    x = (2 * (np.arange(size) + 0.5) / size - 1) * np.tan(
        np.radians(renderer.scene.camera.fov / 2))
    slope = np.hypot(*np.meshgrid(x, x))
    sine = 4 * slope / np.sqrt(1 + slope**2)
    is_ball = sine < 1
    outside, inside = (np.sqrt(1 - np.where(is_ball, s, 0)**2) for s in (sine, sine / index))
    reflected = 0.5 * (((index * outside - inside) / (index * outside + inside))**2
                       + ((outside - index * inside) / (outside + index * inside))**2)
    return is_ball, reflected


@pytest.fixture(scope="module")
def ball_under_a_sky():
    scene = Scene("ball", "for a test", (Shape("ball", Sphere(), glass()),),
                  replace(CAMERA, fov=29), 1, 32, 32, 12, environment=1.0)
    return Renderer(scene, 32, 32, direct="resampled", sampler="zsobol")


def test_a_ball_shows_the_sky_by_three_reflections_inside(ball_under_a_sky):
    """One more than turns where light goes on through it and the layer begins behind the first."""
    renderer = ball_under_a_sky
    is_ball, r = shares_of_a_ball(renderer, 1.5 / 1.000277)
    emission = renderer.frame(0, 0, ("emission",))["emission"]
    told = r + (1 - r)**2 * (1 + r + r**2 + r**3)
    tried = is_ball & (r > 0.1) & (r < 0.25)
    assert tried.sum() > 50
    np.testing.assert_allclose(emission[tried], np.repeat(told[tried, None], 3, 1), rtol=2e-4)
    np.testing.assert_allclose(emission[~is_ball], 1, rtol=1e-6)


def test_and_what_chance_finds_beyond_makes_it_whole(ball_under_a_sky):
    """It is as bright as the sky, at the rim too: what is told is not found once more."""
    renderer = ball_under_a_sky
    is_ball, r = shares_of_a_ball(renderer, 1.5 / 1.000277)
    rings = [is_ball & (r >= low) & (r < low + 0.2) for low in (0, 0.2, 0.4)]

    def in_rings(image: np.ndarray) -> np.ndarray:
        return np.array([image[ring].mean() for ring in rings])

    mean, variance = mean_and_variance(
        [in_rings(renderer.frame(0, seed, ("color",))["color"]) for seed in range(256)])
    inside = renderer.scene.max_depth - 2  # segments: paths leave out what is reflected more often
    assert_same_mean(mean, variance, in_rings(1 - (1 - r) * r**inside))


@pytest.mark.parametrize(("form", "material", "is_so"), [
    (Sphere(), glass(), True), (Sphere(), pane(), False), (Disk(), glass(), False),
    (Rectangle(), glass(), False), (box((1, 1, 1)), glass(), False),
    (round_box(), glass(), True)])
def test_glass_is_bent_where_normals_of_a_face_differ(form, material, is_so):
    stage = through(Shape("it", form, material), environment=1.0).stage
    assert (stage.bent_glass is not None) == is_so


def test_scenes_without_such_surfaces_have_no_layers():
    renderer = through(WALL, environment=1.0)
    assert renderer.channels[:len(FRAME)] == FRAME
    assert not {*renderer.channels} & {*LAYER, *GLOSS}
    with pytest.raises(InputError, match="layer_share need a scene with clear glass or masks"):
        renderer.frame(0, 0, ("color", "layer_share"))
