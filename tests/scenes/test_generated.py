"""Scenes drawn from a seed: the same every time, of every kind, with the camera in the open."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from onespp.scenes.catalog import GENERATED, load
from onespp.scenes.description import Disk, Mesh, Rectangle, Scene, SceneError, Shape, Sphere
from onespp.scenes.fingerprint import fingerprint
from onespp.scenes.generated import DEVELOP, FRAMES, KEPT, generated
from onespp.scenes.generated.exposure import ALBEDO, DISPLAYED, _factor, _points, _radiance, exposed
from onespp.scenes.generated.lights import CHANGES, Lamp, Rig
from onespp.scenes.generated.motions import KINDS as MOTIONS
from onespp.scenes.generated.motions import motion
from onespp.scenes.generated.objects import KINDS as THINGS
from onespp.scenes.generated.objects import body
from onespp.scenes.generated.plan import CAMERAS, LIGHTS, PLACES, plan
from onespp.scenes.generated.skies import COLUMNS, ROWS, irradiance
from onespp.scenes.generated.stages import Stage
from onespp.scenes.transforms import rotate, scale, translate

PINNED = 42554.91335669139
SURROUNDINGS = ("floor", "wall", "ceiling", "skirting", "picture", "stone", "columns", "roof")
LIGHT_KINDS = sorted({light for lights in LIGHTS.values() for light in lights})
scene_of = cache(load)
every_scene = pytest.mark.parametrize("name", GENERATED)


def points_of(shape: Shape, frame: float) -> np.ndarray:
    """Points of a shape in the world."""
    match shape.geometry:
        case Mesh():
            points = shape.geometry.vertices
        case Sphere():
            points = np.vstack([np.eye(3), -np.eye(3)])
        case _:
            points = np.array([(x, y, 0) for x in (-1, 1) for y in (-1, 1)])
    matrix = shape.world_from_object_at(frame)
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def things_of(scene: Scene) -> list[Shape]:
    return [s for s in scene.shapes if s.name.rpartition("_")[0] in THINGS]


def kinds_of_surfaces(scene: Scene) -> set[str]:
    found = set()
    for shape in scene.shapes:
        inner = shape.material.get("bsdf", shape.material)
        color = inner.get("reflectance", inner.get("diffuse_reflectance"))
        found.add(inner["type"])
        found.add(color["type"] if isinstance(color, dict) else "plain")
        if inner["type"] == "roughconductor":
            found.add("rough" if inner["alpha"] > 0.2 else "polished")
    return found


def test_the_same_number_is_the_same_scene_and_another_is_another():
    prints = {name: fingerprint(load(name), (0, 7)) for name in GENERATED[:13:4]}
    assert prints == {name: fingerprint(load(name), (0, 7)) for name in prints}
    assert len(set(prints.values())) == len(prints)


def test_edits_of_the_generator_are_noticed():
    """Kept scenes must not change by accident: who changes them means it, and measures again."""
    numbers = [[s.world_from_object_at(3), s.emission_at(3) or 0.0]
               for name in GENERATED for s in scene_of(name).shapes]
    total = sum(float(np.abs(np.asarray(part)).sum()) for row in numbers for part in row)
    assert total == pytest.approx(PINNED, rel=1e-9)


@pytest.mark.parametrize("half", [DEVELOP, KEPT], ids=["develop", "kept"])
def test_every_kind_occurs_in_each_half(half: range):
    plans = [plan(number) for number in half]
    for place in PLACES:
        those = [p for p in plans if p.place == place]
        assert sorted(p.light for p in those) == sorted(LIGHTS[place])
        assert sorted(p.camera for p in those) == sorted(CAMERAS)
    scenes = [scene_of(f"generated/{number}") for number in half]
    assert {s.name.rpartition("_")[0] for scene in scenes for s in things_of(scene)} == set(THINGS)
    assert {"diffuse", "roughplastic", "roughconductor", "conductor", "dielectric", "rough",
            "polished", "plain", "checkerboard", "bitmap"} <= set.union(
                *map(kinds_of_surfaces, scenes))
    lamps = [s for scene in scenes for s in scene.shapes if s.emission is not None]
    assert {type(s.geometry) for s in lamps} == {Sphere, Disk, Rectangle}
    assert {c for c in CHANGES if any(s.name.endswith(c) for s in lamps)} == set(CHANGES)
    skies = [scene.environment for scene in scenes]
    assert {type(sky) for sky in skies} == {tuple, np.ndarray, type(None)}


def test_the_halves_do_not_meet():
    assert not set(DEVELOP) & set(KEPT)
    assert [*DEVELOP, *KEPT] == list(range(len(GENERATED)))


@every_scene
def test_the_camera_is_outside_of_everything(name: str):
    scene = scene_of(name)
    for frame in range(0, FRAMES, 3):
        eye = scene.camera.world_from_camera_at(frame)[:3, 3]
        assert 0.5 < eye[1] < 2.9
        assert abs(eye[0]) < 3.8
        assert eye[2] < 6
        for shape in scene.shapes:
            if not shape.name.startswith(SURROUNDINGS):
                points = points_of(shape, frame)
                middle = points.mean(axis=0)
                radius = np.linalg.norm(points - middle, axis=1).max()
                assert np.linalg.norm(eye - middle) > radius + 0.3, shape.name


def _disk(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius of a disk that holds points, seen from above."""
    flat = points[:, (0, 2)]
    middle = flat.mean(axis=0)
    return middle, np.linalg.norm(flat - middle, axis=1).max()


@every_scene
def test_things_stand_apart_and_on_the_ground(name: str):
    """Bounding disks of what stands do not overlap, in any frame; nothing is below the ground."""
    things = things_of(scene_of(name))
    for frame in range(0, FRAMES, 4):
        points = {s.name: points_of(s, frame) for s in things}
        assert all(p[:, 1].min() > -1e-6 for p in points.values())
        low = {key: p for key, p in points.items() if p[:, 1].min() < 0.8}
        disks = {key: _disk(p) for key, p in low.items()}
        for a, p in low.items():
            for b, q in low.items():
                (one, r), (other, s) = disks[a], disks[b]
                if a < b and np.linalg.norm(one - other) < r + s + 0.02:
                    gap = np.linalg.norm((p[:, None] - q[None, ::3])[..., (0, 2)], axis=2).min()
                    assert gap > 0.02, (a, b, frame)


@every_scene
def test_what_is_a_function_moves(name: str):
    scene = scene_of(name)
    for shape in scene.shapes:
        if shape.moves:
            places = [shape.world_from_object_at(frame) for frame in range(FRAMES)]
            assert any(not np.allclose(places[0], place) for place in places), shape.name
    assert any(s.moves for s in things_of(scene))


@pytest.mark.parametrize("kind", MOTIONS)
def test_a_motion_stays_in_reach(kind: str):
    for seed in range(5):
        moved = motion(np.random.default_rng(seed), kind, 0.4)
        if moved is None:
            assert kind == "still"
            continue
        at = np.array([moved(frame)[:3, 3] for frame in np.arange(0, 60, 0.5)])
        away = np.linalg.norm(at[:, (0, 2)], axis=1).max()
        low, high = {"spline": (1.2, 2.6), "slide": (0.39, 0.41), "stop and go": (0.39, 0.41)}.get(
            kind, (0, 0))
        assert low <= away <= high
        assert at[:, 1].min() >= (1.2 if kind == "spline" else 0)


@pytest.mark.parametrize("kind", THINGS)
def test_a_body_stands_on_the_ground_within_its_footprint(kind: str):
    for seed in range(6):
        made = body(np.random.default_rng(seed), kind, 1.0)
        points = points_of(Shape("x", made.geometry, {"type": "diffuse"}, made.stand), 0)
        assert -1e-6 <= points[:, 1].min() < 0.01
        assert points[:, 1].max() < 1.3
        assert np.linalg.norm(points[:, (0, 2)], axis=1).max() <= made.radius + 1e-6


def test_a_lamp_straight_above_gives_what_the_inverse_square_law_says():
    """A sphere of power P, 2 m above the ground: E = P / (4 pi 2^2), radiance P / (pi A)."""
    lamp = Lamp("x", Sphere(), translate((0, 2, 0)) @ scale(0.1), 4 * math.pi * 0.01, 10.0,
                (1.0, 1.0, 1.0))
    stage = Stage((), 0.0, 0.0, np.empty((0, 2, 3)))
    points, _ = _points(stage)
    below = np.flatnonzero(np.linalg.norm(points, axis=1) < 1e-9)
    got = _radiance(Rig((lamp,)), stage, 1)[below]
    np.testing.assert_allclose(got, ALBEDO / math.pi * 10 / (16 * math.pi))
    np.testing.assert_allclose(np.asarray(lamp.shape().emission_at(0)),
                               10 / (math.pi * 4 * math.pi * 0.01))


def test_a_square_that_faces_away_gives_nothing():
    down = translate((0, 2, 0)) @ rotate((1, 0, 0), 90)
    stage = Stage((), 0.0, 0.0, np.empty((0, 2, 3)))
    for place, lit in ((down, True), (down @ rotate((1, 0, 0), 180), False)):
        lamp = Lamp("x", Rectangle(), place, 4.0, 1.0, (1.0, 1.0, 1.0))
        assert (_radiance(Rig((lamp,)), stage, 1) > 0).any() == lit


def test_a_sky_of_one_radiance_gives_pi_times_it_as_an_image_too():
    up = np.array([(0.0, 1.0, 0.0), (0.6, 0.0, 0.8)])
    whole = irradiance(np.full((ROWS, COLUMNS, 3), 2.0), up)
    np.testing.assert_allclose(whole, 2 * math.pi, rtol=2e-3)
    np.testing.assert_allclose(irradiance((2.0, 2.0, 2.0), up), 2 * math.pi)


def test_light_is_scaled_to_the_displayed_mean_whatever_it_was():
    lamps = tuple(Lamp(f"{x}", Sphere(), translate((x, 2, 0)) @ scale(0.1), 0.13, 1.0,
                       (1.0, 0.9, 0.8)) for x in (-1, 1))
    stage = Stage((), 0.0, 1.0, np.empty((0, 2, 3)))
    for power in (1e-3, 1.0, 1e3):
        rig = exposed(Rig(tuple(replace(lamp, power=power) for lamp in lamps),
                          (power, power, power)), stage, 4)
        shown = np.minimum(_radiance(rig, stage, 4), 1) ** (1 / 2.2)
        assert shown.mean() == pytest.approx(DISPLAYED, abs=1e-3)
        assert _factor(_radiance(rig, stage, 4)) == pytest.approx(1, rel=1e-3)


def test_names_outside_of_the_table_are_refused_in_one_sentence():
    with pytest.raises(SceneError, match="generated/0 to 23"):
        load("generated/24")
    assert generated(24).name == "generated/24"
    with pytest.raises(SceneError, match="use 0 or more"):
        generated(-1)


@pytest.mark.parametrize("number", [1, 11])
def test_mitsuba_draws_them(number: int):
    """A picture that is lit: an overcast one with a mirror and glass, one whose lamps change."""
    from onespp.render.tracer.renderer import Renderer

    scene = scene_of(f"generated/{number}")
    frame = Renderer(scene, 18, 27).frame(3)
    assert np.isfinite(frame["color"]).all()
    assert 0.02 < frame["color"].mean() < 2
    assert len(np.unique(frame["id"])) > 5
