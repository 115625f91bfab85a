"""Light by way of flat mirrors: the mean of Mitsuba's `path`, without its fireflies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from onespp.render.tracer import view
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Camera, Disk, Light, Mesh, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse, mirror, pane, varnish
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.path_images import assert_mean_of_path, assert_same_light, light_of_frames

X, Y = (1, 0, 0), (0, 1, 0)
HEIGHT, WIDTH = 16, 24
ONE_SIDED = {"type": "conductor", "specular_reflectance": {"type": "rgb", "value": [0.9, 0.6, 0.5]}}
QUAD = Mesh(np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], float),
            np.array([(0, 2, 1), (0, 3, 2)]))
SLANTED = translate((-1, 0.6, 0.3)) @ rotate(Y, 70) @ scale((0.7, 0.5, 1))


def lamp(size: float) -> Shape:
    return Shape("lamp", Rectangle(), diffuse((0.0, 0.0, 0.0)),
                 translate((0.4, 1.6, 0.2)) @ rotate(X, 90) @ scale(size),
                 (4 / size**2, 3 / size**2, 2 / size**2))


def scene(*mirrors: Shape, depth: int = 5, floor: dict | None = None, size: float = 0.5,
          environment=None, lights=()) -> Scene:
    return Scene("mirrors", "for a test", (
        Shape("floor", Rectangle(), floor or diffuse((0.7, 0.5, 0.6)),
              rotate(X, -90) @ scale(3)), lamp(size), *mirrors),
        Camera(look_at((0, 1.2, 3.5), (0, 0.3, 0)), fov=50), 2, WIDTH, HEIGHT, max_depth=depth,
        environment=environment, lights=lights)


ALL = (Shape("slanted", Rectangle(), mirror(), SLANTED),
       Shape("moving", Disk(), mirror(), lambda f: translate((1.2, 0.5 + 0.2 * f, 0))
             @ rotate(Y, -60) @ scale(0.6)),
       Shape("behind", Rectangle(), ONE_SIDED, translate((0, 0.8, -1)) @ rotate(Y, 180)),
       Shape("before", QUAD, ONE_SIDED, translate((0.3, 0.5, -0.8)) @ rotate(X, 95) @ scale(0.5)),
       Shape("bent", Sphere(), mirror(), translate((-0.3, 0.3, 0.6)) @ scale(0.3)))


@pytest.mark.parametrize("depth", [3, 6])
def test_paths_have_the_mean_of_mitsubas_path(depth):
    renderer = Renderer(scene(*ALL, depth=depth, environment=0.1), HEIGHT, WIDTH)
    assert_mean_of_path(renderer, 1)


@pytest.mark.parametrize("floor", [diffuse((0.7, 0.5, 0.6)), varnish((0.6, 0.3, 0.1), 0.3)])
def test_every_channel_has_the_mean_that_it_has_without(floor, monkeypatch):
    """`specular`, too, which has what a glossy lobe reflects of mirrors."""
    def rendered(seed: int) -> list[Mapping[str, np.ndarray]]:
        renderer = Renderer(scene(*ALL[:3], floor=floor, size=1.0), HEIGHT, WIDTH,
                            direct="resampled")
        return light_of_frames(renderer, seed, 150)

    ours = rendered(0)
    monkeypatch.setattr(view, "find_mirrors", lambda stage: None)
    assert_same_light(ours, rendered(1000))


def test_a_small_lamp_in_a_mirror_makes_no_fireflies():
    renderer = Renderer(scene(ALL[0], size=0.02, depth=3), HEIGHT, WIDTH)
    assert renderer.mirrors is not None
    frames = np.stack([renderer.frame(0, k, ("indirect",))["indirect"] for k in range(32)])
    mean, spread = frames.mean(0), frames.std(0)
    lit = mean[..., 0] > 0.2 * mean[..., 0].max()
    assert lit.sum() > 10
    assert (spread[lit] < 0.2 * mean[lit]).mean() > 0.7


def test_no_light_comes_by_a_mirror_from_behind_it():
    """The lamp is above a plate and looks up, the floor is below: the image of the floor in the
    plate's plane is farther up and sees the lamp."""
    flat = rotate(X, 90)
    shapes = (Shape("floor", Rectangle(), diffuse((0.7, 0.5, 0.6)), rotate(X, -90) @ scale(3)),
              Shape("plate", Rectangle(), mirror(), translate((0, 0.8, 0)) @ flat @ scale(9)),
              Shape("lamp", Rectangle(), diffuse((0.0, 0.0, 0.0)),
                    translate((0, 1.0, 0)) @ rotate(X, -90) @ scale(0.3), (9.0, 9.0, 9.0)))
    camera = Camera(look_at((0, 0.5, 2.5), (0, 0.2, 0)), fov=50)
    renderer = Renderer(Scene("plate", "for a test", shapes, camera, 1, WIDTH, HEIGHT,
                              max_depth=3), HEIGHT, WIDTH)
    for k in range(3):
        frame = renderer.frame(0, k)
        assert (frame["position"][..., 1] < 0.01).sum() > 20
        assert not frame["color"].any()


def test_points_that_shine_are_not_found_in_mirrors_as_little_as_by_path():
    point = Light({"type": "point", "intensity": 5.0}, translate((0.2, 1.2, 0.3)))
    only = scene(ALL[0], depth=3, lights=(point,))
    dark = [s for s in only.shapes if s.name != "lamp"]
    renderer = Renderer(Scene("point", "for a test", tuple(dark), only.camera, 1, WIDTH, HEIGHT,
                              max_depth=3, lights=(point,)), HEIGHT, WIDTH)
    frame = renderer.frame(0, 0)
    assert frame["direct"].any()
    seen = frame["id"] == 0
    assert not frame["indirect"][seen].any()


def test_only_flat_mirrors_without_maps_are_looked_into():
    heights = {"type": "bitmap", "raw": True, "bitmap": np.eye(4, dtype=np.float32)[..., None]}
    bump = {"type": "bumpmap", "arbitrary": heights, "bsdf": mirror()}
    others = (Shape("bumpy", Rectangle(), bump, SLANTED), ALL[4])
    assert Renderer(scene(*others), 4, 4).mirrors is None
    assert Renderer(scene(), 4, 4).mirrors is None
    bumpy_pane = {**bump, "bsdf": pane()}
    for things, count in ((ALL, 4), ((ALL[0], Shape("sheet", Rectangle(), pane())), 2),
                          ((ALL[0], Shape("bumpy", Rectangle(), bumpy_pane)), 1)):
        found = Renderer(scene(*things), 4, 4).mirrors
        assert found is not None
        assert found.count == count
