"""Light by way of smooth balls: the mean of Mitsuba's `path`, without its fireflies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

from onespp.render.channels import CAUSTIC
from onespp.render.errors import InputError
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer import view
from onespp.render.tracer.lights.balls.ways import Ways, solved, through
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Camera, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse, glass, metal, mirror, pane, varnish
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.path_images import assert_mean_of_path, assert_same_light, light_of_frames
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance

X = (1, 0, 0)
HEIGHT, WIDTH = 16, 24
ONE_SIDED = {"type": "conductor", "specular_reflectance": {"type": "rgb", "value": [0.9, 0.6, 0.5]}}


def ball(name: str, material: dict, x: float, y: float, z: float, radius: float) -> Shape:
    return Shape(name, Sphere(), material, translate((x, y, z)) @ scale(radius))


def scene(*balls: Shape, depth: int = 5, floor: dict | None = None, size: float = 0.4,
          environment=None) -> Scene:
    lamp = Shape("lamp", Rectangle(), diffuse((0.0, 0.0, 0.0)),
                 translate((0.4, 1.8, 0.2)) @ rotate(X, 90) @ scale(size),
                 (4 / size**2, 3 / size**2, 2 / size**2))
    ground = Shape("floor", Rectangle(), floor or diffuse((0.7, 0.5, 0.6)),
                   rotate(X, -90) @ scale(3))
    return Scene("balls", "for a test", (ground, lamp, *balls),
                 Camera(look_at((0, 1.2, 3.5), (0, 0.3, 0)), fov=50), 2, WIDTH, HEIGHT,
                 max_depth=depth, environment=environment)


GLASS = ball("glass", glass(), 0.2, 0.55, 0, 0.5)
ALL = (GLASS, ball("inside", diffuse((0.8, 0.2, 0.2)), 0.3, 0.5, 0.1, 0.1),
       Shape("moving", Sphere(), glass(1.3),
             lambda f: translate((-0.8, 0.4 + 0.2 * f, 0.4)) @ scale(0.3)),
       ball("metal", mirror(), 1.2, 0.4, 0.2, 0.35), ball("tinted", ONE_SIDED, -0.4, 0.2, 1, 0.2))
MANY = tuple(ball(f"glass{i}", glass(), 0.5 * (i % 6) - 1.2, 0.35, 0.6 * (i // 6) - 0.6, 0.24)
             for i in range(18))  # two more than count


@pytest.mark.parametrize("depth", [3, 4, 7])
def test_paths_have_the_mean_of_mitsubas_path(depth):
    renderer = Renderer(scene(*ALL, depth=depth, environment=0.2), HEIGHT, WIDTH)
    assert_mean_of_path(renderer, 1)


@pytest.mark.parametrize(("floor", "some"), [
    (diffuse((0.7, 0.5, 0.6)), ALL[:4]), (varnish((0.6, 0.3, 0.1), 0.3), ALL[:4]),
    (diffuse((0.7, 0.5, 0.6)), MANY)])
def test_every_channel_has_the_mean_that_it_has_without(floor, some, monkeypatch):
    def rendered(seed: int) -> list[Mapping[str, np.ndarray]]:
        renderer = Renderer(scene(*some, floor=floor, size=1.5), HEIGHT, WIDTH, direct="resampled")
        return light_of_frames(renderer, seed, 120)

    ours = rendered(0)
    monkeypatch.setattr(view, "find_balls", lambda stage: None)
    assert_same_light(ours, rendered(1000))


def test_what_later_vertices_leave_to_chance_is_whole():
    """A lamp behind a ball lights a white room: later vertices of a frame's path look for nothing,
    those of a reference's do."""
    around = Shape("around", Sphere(flipped=True), diffuse((0.8, 0.8, 0.8)), scale(4))
    renderer = Renderer(scene(ball("glass", glass(), 0.4, 1.25, 0.2, 0.5), around, size=0.3,
                              floor=diffuse((0.8, 0.8, 0.8)), depth=8), HEIGHT, WIDTH)
    frames = [renderer.frame(0, k, ("color",))["color"].mean((0, 1)) for k in range(200)]
    truth = [renderer.sample_sum(0, 1, k, 64).mean((0, 1)) / 64 for k in range(12)]
    assert_same_mean(*mean_and_variance(frames), *mean_and_variance(truth))


@pytest.mark.parametrize(("material", "depth"), [(glass(), 4), (mirror(), 3)])
def test_a_small_lamp_makes_no_fireflies(material, depth):
    renderer = Renderer(scene(ball("ball", material, 0.2, 0.9, 0, 0.3), size=0.02, depth=depth),
                        HEIGHT, WIDTH)
    frames = np.stack([renderer.frame(0, k, ("caustic",))["caustic"] for k in range(32)])
    mean, spread = frames.mean(0), frames.std(0)
    lit = mean[..., 0] > 0.1 * mean[..., 0].max()
    assert lit.sum() > 3
    assert (spread[lit] < 0.6 * mean[lit]).mean() > 0.7


@pytest.mark.parametrize(("balls", "size", "most"), [
    ((ball("ball", glass(), 0.2, 0.46, 0, 0.45),), 0.4, 0.06),       # 0.42 by points alone
    ((ball("ball", glass(), 0.2, 0.75, 0, 0.45),), 1.0, 0.006),      # 2.4
    ((ball("ball", mirror(), 0.2, 0.46, 0, 0.45),), 0.4, 0.012),     # 0.05 by directions alone
    ((ball("a", glass(), -0.35, 0.6, 0, 0.4), ball("b", glass(), 0.75, 0.6, 0, 0.4)), 0.4,
     0.04)])                                                         # 0.17 if one is left to chance
def test_what_balls_send_has_little_noise(balls, size, most):
    """Variance over the squared mean, where light runs together and all around."""
    renderer = Renderer(scene(*balls, size=size), HEIGHT, WIDTH)
    mean, variance = mean_and_variance(
        [renderer.frame(0, k, ("caustic",))["caustic"].mean(-1) for k in range(64)])
    assert variance.sum() * 64 < most * (mean**2).sum()


def test_caustics_are_what_balls_send_to_the_first_hit():
    """With paths of three segments all indirect light of a floor is reflected by what is on it."""
    renderer = Renderer(scene(GLASS, ALL[3], depth=3), HEIGHT, WIDTH)
    assert renderer.balls is not None
    assert len(renderer.balls.is_glass) == 2
    frames = [renderer.frame(0, k, ("caustic", "indirect", "id")).images for k in range(20)]
    for f in frames:
        floor = f["id"] == renderer.scene.object_names.index("floor")
        np.testing.assert_allclose(f["caustic"][floor], f["indirect"][floor], atol=1e-6)
    assert np.mean([f["caustic"] for f in frames]) > 1e-4
    deeper = Renderer(scene(GLASS, ALL[3]), HEIGHT, WIDTH)
    for k in range(20):
        f = deeper.frame(0, k, ("caustic", "indirect")).images
        assert (f["caustic"] <= f["indirect"] * 1.001 + 1e-6).all()
        assert (f["caustic"] < f["indirect"]).any()


def test_ways_are_all_that_there_are_and_lead_to_the_light():
    """Of random points around a ball at 0, against roots from a fine scan, in float64."""
    rng = np.random.default_rng(5)
    n, index, found = 300, 1.5, 0
    d1, d2 = 1.01 + 3 * rng.random(n)**2, 1.2 + 4 * rng.random(n)
    aside = np.pi * rng.random(n)**2
    ways = Ways(mi.Float(1 / d1), mi.Float(1 / d2))
    found_ways = solved(ways, mi.Float(aside), mi.Float(index), mi.Bool(True))
    t, is_way = np.array(found_ways[0]), np.array(found_ways[3])
    grid = np.linspace(0, np.pi / 2, 20001)
    for i in range(n):
        outer = np.arcsin(np.sin(grid) / d1[i]) + np.arcsin(np.sin(grid) / d2[i])
        g = 2 * grid - 2 * np.arcsin(np.sin(grid) / index) - outer
        for kinds, around, ends in (((0,), g, aside[i]), ((1, 2), g, -aside[i]),
                                    ((3,), 2 * grid - outer, np.pi - aside[i])):
            scanned = grid[:-1][np.diff(np.sign(around - ends)) != 0]
            ours = np.sort([t[k, i] for k in kinds if is_way[k, i]])
            assert len(ours) == len(scanned)
            np.testing.assert_allclose(ours, scanned, atol=1e-3)
            found += len(ours)
    assert found > 300


def test_only_smooth_spheres_that_are_denser_than_around_send_light():
    others = (Shape("inward", Sphere(flipped=True), glass(), translate((0, 0.5, 0)) @ scale(0.4)),
              ball("bubble", {"type": "dielectric", "int_ior": 1.0, "ext_ior": 1.4}, 1, 1, 0, 0.3),
              ball("rough", metal((0.9, 0.6, 0.5), 0.2), -1, 0.5, 0, 0.3),
              ball("sheet", pane(), -1, 1, 0, 0.2))
    assert Renderer(scene(*others[:3]), 4, 4).balls is None
    assert Renderer(scene(), 4, 4).balls is None
    assert Renderer(scene(GLASS, others[3]), 4, 4).balls is None
    assert CAUSTIC[0] not in Renderer(scene(*others[:3]), 4, 4).channels
    assert CAUSTIC[0] in Renderer(scene(GLASS), 4, 4).channels


def test_a_scene_without_balls_has_no_caustics():
    with pytest.raises(InputError, match="caustic needs a scene with smooth balls"):
        Renderer(scene(), 4, 4).frame(0, 0, ("color", "caustic"))


def _traced(alpha: np.ndarray, d1: float, d2: float, index: float) -> tuple[np.ndarray, np.ndarray]:
    """Where rays from (-d1, 0) at angles to the axis, through a unit disk, meet the circle of
    radius d2: the angle on it, and the cosine to its normal; by Snell's law, in vectors."""
    o, d = np.array([-d1 + 0 * alpha, 0 * alpha]), np.array([np.cos(alpha), np.sin(alpha)])

    def met(o, d, radius, far):
        b = (o * d).sum(0)
        root = np.sqrt(b**2 - (o * o).sum(0) + radius**2)
        return o + d * (-b + (root if far else -root))

    p = met(o, d, 1, far=False)
    d = _refracted(d, p, 1 / index)
    p = met(p, d, 1, far=True)
    d = _refracted(d, -p, index)
    p = met(p, d, d2, far=True)
    return np.unwrap(np.arctan2(p[1], -p[0])), (p * d).sum(0) / d2


@pytest.mark.parametrize(("d1", "d2"), [(1.05, 1.3), (3.0, 1.1), (2.0, 6.0)])
def test_beams_are_spread_as_traced_rays_are(d1, d2):
    index, t = 1.5, np.array([0.1, 0.4, 0.8, 1.2, 1.45])
    alpha = np.arcsin(np.sin(t) / d1)
    (phi, cosine), (more, _), (less, _) = (_traced(alpha + e, d1, d2, index)
                                           for e in (0, 1e-6, -1e-6))
    slope = np.abs(more - less) / 2e-6
    expected = np.sin(alpha) / (np.abs(np.sin(phi)) * slope * cosine)
    ways = Ways(mi.Float(1 / d1), mi.Float(1 / d2))
    ours = ways.spread(mi.Float(np.sin(t)), *ways.turned(mi.Float(t), mi.Float(1 / index)))
    np.testing.assert_allclose(np.array(ours), expected, rtol=2e-3)


@pytest.mark.parametrize("count", [1, 3, 16])
def test_balls_are_drawn_as_often_as_they_count(count):
    """Nearer ones more often; toward glass alone where there is both."""
    row = tuple(ball(f"ball{i}", mirror() if i == 1 else glass(), 0.7 * i, 0.3, 0, 0.25)
                for i in range(count))
    renderer = Renderer(scene(*row), 4, 4)
    balls, x = renderer.balls, _staged(renderer, (0.1, 1, 0.2))
    assert balls is not None
    to_points, to_glass = balls.draws(x, mi.Bool(True))
    assert to_glass is not None
    n = 4000
    for draws in (to_points, to_glass):
        balls_drawn = np.array(draws.drawn((mi.Float(dr.arange(mi.UInt32, n)) + 0.5) / n))
        drawn = np.bincount(np.broadcast_to(balls_drawn, n), minlength=count) / n
        often = [np.array(draws.density(mi.UInt32(i)))[0] for i in range(count)]
        np.testing.assert_allclose(drawn * np.array(draws.number)[0], often, atol=0.01)
    if count == 3:
        np.testing.assert_allclose(drawn[1], 0, atol=0)
        assert drawn[0] > 2 * drawn[2] > 0
    assert balls.draws(x, None)[1] is None


def test_directions_go_through_balls_as_snell_says():
    """Of random rays that meet a unit ball at 0, against vectors in float64."""
    rng = np.random.default_rng(6)
    n, index = 200, 1.5
    x = rng.normal(size=(3, n))
    x *= (1.2 + 3 * rng.random(n)) / np.linalg.norm(x, axis=0)
    target = rng.normal(size=(3, n))
    target *= 0.9 * rng.random(n) / np.linalg.norm(target, axis=0)
    d = (target - x) / np.linalg.norm(target - x, axis=0)
    b = (x * d).sum(0)
    p = x + d * (-b - np.sqrt(b**2 - (x * x).sum(0) + 1))
    within = _refracted(d, p, 1 / index)
    last = p - 2 * (p * within).sum(0) * within
    out = _refracted(within, -last, index)
    sine = np.sqrt(1 - (p * d).sum(0)**2)
    normal, toward = through(mi.Vector3f(d), mi.Vector3f(-x), mi.Float(sine), mi.Float(index))
    np.testing.assert_allclose(np.array(normal), last, atol=2e-5)
    np.testing.assert_allclose(np.array(toward), out, atol=2e-5)


def _staged(renderer: Renderer, point: tuple[float, ...]) -> mi.Point3f:
    """A point of the world where the stage has it."""
    return mi.Point3f((np.array(point) - renderer.stage.origin) / renderer.stage.unit)


def _refracted(d: np.ndarray, n: np.ndarray, ratio: float) -> np.ndarray:
    """By Snell's law; n: the normal, against d."""
    c = -(d * n).sum(0)
    return ratio * d + (ratio * c - np.sqrt(1 - ratio**2 * (1 - c**2))) * n


@pytest.mark.parametrize("lamps", [1, 3, 9])
def test_what_may_shine_is_what_does(lamps):
    """Spheres around lights miss none that a ray meets, but many rays that meet none."""
    lights = tuple(Shape(f"lamp{i}", Rectangle() if i % 2 else Sphere(), diffuse((0.0, 0.0, 0.0)),
                         translate((0.8 * (i % 3) - 1, 1.5 + 0.5 * (i // 3), 0.3)) @ scale(0.2),
                         (1.0, 1.0, 1.0)) for i in range(lamps))
    whole = scene(GLASS)
    renderer = Renderer(replace(whole, shapes=(whole.shapes[0], GLASS, *lights)), 4, 4)
    balls, rng = renderer.balls, np.random.default_rng(7)
    assert balls is not None
    start = _staged(renderer, (0.1, 0.8, 0.8))
    d = rng.normal(size=(3, 50000))
    d = mi.Vector3f(d / np.linalg.norm(d, axis=0))
    pi = renderer.stage.mi_scene.ray_intersect_preliminary(mi.Ray3f(start, d))
    shines = np.array(pi.is_valid() & pi.shape.is_emitter())
    may = np.array(balls.may_shine(start, d))
    assert shines.sum() > 50
    assert may[shines].all()
    assert may.mean() < 0.5
    sky = Renderer(scene(GLASS, environment=0.2), 4, 4).balls
    assert sky is not None
    assert np.array(sky.may_shine(start, d)).all()


def test_a_ball_that_a_matrix_mirrors_does_not_count():
    """Mitsuba turns its normals inside out."""
    place = translate((0.2, 0.55, 0)) @ scale((-0.5, 0.5, 0.5))
    renderer = Renderer(scene(Shape("ball", Sphere(), glass(), lambda f: (
        place if f == 1 else translate((0.2, 0.55, 0)) @ scale(0.5))), size=0.3), HEIGHT, WIDTH)
    for frame, count in ((0, 1), (1, 0)):
        renderer.frame(frame, 0, ("caustic",))
        balls = renderer.balls
        assert balls is not None
        assert (np.array(balls.rows) > 0).sum() == count
        caustic = np.stack([renderer.frame(frame, k, ("caustic",))["caustic"] for k in range(20)])
        assert np.isfinite(caustic).all()
        assert (caustic.max() > 0) == (count == 1)


def _near_lamp() -> Scene:
    """A lamp at a ball, which it lights from the side; the floor sees it edge on."""
    lamp = Shape("lamp", Rectangle(), diffuse((0.0, 0.0, 0.0)),
                 translate((0.1, 1.35, 0)) @ rotate((0, 0, 1), -40) @ rotate(X, 90) @ scale(0.25),
                 (40.0, 40.0, 40.0))
    around = scene(GLASS, depth=4)
    return replace(around, shapes=(around.shapes[0], lamp, GLASS))


def _bright_spot() -> Scene:
    sky = np.full((16, 32, 3), 0.05, np.float32)
    sky[3:5, 8:11] = 30
    around = scene(GLASS, depth=4, environment=sky)
    return replace(around, shapes=(around.shapes[0], GLASS))


@pytest.mark.parametrize("lit", [_near_lamp, _bright_spot])
def test_caustics_of_what_is_near_and_what_is_far_have_the_mean_of_chance(lit, monkeypatch):
    def rendered(seed: int) -> list[np.ndarray]:
        renderer = Renderer(lit(), HEIGHT, WIDTH)
        return [renderer.sample_sum(0, seed, k, 512) / 512 for k in range(12)]

    ours = rendered(0)
    monkeypatch.setattr(view, "find_balls", lambda stage: None)
    # (Of the lower half: farther away chance finds too little to tell its variance.)
    a, b = ([blocks(image[HEIGHT // 2:], 8) for image in images] for images in (ours, rendered(1)))
    assert_same_mean(*mean_and_variance(a), *mean_and_variance(b))
