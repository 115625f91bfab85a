"""Replayed frames are those that are traced anew, to the bit, whatever moves or changes."""

from __future__ import annotations

import gc
from unittest.mock import Mock
from weakref import ref

import drjit as dr
import numpy as np
import pytest

from onespp.render.channels import REPLAY
from onespp.render.host import backend
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


def mirrored(f):
    """Of a thing that is mirrored in every second frame."""
    return translate((0.2 * f, 1.5, 1)) @ np.diag([(-0.4, 0.4)[int(f) % 2], 0.4, 0.4, 1.0])


def far_away(f):
    """Of a thing that makes the scene larger and smaller."""
    return translate((5.0 + 7 * (f % 3), 0.5, 0))


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
    "sky that is far": scene(Shape("ball", Sphere(), GRAY, far_away), environment=SUNNY),
    "points that are far": scene(Shape("ball", Sphere(), GRAY, far_away), lights=POINTS),
    "mirrored lamps": scene(
        Shape("ball", Sphere(), diffuse((0, 0, 0)), mirrored, (3.0, 2.0, 1.0)),
        Shape("rod", Cylinder(flipped=True), diffuse((0, 0, 0)), mirrored, (1.0, 2.0, 1.0))),
    "foliage": catalog.load("hard/foliage"),
    "glass ball": catalog.load("hard/glass-ball"),
    "many lights": catalog.load("generated/0"),
}


def frames(renderer: Renderer, names: tuple[str, ...]) -> list:
    return [renderer.frame(index, 3, names) for index in FRAMES]


recorded = pytest.mark.skipif(backend.choose() != "llvm",
                              reason="frames are recorded on LLVM alone")


@recorded
@pytest.mark.parametrize(("name", "sampler"), [
    *((name, "zsobol") for name in SCENES), ("lamps", "bluenoise"), ("lamps", "pcg")])
def test_they_are_the_same_to_the_bit(name, sampler, monkeypatch):
    gc.collect()  # scenes that come and go have others recorded anew
    renderer = Renderer(SCENES[name], HEIGHT, WIDTH, direct="resampled", sampler=sampler)
    names = (*renderer.channels, *REPLAY)
    replayed = frames(renderer, names)
    recordings = 2 if name == "mirrored lamps" else 1
    assert [r.recordings for r in renderer._recordings.values()] == [recordings] * 2
    monkeypatch.setattr(View, "replayed", lambda view, function, *rest: function(view, *rest))
    traced = frames(Renderer(SCENES[name], HEIGHT, WIDTH, direct="resampled", sampler=sampler),
                    names)
    for one, other in zip(replayed, traced):
        assert [c for c in names if one[c].tobytes() != other[c].tobytes()] == []


@recorded
def test_a_mesh_that_shines_as_a_picture_and_moves_is_not_recorded():
    """Mitsuba builds another scene for it whenever it moves; a replay would trace rays through the
    one that is gone, which ends the process."""
    renderer = Renderer(scene(*lamps(quad(), emission=PICTURE)), HEIGHT, WIDTH)
    frames(renderer, renderer.channels)
    assert not renderer.stage.recordable
    assert [r.recordings for r in renderer._recordings.values()] == [0]


@recorded
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
    """Not even until the cycle collector comes by."""
    renderer = Renderer(SCENES["points"], HEIGHT, WIDTH)
    frames(renderer, renderer.channels)
    kept = ref(renderer)
    gc.disable()
    try:
        del renderer
        assert kept() is None
    finally:
        gc.enable()


@pytest.mark.parametrize("name", ["sky that is far", "mirrored lamps"])
def test_frames_do_not_depend_on_those_before(name):
    """Mitsuba tells the sky how large the scene was before it moved, and turns the normals of what
    is mirrored at every update."""
    renderer = Renderer(SCENES[name], HEIGHT, WIDTH, direct="resampled")
    for index, frame in zip(FRAMES, frames(renderer, renderer.channels)):
        alone = Renderer(SCENES[name], HEIGHT, WIDTH, direct="resampled").frame(
            index, 3, renderer.channels)
        assert [c for c in renderer.channels if frame[c].tobytes() != alone[c].tobytes()] == []
        if name == "mirrored lamps":
            assert renderer.stage.turned == tuple(
                lamp.geometry.flipped != bool(np.linalg.det(lamp.world_from_object_at(
                    renderer.stage.frame)) < 0) for lamp in SCENES[name].shapes if lamp.emission)


def test_guides_alone_are_of_their_frame():
    """To find many lights moves the stage."""
    many = scene(*lamps(*[Rectangle()] * 6))
    alone, after = (Renderer(many, HEIGHT, WIDTH, direct="resampled") for _ in range(2))
    assert after.lights is not None
    one, other = (r.frame(1, 3, ("depth", "normal")) for r in (alone, after))
    assert alone.stage.frame == 1
    assert one["depth"].tobytes() == other["depth"].tobytes()


@recorded
@pytest.mark.parametrize("raised", [KeyboardInterrupt, TimeoutError, MemoryError])
def test_what_is_raised_while_a_frame_is_recorded_is_raised(raised, monkeypatch):
    renderer = Renderer(SCENES["points"], HEIGHT, WIDTH)
    expected = renderer.frame(0, 3)
    with monkeypatch.context() as patch:
        patch.setattr(renderer, "_trace_frame", Mock(side_effect=raised("stop")))
        with pytest.raises(raised, match="stop"):
            renderer.frame(0, 3)
    for _ in range(2):
        assert renderer.frame(0, 3)["color"].tobytes() == expected["color"].tobytes()
    assert [r.recordings for r in renderer._recordings.values()] != [0]


def test_a_move_that_is_interrupted_is_made_again(monkeypatch):
    renderer = Renderer(SCENES["surfaces"], HEIGHT, WIDTH)
    expected = renderer.frame(0, 3)
    with monkeypatch.context() as patch:
        patch.setattr(renderer.stage, "_set_normals", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            renderer.frame(2, 3)
    assert renderer.frame(0, 3)["color"].tobytes() == expected["color"].tobytes()


@recorded
def test_dr_jit_walks_arrays_alone():
    """It holds a lock while it walks what a recording is given: had it to run Python for that, as
    for a dataclass, it could wait for a thread that waits for the lock, with the interpreter's."""
    renderer = Renderer(SCENES["points"], HEIGHT, WIDTH)
    frames(renderer, renderer.channels)
    recording, = renderer._recordings.values()
    recording._frozen = Mock(wraps=recording._frozen)
    frames(renderer, renderer.channels)
    for given in recording._frozen.call_args_list:
        scene, arrays = given.args
        assert scene is renderer.stage.mi_scene
        assert type(arrays) is list
        assert all(dr.is_array_v(type(array)) for array in arrays)
