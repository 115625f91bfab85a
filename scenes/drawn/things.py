"""Things that stand, turn, slide and fly about, each of a drawn object, material and motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from onespp.scenes.animation import Animation, compose
from onespp.scenes.description import Mesh, SceneError, Shape
from onespp.scenes.generated import motions, objects, surfaces
from onespp.scenes.generated.objects import Body, Free
from onespp.scenes.generated.plan import Plan
from onespp.scenes.meshes import lathe, place
from onespp.scenes.transforms import rotate, scale, translate

from .choices import CLOSED, MESH, Choices, HeldOut

_ACTIVE = ("spline", "bounce", "slide", "stop and go")
_PROFILES = {  # (radius, height) of 1, from below on the outside
    "drum": [(0, 0), (0.5, 0), (0.5, 0), (0.5, 1), (0.5, 1), (0, 1)],
    "cone": [(0, 0), (0.5, 0), (0.5, 0), (0, 1)],
    "bowl": [(0, 0), (0.22, 0), (0.22, 0.06), (0.22, 0.06), (0.4, 0.35), (0.5, 1.0), (0.46, 1.0),
             (0.36, 0.4), (0, 0.14)],
    "pawn": [(0, 0), (0.42, 0), (0.42, 0), (0.42, 0.12), (0.2, 0.3), (0.13, 0.6), (0.28, 0.66),
             (0.12, 0.7), (0.22, 0.78), (0.24, 0.88), (0.15, 0.97), (0, 1)],
}
_FLATTER = {"bowl": 0.5, "drum": 0.8}


@dataclass(frozen=True)
class Thing:
    """A thing, and what it was drawn to be; object: a kind, or the name of a mesh's file."""

    shape: Shape
    object: str
    material: str
    motion: str


def things(draft: Plan, choices: Choices, held_out: HeldOut | None, speed: float,
           mesh_of: Callable[[str], Mesh]) -> tuple[list[Thing], Free]:
    """The scene's things, and the ground that they take, motions included.

    Args:
        held_out: None, or kinds of objects and of materials of which each thing has one.
        mesh_of: reads a file of the object "mesh".

    Raises:
        SceneError: a mesh has no size.
    """
    random = draft.random("things")
    free, found = Free([]), []
    for i in range(int(random.integers(choices.things[0], choices.things[1] + 1))):
        kind, material = kinds_of_thing(random, choices, held_out,
                                        choices.sharp or draft.lamps_are_found)
        move = choices.motions[random.integers(len(choices.motions))]
        mesh = mesh_of(kind) if kind in _meshes(choices, held_out) else None
        thing = _thing(random, draft, i, kind, mesh, material, move, speed, free)
        if thing is not None:
            found.append(thing)
    return found, free


def kinds_of_thing(random: np.random.Generator, choices: Choices, held_out: HeldOut | None,
                   sharp: bool) -> tuple[str, str]:
    """An object, or the name of a mesh, and a material that it may be of; sharp: a mirror or
    glass too."""
    objects_, meshes, materials = choices.objects, choices.meshes, choices.materials
    if held_out is not None:
        by_object = bool(random.random() < 0.5)
        objects_held = held_out.objects + (MESH,) * bool(held_out.meshes)
        if objects_held and (by_object or not held_out.materials):
            objects_, meshes = objects_held, held_out.meshes or meshes
        elif held_out.materials:
            materials = held_out.materials
    kind = objects_[random.integers(len(objects_))]
    fit = [m for m in materials if (sharp or m not in ("mirror", "glass"))
           and (m != "glass" or kind in CLOSED)]
    material = fit[random.integers(len(fit))]
    return meshes[random.integers(len(meshes))] if kind == MESH else kind, material


def _meshes(choices: Choices, held_out: HeldOut | None) -> tuple[str, ...]:
    return choices.meshes + (held_out.meshes if held_out is not None else ())


def _thing(random: np.random.Generator, draft: Plan, i: int, kind: str, mesh: Mesh | None,
           material: str, move: str, speed: float, free: Free) -> Thing | None:
    """None where there is no room for it. mesh: of the file `kind`, None for a kind of ours."""
    size = random.uniform(0.7, 1.0) if move in _ACTIVE else random.uniform(0.8, 1.7)
    made = _body(random, kind, size) if mesh is None else _standing(random, mesh, size)
    surface = surfaces.surface(random, material, draft.colors[i % len(draft.colors)],
                               draft.lamps_are_found)
    far = motions.reach(random, move)
    motion = motions.motion(random, move, far)
    if motion is not None:
        motion = _faster(motion, speed)
    stand = rotate((0, 1, 0), random.uniform(0, 360)) @ made.stand
    if move == "spline" and motion is not None:
        where = compose(motion, scale(0.7) @ stand)
    else:
        spot = free.spot(random, made.radius + far)
        if spot is None:
            return None
        there = translate((spot[0], 0, spot[1]))
        where = there @ stand if motion is None else compose(there, motion, stand)
    name = f"{kind if mesh is None else MESH}_{i}"
    return Thing(Shape(name, made.geometry, surface, where), kind, material, move)


def _faster(motion: Animation, speed: float) -> Animation:
    return Animation(lambda frame: motion(speed * frame))


def _standing(random: np.random.Generator, mesh: Mesh, size: float) -> Body:
    """A mesh of any size, y up, as large as other things."""
    foot, around, tall = footing(mesh)
    width, height = random.uniform(0.4, 0.6) * size, random.uniform(0.6, 1.0) * size
    factor = width / around if tall * width <= height * around else height / tall
    stand = translate((0, 0.001, 0)) @ scale(factor) @ translate(-foot)
    return Body(mesh, stand, factor * around)


def footing(mesh: Mesh) -> tuple[np.ndarray, float, float]:
    """The point below the middle of a mesh's box, the radius about it, and the height.

    Raises:
        SceneError: it has no width to scale.
    """
    used = mesh.vertices[np.unique(mesh.faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    around = float(np.hypot(*(used - foot)[:, [0, 2]].T).max())
    if not around > 0 or not np.isfinite(1 / around):
        raise SceneError("it has no width: all its vertices are above one point")
    return foot, around, float(high[1] - low[1])


def _body(random: np.random.Generator, kind: str, size: float) -> Body:
    if kind not in _PROFILES:
        return objects.body(random, kind, size)
    width = random.uniform(0.35, 0.55) * size
    height = random.uniform(0.45, 0.95) * size * _FLATTER.get(kind, 1.0)
    mesh = place(lathe(np.array(_PROFILES[kind]) * (width, height)), translate((0, 0.001, 0)))
    return Body(mesh, np.eye(4), 0.52 * width)
