"""A scene is compiled once: whatever moves or changes, later frames run the first ones' kernels."""

from __future__ import annotations

from dataclasses import replace
from unittest.mock import Mock

import drjit as dr
import pytest

from onespp.render.channels import FRAME, GLOSS, REPLAY, SHADOW, SPLIT
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer import layers, path, replacement
from onespp.render.tracer.lights import candidates
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog
from onespp.scenes.description import Camera, Cylinder, Disk, Mesh, Rectangle, Scene, Shape, Sphere
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.furnace import CORNERS, INWARD

from .test_renderer import gray, small_scene

HEIGHT, WIDTH = 6, 8
KINDS = {"sphere": Sphere(), "rectangle": Rectangle(), "disk": Disk(), "cylinder": Cylinder(),
         "mesh": Mesh(CORNERS, INWARD[:, ::-1])}
EMISSIONS = {"dark": None, "lit": (3.0, 2.0, 1.0), "changing": lambda f: (3.0 + f, 2.0, 0.5 * f)}


def scene_with(geometry, emission, moves: bool) -> Scene:
    """A floor and a light that stand still, a thing, and a camera that moves if it does."""
    def place(f):
        return (translate((0.1 * f, 0.8, 0.2)) @ rotate((0, 1, 0), 7 * f + 3)
                @ scale(0.4 + 0.01 * f))

    def view(f):
        return look_at((0.1 * f, 2, 5), (0, 0.4, 0))

    thing = Shape("thing", geometry, gray(), place if moves else place(0), emission)
    rest = (shape for shape in small_scene().shapes if shape.name != "ball")
    return small_scene(shapes=(*rest, thing), camera=Camera(view if moves else view(0)))


def hashes(action) -> set:
    """Kernels that a call launched."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        action()
        dr.sync_thread()
        launched = {kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])}
    assert launched
    return launched


def new_kernels(frame) -> int:
    """How many kernels frames 3 and 5 launch that neither of two earlier frames did."""
    known = hashes(lambda: frame(1)) | hashes(lambda: frame(2))
    return len((hashes(lambda: frame(3)) | hashes(lambda: frame(5))) - known)


@pytest.mark.parametrize("direct", ["mis", "resampled"])
@pytest.mark.parametrize(("emission", "moves"),
                         [("dark", True), ("lit", True), ("changing", False)])
@pytest.mark.parametrize("kind", KINDS)
def test_what_moves_or_changes_its_light_is_not_compiled_anew(kind, emission, moves, direct):
    names = (*FRAME, *GLOSS, *REPLAY, *((*SPLIT, *SHADOW) if direct == "resampled" else ()))
    renderer = Renderer(scene_with(KINDS[kind], EMISSIONS[emission], moves), HEIGHT, WIDTH,
                        direct=direct, sampler="zsobol")
    assert new_kernels(lambda index: renderer.frame(index, 0, names)) == 0


@pytest.mark.parametrize("antialias", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_nor_is_its_reference(kind, antialias):
    renderer = Renderer(scene_with(KINDS[kind], EMISSIONS["changing"], True), HEIGHT, WIDTH)
    assert new_kernels(lambda index: renderer.sample_sum(index, 0, 0, 2, antialias)) == 0


def test_nor_is_the_room_when_its_ceiling_light_moves():
    room = catalog.load("room")
    panel = next(shape for shape in room.shapes
                 if shape.emission is not None and isinstance(shape.geometry, Rectangle))
    at_rest = panel.world_from_object_at(0)
    moving = replace(panel, world_from_object=lambda f: translate((0.05 * f, 0, 0)) @ at_rest)
    shapes = tuple(moving if shape is panel else shape for shape in room.shapes)
    renderer = Renderer(replace(room, shapes=shapes), HEIGHT, WIDTH, direct="resampled",
                        sampler="zsobol")
    assert new_kernels(lambda index: renderer.frame(index, 0, renderer.channels)) == 0


@pytest.mark.parametrize(("name", "paths", "steps"), [
    ("box", 1, [0, 0]), ("hard/mirror", 1, [1, 0]), ("hard/thin-glass", 2, [2, 1]),
    ("hard/foliage", 2, [2, 1]), ("hard/glass-ball", 2, [2, 5])])  # two turns at most, a loop each
def test_no_loop_is_recorded_twice(name, paths, steps, monkeypatch):
    """Dr.Jit records one again if some of its state stays as it is, and all loops in it."""
    counts = []
    for module, function in ((path, "sought_light"), (candidates, "offered"),
                             (replacement, "stepped"), (layers, "stepped")):
        counted = Mock(wraps=getattr(module, function))
        monkeypatch.setattr(module, function, counted)
        counts.append(counted)
    renderer = Renderer(catalog.load(name), HEIGHT, WIDTH, direct="resampled", sampler="zsobol")
    renderer.frame(0, 0, renderer.channels)
    assert [counted.call_count for counted in counts] == [paths, paths, *steps]


@pytest.mark.parametrize("name", ["box", "hard/mirror", "hard/glass-ball"])
def test_nor_is_that_of_a_reference(name, monkeypatch):
    counted = Mock(wraps=path.sought_light)
    monkeypatch.setattr(path, "sought_light", counted)
    Renderer(catalog.load(name), HEIGHT, WIDTH).sample_sum(0, 0, 0, 2, antialias=False)
    assert counted.call_count == 1


def test_nor_if_hits_have_constants_as_those_of_optix(monkeypatch):
    met = mi.Scene.ray_intersect_preliminary

    def with_constants(*arguments, **named):
        pi = met(*arguments, **named)
        pi.valid, pi.instance = mi.Bool(True), dr.zeros(mi.ShapePtr)
        return pi

    monkeypatch.setattr(mi.Scene, "ray_intersect_preliminary", with_constants)
    counted = Mock(wraps=path.sought_light)
    monkeypatch.setattr(path, "sought_light", counted)
    renderer = Renderer(catalog.load("box"), HEIGHT, WIDTH, direct="resampled", sampler="zsobol")
    renderer.frame(0, 0, renderer.channels)
    assert counted.call_count == 1
