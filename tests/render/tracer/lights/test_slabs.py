"""Light through boxes of glass: the mean of Mitsuba's `path`, with little noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from onespp.render.mitsuba.variant import mi
from onespp.render.tracer import view
from onespp.render.tracer.lights import panes
from onespp.render.tracer.lights.slabs import Between
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Camera, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse, glass, mirror, pane
from onespp.scenes.meshes import box
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.path_images import assert_mean_of_path
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance

X, Z = (1, 0, 0), (0, 0, 1)
WIDE = (6, 0.15, 6)
HEIGHT, WIDTH = 16, 24


def slab(name: str, height: float, angle: float = 0, size=(2.4, 0.15, 2.0), index: float = 1.5,
         material: dict | None = None) -> Shape:
    """A box of glass that lies between floor and lamp."""
    return Shape(name, box(size), material or glass(index),
                 translate((0.1, height, 0)) @ rotate(Z, angle))


def under(*things: Shape, lamp: float = 0.1, depth: int = 6, environment=None) -> Scene:
    """A floor, which a camera below all of them sees, and a lamp of that size above."""
    light = Shape("lamp", Rectangle(), diffuse((0.0, 0.0, 0.0)),
                  translate((0.3, 3, 0.2)) @ rotate(X, 90) @ scale(lamp),
                  (4 / lamp**2, 3 / lamp**2, 2 / lamp**2))
    floor = Shape("floor", Rectangle(), diffuse((0.7, 0.5, 0.6)), rotate(X, -90) @ scale(3))
    return Scene("glazed", "for a test", (floor, light, *things),
                 Camera(look_at((0, 0.7, 2.5), (0, 0, 0)), fov=50), 2, WIDTH, HEIGHT,
                 max_depth=depth, environment=environment)


def leave_to_chance(monkeypatch: pytest.MonkeyPatch) -> None:
    """All light by way of glass and mirrors."""
    monkeypatch.setattr(panes, "find_slabs", lambda stage: None)
    monkeypatch.setattr(view, "find_mirrors", lambda stage: None)


MOVING = Shape("moving", box((1, 0.3, 1)), glass(1.3),
               lambda f: translate((-0.5 + 0.6 * f, 1.6, 0)) @ rotate(Z, 20))
SPOT = np.full((16, 32, 3), 0.05, np.float32)
SPOT[2:4, 8:11] = 40


@pytest.mark.parametrize(("things", "environment"), [
    ((slab("flat", 1.5),), None), ((slab("tilted", 1.5, 25, index=1.8),), 0.2),
    ((slab("one", 1.2), slab("two", 1.7, index=1.5)), None),           # a stack of them
    ((slab("one", 1.2), slab("two", 1.9, 30, index=1.3)), None),       # left to chance
    ((slab("thick", 1.5, 10, (1, 0.9, 1.2)),), None),                  # many come out at a side
    ((MOVING, Shape("sheet", Rectangle(), pane(), translate((0, 1, 0)) @ rotate(X, 90))), None),
    ((slab("flat", 1.5, 15),), SPOT),
    ((Shape("wall", box((5, 3, 1.2)), glass(), translate((0, 1.5, -1.2))),), SPOT)])
def test_paths_have_the_mean_of_mitsubas_path(things, environment):
    renderer = Renderer(under(*things, lamp=1.2, environment=environment), HEIGHT, WIDTH)
    assert renderer.panes is not None
    assert renderer.panes.slabs is not None
    assert_mean_of_path(renderer, 1)


THICK = slab("thick", 0.75, 10, (1.2, 0.8, 1.2), 1.8)
LAMP = Shape("near", Rectangle(), diffuse((0.0, 0.0, 0.0)),
             translate((0.3, 1.5, 0)) @ rotate(X, 90) @ scale(0.6), (9.0, 6.0, 3.0))


BLOCKS = tuple(Shape(f"block{i}", box((0.4, 0.35, 0.4)), glass(3.0),
                     translate((0.5 * (i % 4) - 0.7, 0.6, 0.5 * (i // 4) - 0.5)))
               for i in range(12))


@pytest.mark.parametrize("things", [
    (*BLOCKS, LAMP),                                                    # dense, with many rims
    (THICK, LAMP),                                                      # by faces and by sides
    (slab("low", 0.4, 25, (1.2, 0.3, 1.2), 1.8), slab("high", 1.0, -20, (1.2, 0.4, 1.2)), LAMP),
    (slab("around", 1.5, 0, (2, 0.5, 2)), LAMP),                        # which is in the glass
    (Shape("wall", box((2, 1.6, 0.4)), glass(1.8), translate((0, 0.8, -0.8))), LAMP),  # mirrors it
    (Shape("wall", box((2, 1.6, 0.1)), glass(), translate((0, 0.8, -0.8)) @ rotate(X, 20)),
     Shape("sheet", Rectangle(), pane(1.8), translate((-0.9, 0.5, 0)) @ rotate((0, 1, 0), 70)),
     Shape("metal", Rectangle(), mirror(), translate((0.9, 0.5, 0)) @ rotate((0, 1, 0), -70)),
     slab("above", 1.0, 5), LAMP),
    (slab("thick", 0.75, 0, (2, 0.5, 2)), LAMP,                         # with a pane in it
     Shape("in it", Rectangle(), pane(), translate((0, 0.75, 0)) @ rotate(X, 90) @ scale(0.7))),
    (slab("close", 0.755, 0, (5, 1.49, 5)), LAMP)])                     # to floor and lamp
def test_what_goes_another_way_is_left_to_chance(things, monkeypatch):
    """Thick slabs below a large lamp, with references of which chance knows much."""
    def rendered(seed: int) -> list[np.ndarray]:
        renderer = Renderer(under(*things, lamp=0.5, depth=8), HEIGHT, WIDTH)
        return [blocks(renderer.sample_sum(0, seed, k, 1024) / 1024, 8) for k in range(16)]

    ours = rendered(0)
    leave_to_chance(monkeypatch)
    assert_same_mean(*mean_and_variance(ours), *mean_and_variance(rendered(1)))


def test_no_path_is_longer_than_it_may_be(monkeypatch):
    """By the far side of an upright slab there are four segments from the first hit on."""
    def rendered(seed: int) -> list[np.ndarray]:
        wall = Shape("wall", box((2, 1.6, 0.2)), glass(2.5), translate((0, 0.8, -0.8)))
        renderer = Renderer(under(wall, LAMP, lamp=0.5, depth=4), HEIGHT, WIDTH)
        return [blocks(renderer.sample_sum(0, seed, k, 1024) / 1024, 8) for k in range(16)]

    ours = rendered(0)
    leave_to_chance(monkeypatch)
    assert_same_mean(*mean_and_variance(ours), *mean_and_variance(rendered(1)))


def test_what_a_mirror_shows_of_many_lamps_is_whole():
    """Where there are panes, too: a reflection is a scattering event, so that no lamp in it counts
    as direct light, which of several lamps is weighed otherwise."""
    lamps = [Shape(f"lamp{i}", Rectangle(), diffuse((0.0, 0.0, 0.0)),
                   translate((0.6 * i - 1.2, 0.6, 0.9)) @ rotate((0, 1, 0), 180)
                   @ scale((0.3, 0.6, 1)), (9.0, 6.0, 3.0)) for i in range(5)]
    metal = Shape("metal", Rectangle(), mirror(), translate((0, 1, -0.4)) @ scale((3, 2, 1)))
    above = Camera(look_at((0, 2.5, 1), (0, 0, 0)), fov=50)

    things = under(slab("aside", 2, 0, (0.1, 0.01, 0.1)), metal, *lamps, lamp=0.01, depth=3)
    renderer = Renderer(replace(things, camera=above), HEIGHT, WIDTH, direct="resampled")
    frames = [renderer.frame(0, k, ("color",))["color"].mean((0, 1)) for k in range(800)]
    truth = [renderer.sample_sum(0, 1, k, 256).mean((0, 1)) / 256 for k in range(12)]
    assert_same_mean(*mean_and_variance(frames), *mean_and_variance(truth))


@pytest.mark.parametrize("linear", [scale(0.0), scale((1, 0, 1))])
def test_a_slab_may_have_no_volume_for_a_frame(linear):
    shape = Shape("gone", box((1, 0.3, 1)), glass(), lambda f: (
        translate((0, 1, 0)) @ (linear if f == 1 else scale(1))))
    renderer = Renderer(under(shape, lamp=0.5), HEIGHT, WIDTH)
    for frame in (0, 1, 0):
        assert np.isfinite(renderer.frame(frame, 0, ("color",))["color"]).all()


def test_what_later_vertices_leave_to_chance_is_whole():
    """In a white room with a wall of glass and one of metal: later vertices of a frame's path look
    into no mirror, those of a reference's do."""
    white = diffuse((0.8, 0.8, 0.8))
    renderer = Renderer(under(
        Shape("around", Sphere(flipped=True), white, scale(4)), slab("above", 2, size=WIDE),
        Shape("wall", box((3, 3, 0.1)), glass(2.5), translate((0, 1, -1))),
        Shape("metal", Rectangle(), mirror(), translate((0, 1, 2.9)) @ scale(1.5)), LAMP,
        lamp=0.6, depth=8), HEIGHT, WIDTH)
    frames = [renderer.frame(0, k, ("color",))["color"].mean((0, 1)) for k in range(300)]
    truth = [renderer.sample_sum(0, 1, k, 64).mean((0, 1)) / 64 for k in range(12)]
    assert_same_mean(*mean_and_variance(frames), *mean_and_variance(truth))


@pytest.mark.parametrize("environment", [None, SPOT])
def test_frames_have_the_mean_that_they_have_without(environment, monkeypatch):
    def rendered(seed: int) -> list[np.ndarray]:
        wall = Shape("wall", box((2, 1.6, 0.3)), glass(1.8), translate((0, 0.8, -0.8)))
        renderer = Renderer(under(slab("flat", 1.5, 12), wall, lamp=1.5, environment=environment),
                            HEIGHT, WIDTH, direct="resampled")
        return [blocks(renderer.frame(0, seed + k, ("color",))["color"], 8) for k in range(150)]

    ours = rendered(0)
    leave_to_chance(monkeypatch)
    assert_same_mean(*mean_and_variance(ours), *mean_and_variance(rendered(1000)))


@pytest.mark.parametrize("things", [
    (slab("flat", 1.5, size=WIDE),), (slab("one", 1.2, size=WIDE), slab("two", 1.8, size=WIDE))])
def test_a_small_lamp_behind_glass_makes_no_fireflies(things):
    """What it lets through is direct light; without it the deviation is 20 times the mean."""
    renderer = Renderer(under(*things, lamp=0.05), HEIGHT, WIDTH, direct="resampled")
    frames = np.stack([renderer.frame(0, k, ("direct", "visibility", "id")).images["direct"][..., 0]
                       for k in range(32)])
    middle = frames[:, 10:, 6:-6]
    assert middle.mean() > 0.05
    assert (middle.std(0) < 0.1 * middle.mean(0)).mean() > 0.95


@pytest.mark.parametrize("material", [glass(), pane(1.8), mirror()])
def test_a_small_lamp_that_glass_mirrors_makes_no_fireflies(material):
    """On a floor before an upright wall of glass; by chance the variance is 30 to 3000 times the
    squared mean."""
    shape = Rectangle() if material != glass() else box((2, 2, 0.1))
    wall = Shape("wall", shape, material, translate((0, 1.5, -1)) @ scale((1.5, 2, 1)))
    renderer = Renderer(under(wall, slab("aside", 2, size=(0.1, 0.01, 0.1)), lamp=0.05, depth=5),
                        HEIGHT, WIDTH)
    mean, variance = mean_and_variance([renderer.frame(0, k, ("indirect",))["indirect"][10:, 4:-4]
                                        for k in range(64)])
    assert mean.mean() > 0.002
    assert variance.sum() * 64 < 2 * (mean**2).sum()


def test_as_much_comes_through_as_fresnel_lets():
    """Of light that falls straight down, by one slab and by two, which bring the lamp nearer."""
    above = [np.mean([renderer.frame(0, k, ("visibility",))["visibility"][11:, 8:16]
                      for k in range(16)]) for renderer in (
        Renderer(under(*things, lamp=0.05), HEIGHT, WIDTH, direct="resampled")
        for things in ((slab("one", 1.5, size=WIDE),),
                       (slab("one", 1.2, size=WIDE), slab("two", 1.8, size=WIDE))))]
    nearer = 0.15 * (1 - 1 / 1.5)
    expected = [(1 - 0.04)**(2 * k) * (3 / (3 - k * nearer))**2 for k in (1, 2)]
    np.testing.assert_allclose(above, expected, rtol=0.015)


def test_ways_through_slabs_are_bent_as_snell_says():
    """Where a ray that leaves in the direction told comes to, in float64; and the density told is
    that of a beam."""
    rng = np.random.default_rng(4)
    n, index = 300, 1.5
    d = rng.normal(size=(3, n))
    d[1] = np.where(rng.random(n) < 0.1, 0.05, d[1])  # some of them grazing
    d /= np.linalg.norm(d, axis=0)
    distance = 1 + 4 * rng.random(n)
    depth = np.abs(d[1]) * distance
    glass_ = 0.8 * depth * rng.random(n)
    between = Between(mi.UInt32(1), mi.Bool(False), mi.Vector3f(0, 1, 0), mi.Float(glass_),
                      mi.Float(index))
    toward, ratio = between.bent(mi.Vector3f(d), mi.Float(distance), mi.Bool(False),
                                 mi.Normal3f(0, 1, 0))
    toward = np.array(toward, np.float64)

    def met(w: np.ndarray) -> np.ndarray:
        """(3, n) where a direction is after that depth."""
        sine = np.sqrt(w[0]**2 + w[2]**2)
        inner = sine / index / np.sqrt(1 - (sine / index)**2)
        across = (depth - glass_) * sine / np.abs(w[1]) + glass_ * inner
        return np.stack([across * w[0] / sine, depth * np.sign(w[1]), across * w[2] / sine])

    np.testing.assert_allclose(met(toward), d * distance, atol=2e-4)
    a = np.cross(toward.T, [0.3, 0.1, 0.9]).T
    a /= np.linalg.norm(a, axis=0)
    b, e = np.cross(toward.T, a.T).T, 1e-5

    def turned(axis: np.ndarray, step: float) -> np.ndarray:
        w = toward + step * axis
        return met(w / np.linalg.norm(w, axis=0))

    sides = [(turned(axis, e) - turned(axis, -e)) / (2 * e) for axis in (a, b)]
    area = np.linalg.norm(np.cross(sides[0].T, sides[1].T), axis=1)  # of the plane, per angle
    expected = area * np.abs(d[1]) / distance**2
    np.testing.assert_allclose(np.array(ratio), expected, rtol=2e-3)


def test_slabs_are_boxes_of_glass_alone():
    def found(*things: Shape) -> int:
        slabs = Renderer(under(*things), 4, 4).panes
        return 0 if slabs is None or slabs.slabs is None else slabs.slabs.count

    assert found(slab("one", 1), slab("two", 2)) == 2
    assert found(slab("thin", 1, material=pane())) == 0
    assert found(slab("metal", 1, material=mirror())) == 0
    assert found(slab("less dense", 1, index=0.8)) == 0
    assert found(slab("one", 1), Shape("ball", Sphere(), glass(), scale(0.3))) == 0
    assert found() == 0


def test_mirrors_are_metal_panes_and_both_sides_of_slabs():
    things = (slab("one", 1, 10), Shape("metal", Rectangle(), mirror(), scale(0.3)),
              Shape("sheet", Rectangle(), pane(), translate((1, 1, 0)) @ scale(0.3)))
    mirrors = Renderer(under(*things), 4, 4).mirrors
    assert mirrors is not None
    assert mirrors.count == 4
    first, second = (mirrors.plane(mi.UInt32(i), mi.Bool(True)) for i in (2, 3))
    np.testing.assert_allclose(np.array(first[0]), -np.array(second[0]), atol=1e-6)
    thickness, index = mirrors.slab(mi.UInt32(2), mi.Bool(True))
    np.testing.assert_allclose(np.array(first[1] + second[1]), np.array(thickness), rtol=1e-4)
    np.testing.assert_allclose(np.array(index), 1.5, rtol=1e-3)
    np.testing.assert_array_equal(
        np.array(mirrors.other_side(mi.UInt32([2, 3]), mi.Bool(True))), [3, 2])
    assert not np.any(np.array(mirrors.slab(mi.UInt32([0, 1]), mi.Bool(True))[0]))
