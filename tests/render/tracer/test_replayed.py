"""Replayed frames are those that are traced anew, to the bit, whatever moves or changes."""

from __future__ import annotations

import gc
from weakref import ref

import numpy as np
import pytest

from onespp.render.channels import REPLAY
from onespp.render.tracer.renderer import Renderer
from onespp.render.tracer.view import View
from onespp.scenes import catalog
from onespp.scenes.description import (
    Camera,
    Cylinder,
    Disk,
    Light,
    Mesh,
    Rectangle,
    Scene,
    Shape,
    Sphere,
)
from onespp.scenes.materials import diffuse
from onespp.scenes.transforms import look_at, rotate, scale, translate

HEIGHT, WIDTH = 12, 16
FRAMES = (0, 1, 3, 2, 1)
PICTURE = np.random.default_rng(2).random((5, 7, 3)) ** 4
SUNNY = np.full((64, 128, 3), 0.1)
SUNNY[20:22, 30:33] = 900
BITMAP = {"type": "bitmap", "bitmap": PICTURE, "raw": True}
WAVES = {"type": "bitmap", "bitmap": PICTURE[..., :1], "raw": True}
GRAY = {"type": "diffuse", "reflectance": (0.5, 0.6, 0.7)}
SURFACES = [
    GRAY, {"type": "diffuse", "reflectance": BITMAP},
    {"type": "diffuse", "reflectance": {"type": "checkerboard"}},
    {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "vertex_color"}},
    {"type": "roughconductor", "alpha": 0.2}, {"type": "roughplastic", "alpha": 0.1},
    {"type": "plastic"}, {"type": "principled", "roughness": WAVES, "metallic": 0.5},
    {"type": "twosided", "inner": {"type": "roughconductor", "alpha": WAVES}},
    {"type": "blendbsdf", "weight": WAVES, "a": GRAY, "b": {"type": "roughconductor"}},
    {"type": "normalmap", "normalmap": BITMAP, "inner": GRAY},
    {"type": "bumpmap", "inner": GRAY, "height": WAVES}]
CLEAR = [{"type": "mask", "opacity": WAVES, "inner": GRAY}, {"type": "thindielectric"}, GRAY]
SMOOTH = [{"type": "dielectric"}, {"type": "conductor"}, {"type": "roughdielectric"}, GRAY]


def quad(several: bool = False) -> Mesh:
    """several: faces of one uv, of which points are drawn by area where it is a lamp."""
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
    faces, uv = np.array([(0, 1, 2), (0, 2, 3)]), (corners[:, :2] + 1) / 2
    color = {"vertex_color": np.abs(corners)}
    if not several:
        return Mesh(corners, faces, uv=uv, attributes=color)
    behind = corners - np.array([0, 0, 1])
    return Mesh(np.concatenate([corners, behind]), np.concatenate([faces, faces + 4]),
                uv=np.concatenate([uv, uv]))


def place(number: int, size: float = 0.3):
    """Of a thing that moves, turns and grows, in rows of four."""
    x, y = number % 4 - 1.5, number // 4 - 1.0
    return lambda f: (translate((x + 0.05 * f, y, 0.02 * f)) @ rotate((1, 2, 3), 33 + 20 * f)
                      @ scale(size + 0.01 * f))


def scene(*shapes: Shape, lights: tuple[Light, ...] = (), environment=None) -> Scene:
    floor = Shape("floor", Rectangle(), diffuse((0.5, 0.4, 0.3)),
                  translate((0, -2, 0)) @ rotate((1, 0, 0), -90) @ scale(4))
    camera = Camera(lambda f: look_at((0.1 * f, 1, 5), (0, 0, 0)))
    return Scene("moving", "For a test", (floor, *shapes), camera, 5, WIDTH, HEIGHT, 4,
                 environment=environment, lights=lights)


def things(surfaces, geometry=None) -> list[Shape]:
    return [Shape(f"thing_{i}", geometry or quad(), surface, place(i))
            for i, surface in enumerate(surfaces)]


LAMP = Shape("lamp", Rectangle(), diffuse((0, 0, 0)),
             lambda f: translate((0.2 * f, 3, 0)) @ rotate((1, 0, 0), 90),
             lambda f: (3.0 + f, 2.0, 0.5 * f))


def lamps(*geometries, emission=(3.0, 2.0, 1.0)) -> list[Shape]:
    return [Shape(f"lamp_{i}", geometry, diffuse((0, 0, 0)), place(i, 0.2), emission)
            for i, geometry in enumerate(geometries)]


POINTS = (Light({"type": "point", "intensity": 3.0}, translate((0, 2, 0))),
          Light({"type": "spot", "intensity": 9.0}, translate((0, 2, 0)) @ rotate((1, 0, 0), 90)),
          Light({"type": "directional", "irradiance": {"type": "rgb", "value": (1.0, 2.0, 3.0)}},
                rotate((1, 0, 0), 130)))
SCENES = {
    "surfaces": scene(*things(SURFACES), LAMP),
    "masks and panes": scene(*things(CLEAR), LAMP),
    "glass and mirrors": scene(*things(SMOOTH, Sphere()), LAMP),
    "flat mirrors": scene(*things(SMOOTH, Rectangle()), LAMP),
    "lamps": scene(*lamps(Rectangle(), Disk(), Cylinder(), Sphere(), quad())),
    "lamps with pictures": scene(*lamps(Rectangle(), Disk(), Cylinder(), Sphere(), quad(True),
                                        emission=PICTURE)),
    "points": scene(*things([GRAY], Sphere()), lights=POINTS),
    "even sky": scene(*things([GRAY], Sphere()), environment=(0.2, 0.3, 0.4)),
    "sky with a sun": scene(*things([GRAY], Sphere()), environment=SUNNY),
    "foliage": catalog.load("hard/foliage"),
    "glass ball": catalog.load("hard/glass-ball"),
    "many lights": catalog.load("generated/0"),
}


def frames(renderer: Renderer, names: tuple[str, ...]) -> list:
    return [renderer.frame(index, 3, names) for index in FRAMES]


@pytest.mark.parametrize(("name", "sampler"), [
    *((name, "zsobol") for name in SCENES), ("lamps", "bluenoise"), ("lamps", "pcg")])
def test_they_are_the_same_to_the_bit(name, sampler, monkeypatch):
    gc.collect()  # scenes that come and go have others recorded anew
    renderer = Renderer(SCENES[name], HEIGHT, WIDTH, direct="resampled", sampler=sampler)
    names = (*renderer.channels, *REPLAY)
    replayed = frames(renderer, names)
    assert [r.recordings for r in renderer._recordings.values()] == [1, 1]
    monkeypatch.setattr(View, "replayed", lambda view, function, *rest: function(view, *rest))
    traced = frames(Renderer(SCENES[name], HEIGHT, WIDTH, direct="resampled", sampler=sampler),
                    names)
    for one, other in zip(replayed, traced):
        assert [c for c in names if one[c].tobytes() != other[c].tobytes()] == []


def test_a_mesh_that_shines_as_a_picture_and_moves_is_not_recorded():
    """Mitsuba builds another scene for it whenever it moves; a replay would trace rays through the
    one that is gone, which ends the process."""
    renderer = Renderer(scene(*lamps(quad(), emission=PICTURE)), HEIGHT, WIDTH)
    frames(renderer, renderer.channels)
    assert [r.recordings for r in renderer._recordings.values()] == [0]


def test_what_cannot_be_recorded_is_traced(monkeypatch):
    """As what Dr.Jit says of an array that is not among the arguments."""
    renderer = Renderer(SCENES["points"], HEIGHT, WIDTH)
    expected = frames(renderer, renderer.channels)
    monkeypatch.setattr(View, "tables", [])
    unable = Renderer(SCENES["points"], HEIGHT, WIDTH)
    for one, other in zip(frames(unable, unable.channels), expected):
        assert one["color"].tobytes() == other["color"].tobytes()
    assert [r.recordings for r in unable._recordings.values()] == [0]


def test_recordings_keep_no_renderer():
    renderer = Renderer(SCENES["points"], HEIGHT, WIDTH)
    frames(renderer, renderer.channels)
    kept = ref(renderer)
    del renderer
    gc.collect()
    assert kept() is None
