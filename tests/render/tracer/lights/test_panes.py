"""Light straight through masks and panes: against Mitsuba's `path`, and what frames tell of it."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.render.channels import FRAME, SHADOW, SPLIT
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Camera, Rectangle, Scene, Shape
from onespp.scenes.materials import diffuse, pane, varnish
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.path_images import path_images
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance

X, Y = (1, 0, 0), (0, 1, 0)
HEIGHT, WIDTH = 16, 24
NULL = {"type": "null"}


def sheet(name: str, height: float, material: dict, size: float = 3, x: float = 0) -> Shape:
    """One that lies between floor and lamp."""
    return Shape(name, Rectangle(), material,
                 translate((x, height, 0)) @ rotate(X, 90) @ scale(size))


def under(*sheets: Shape, depth: int = 6, lamp: float = 0.1, floor: dict | None = None) -> Scene:
    """A floor, which a camera below all sheets sees, and a lamp of that size above."""
    light = Shape("lamp", Rectangle(), diffuse((0.0, 0.0, 0.0)),
                  translate((0, 3, 0)) @ rotate(X, 90) @ scale(lamp),
                  (4 / lamp**2, 3 / lamp**2, 2 / lamp**2))
    return Scene("veiled", "for a test", (
        Shape("floor", Rectangle(), floor or diffuse((0.7, 0.5, 0.6)), rotate(X, -90) @ scale(3)),
        light, *sheets), Camera(look_at((0, 0.9, 2.5), (0, 0, 0)), fov=50), 1, WIDTH, HEIGHT,
        max_depth=depth)


def veil(material: dict, opacity: float | dict = 0.4) -> dict:
    return {"type": "mask", "opacity": opacity, "bsdf": material}


CHECKS = {"type": "checkerboard", "color0": 0.1, "color1": 0.9,
          "to_uv": scale(7)}
MIXED = (
    sheet("holes", 1.2, veil(diffuse((0.3, 0.8, 0.3)), CHECKS)),
    sheet("tinted", 1.5, {"type": "thindielectric", "specular_transmittance":
                          {"type": "rgb", "value": [0.9, 0.6, 0.5]}}),
    sheet("blend", 1.8, {"type": "blendbsdf", "weight": 0.6, "a": diffuse((0.5, 0.5, 0.5)),
                         "b": NULL}, size=0.8, x=0.4),
    sheet("mapped", 2.1, {"type": "normalmap", "normalmap": {
        "type": "bitmap", "raw": True, "bitmap": mi.Bitmap(np.full((2, 2, 3), [0.6, 0.5, 0.9],
                                                                   np.float32))},
        "bsdf": veil(diffuse((0.6, 0.6, 0.2)), 0.5)}, size=0.8, x=-0.5))


@pytest.mark.parametrize("depth", [4, 5, 9])
def test_paths_have_the_mean_of_mitsubas_path(depth):
    """Which counts a passage as a segment."""
    renderer = Renderer(under(*MIXED, depth=depth, lamp=1.2), HEIGHT, WIDTH)
    spp, replicates = 64, 16
    ours = [renderer.sample_sum(0, 0, k, spp, antialias=True) / spp for k in range(replicates)]
    theirs = path_images(renderer, 4 * spp, replicates)
    a, b = ([blocks(image, 8) for image in images] for images in (ours, theirs))
    assert np.mean(a) > 0.005
    assert_same_mean(*mean_and_variance(a), *mean_and_variance(b))


@pytest.mark.parametrize("direct", ["resampled", "mis"])
@pytest.mark.parametrize("floor", [diffuse((0.7, 0.5, 0.6)), varnish((0.6, 0.3, 0.1), 0.2)])
def test_frames_have_the_mean_of_the_reference(direct, floor):
    renderer = Renderer(under(*MIXED, depth=7, lamp=0.6, floor=floor), HEIGHT, WIDTH,
                        direct=direct)
    ours = [renderer.frame(0, seed, ("color",))["color"] for seed in range(150)]
    reference = [renderer.sample_sum(0, 9, k, 64) / 64 for k in range(16)]
    a, b = (mean_and_variance([blocks(image, 8) for image in i]) for i in (ours, reference))
    assert_same_mean(*a, *b)


@pytest.mark.parametrize("depth", [2, 3, 8])
def test_so_has_what_the_camera_sees_through_them_before_a_sky(depth):
    """And a lamp. Of many samples, each begins at the camera anew, also after one that ended where
    a normal map lets nothing be drawn."""
    materials = (veil(diffuse((0.3, 0.8, 0.3)), CHECKS), pane(), veil(diffuse((0.7, 0.7, 0.7))))
    tilted = {"type": "normalmap", "bsdf": diffuse((0.6, 0.6, 0.2)), "normalmap": {
        "type": "bitmap", "raw": True,
        "bitmap": mi.Bitmap(np.full((2, 2, 3), [0.95, 0.5, 0.7], np.float32))}}
    lamp = Shape("lamp", Rectangle(), diffuse((0.0, 0.0, 0.0)),
                 translate((0, 2.4, -1.1)) @ rotate(X, 90) @ scale(0.4), (2.0, 3.0, 4.0))
    shapes = (lamp, sheet("tilted", 0.8, veil(tilted, 0.5), size=1.2),
              *(sheet(f"sheet {i}", 1 + 0.3 * i, material, size=1.2, x=0.5 * i)
                for i, material in enumerate(materials)))
    before = Scene("sky", "for a test", shapes, Camera(look_at((0, -1, 2), (0, 1.2, 0)), fov=60), 1,
                   WIDTH, HEIGHT, max_depth=depth, environment=0.8)
    renderer = Renderer(before, HEIGHT, WIDTH, direct="resampled")
    images = [[renderer.sample_sum(0, 0, k, 64, antialias=antialias) / 64 for k in range(16)]
              for antialias in (True, False)]
    theirs = path_images(renderer, 64, 16)
    frames = [renderer.frame(0, k, ("color",))["color"] for k in range(150)]
    for a, b in ((images[0], theirs), (images[1], frames)):
        assert_same_mean(*mean_and_variance([blocks(image, 8) for image in a]),
                         *mean_and_variance([blocks(image, 8) for image in b]))


def told(*sheets: Shape, depth: int = 6, seed: int = 0):
    """Of a lamp so small that it does not matter which of its points is drawn."""
    scene = under(*sheets, depth=depth, lamp=0.003)
    return Renderer(scene, HEIGHT, WIDTH, direct="resampled").frame(
        0, seed, (*FRAME, *SPLIT, *SHADOW))


@pytest.mark.parametrize("count", [1, 3])
def test_what_lets_all_through_is_not_there(count):
    """Light finds its way as if there was nothing, though a path has a segment more for each."""
    clear = [sheet(f"sheet {i}", 1 + 0.5 * i, NULL) for i in range(count)]
    seen, plain = told(*clear), told()
    for name in ("direct", "unshadowed", "visibility", "blocker_distance", "light"):
        least = 0.01 if name == "light" else 1e-5
        np.testing.assert_allclose(seen[name], plain[name], rtol=2e-3, atol=least, err_msg=name)
    assert plain["direct"].mean() > 0.01
    assert not told(*clear, depth=1 + count)["direct"].any()
    assert told(*clear, depth=2 + count)["direct"].any()


@pytest.mark.parametrize(("material", "share"), [
    (veil(diffuse((0.0, 0.0, 0.0)), 0.25), 0.75), (pane(), None),
    ({"type": "blendbsdf", "weight": 0.3, "a": diffuse((0.0, 0.0, 0.0)), "b": NULL}, 0.3)])
def test_visibility_is_the_share_that_gets_through(material, share):
    """Beneath, where light falls straight down, whatever the numbers drawn."""
    seen, plain = told(sheet("sheet", 1.5, material)), told()
    straight = plain["visibility"] > 0
    straight &= np.hypot(plain["position"][..., 0], plain["position"][..., 2]) < 0.8
    ratio = seen["visibility"][straight] / plain["visibility"][straight]
    if share is None:  # Fresnel's r twice over 1 + r, at an index of 1.5
        share = 1 - 2 * 0.04 / 1.04
    assert straight.sum() > 20
    np.testing.assert_allclose(np.median(ratio), share, rtol=5e-3)
    assert np.ptp(ratio) < 0.05


def test_a_ray_is_stopped_by_what_lets_nothing_through_and_not_by_holes():
    board = sheet("board", 2.0, diffuse((0.5, 0.5, 0.5)), size=0.3)
    floor, where = 1, ("board", "floor", "holes", "lamp")
    seen = told(sheet("holes", 1.0, veil(diffuse((0.2, 0.2, 0.2)), 0.4)), board)
    blocked = seen["blocker_distance"] > 0
    assert (seen["blocker_id"][blocked] == where.index("board")).all()
    assert blocked.sum() > 20
    assert not seen["visibility"][blocked & (seen["id"] == floor)].any()
    light = seen["light"][blocked].astype(float)
    up = seen["blocker_distance"][blocked] * light[:, 1] / np.linalg.norm(light, axis=-1)
    height = seen["position"][blocked][:, 1] + up
    np.testing.assert_allclose(height[seen["id"][blocked] == floor], 2, atol=1e-3)


def test_scenes_of_opaque_things_ask_for_no_passage():
    assert Renderer(under(), 4, 4).stage.clear is None
    stage = Renderer(under(*MIXED), 4, 4).stage
    assert stage.clear is not None
    assert stage.clear.numpy().sum() == 3  # not the normal map's, which does not say how much


def test_light_through_holes_is_as_quiet_as_light_beside_them():
    """A small lamp, which the direction that a surface's sample takes hardly ever meets."""
    scene = under(sheet("holes", 1.5, veil(diffuse((0.0, 0.0, 0.0)), 0.4)), lamp=0.02)
    plain = under(lamp=0.02)

    def spread(scene: Scene) -> float:
        renderer = Renderer(scene, HEIGHT, WIDTH, direct="resampled")
        images = np.stack([renderer.frame(0, k, ("color",))["color"] for k in range(16)])
        return float((images.std(0) / images.mean(0).clip(1e-6)).mean())

    assert spread(scene) < 1.5 * spread(plain) + 0.05
