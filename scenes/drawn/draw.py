"""A scene drawn for a data set: a pure function of what is asked for.

Kinds (place, light, camera) are dealt out by number, so that few scenes have many of them: the k-th
of n kinds is where frac(start + number * step) falls, with a step of its own for each kind of
kinds, irrational, and a start that follows from the seed (an additive recurrence, as the sequences
of Weyl 1916). All else comes from a random generator of (seed, number, attempt).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from onespp.scenes.description import Mesh, Scene
from onespp.scenes.generated import exposure, lights
from onespp.scenes.generated.plan import Plan
from onespp.scenes.materials import diffuse

from .cameras import camera_of
from .choices import Choices, HeldOut
from .palette import palette
from .places import PLACE_OF, stage_of
from .things import things

T = TypeVar("T")
_GOLDEN = (math.sqrt(5) - 1) / 2
DRAWING = 3
"""Counts the changes of what is drawn for the same request."""
_DEALT = {kind: (step, salt + 1) for salt, (kind, step) in enumerate((
    ("family", math.sqrt(2)), ("light", math.sqrt(3)), ("camera", math.sqrt(7)),
    ("file", math.sqrt(11))))}
_SHADE = diffuse((0.55, 0.55, 0.55))
"""Of lamps, whose backs are seen here: black ones, as `generated/` has, are holes in a picture."""


@dataclass(frozen=True)
class Request:
    """What scene to draw.

    Attributes:
        name: of the scene; `number` is added. seed, number, attempt: what it follows from; another
            attempt is another scene of the same kinds. frames; height, width: pixels.
        choices: what to draw from. held_out: see `things.things`.
    """

    name: str
    seed: int
    number: int
    frames: int
    height: int
    width: int
    choices: Choices
    held_out: HeldOut | None = None
    attempt: int = 0


@dataclass(frozen=True)
class Drawn:
    """A scene, the names of its things, and what was drawn, as JSON can hold it."""

    scene: Scene
    things: tuple[str, ...]
    record: dict[str, Any]


def spread(number: int, step: float = _GOLDEN, start: float = 0.5) -> float:
    """A number in [0, 1), evenly spread over numbers that follow each other.

    Example:
        >>> [round(spread(n), 2) for n in range(4)]
        [0.5, 0.12, 0.74, 0.35]
    """
    return (start + number * step) % 1


def _no_mesh(name: str) -> Mesh:
    raise LookupError(name)


def draw(request: Request, mesh_of: Callable[[str], Mesh] = _no_mesh) -> Drawn:
    """The scene; of a place, no file (`family_of`). mesh_of: reads a name of `choices.meshes`."""
    r, choices = request, request.choices
    family = family_of(r)
    light = dealt(choices.lights_of(family), r, "light")
    move = dealt(choices.cameras, r, "camera")
    key = (r.seed, r.number, r.attempt)
    random = np.random.default_rng((*key, 5))
    ground, wall, *colors = palette(random)
    speed, stops = (float(random.uniform(*bounds)) for bounds in (choices.speed, choices.exposure))
    draft = Plan(r.number, PLACE_OF[family], light, move, ground, wall, tuple(colors), key,
                 r.frames)
    stage = stage_of(draft, family)
    found, free = things(draft, choices, r.held_out, speed, mesh_of)
    rig = exposure.exposed(lights.rig(draft, stage, free), stage, r.frames, stops)
    scene = Scene(
        name=f"{r.name}/{r.number}",
        about=f"{family}, light: {light}, camera: {move}, {len(rig.lamps)} lamps, {len(found)} "
              "things",
        shapes=(*stage.shapes, *(thing.shape for thing in found),
                *(replace(lamp.shape(), material=_SHADE) for lamp in rig.lamps)),
        camera=camera_of(draft, stage, family, move, speed), frames=r.frames, width=r.width,
        height=r.height, max_depth=7, environment=rig.sky)
    record = {
        "seed": r.seed, "attempt": r.attempt, "family": family, "light": light, "camera": move,
        "speed": round(speed, 6), "exposure": round(stops, 6), "colors": _rounded(
            (ground, wall, *colors)), "fov": round(scene.camera.fov, 6),
        "things": [{"name": thing.shape.name, "object": thing.object, "material": thing.material,
                    "motion": thing.motion} for thing in found],
        "lamps": [{"name": lamp.name, "kind": type(lamp.geometry).__name__.lower(),
                   "power": float(f"{lamp.power:.6g}"), "area": float(f"{lamp.area:.6g}")}
                  for lamp in rig.lamps],
        "sky": "none" if rig.sky is None else "even" if isinstance(rig.sky, tuple) else "image"}
    return Drawn(scene, tuple(thing.shape.name for thing in found), record)


def family_of(request: Request) -> str:
    """The family of the scene's place; `FILES`: it is a file's."""
    return dealt(request.choices.families, request, "family")


def dealt(kinds: Sequence[T], request: Request, what: str) -> T:
    """One of some kinds, by the request's number; `what`: "family", "light", "camera", "file"."""
    step, salt = _DEALT[what]
    start = float(np.random.default_rng((request.seed, salt)).random())
    return kinds[int(spread(request.number, step, start) * len(kinds))]


def _rounded(colors: Sequence[Sequence[float]]) -> list[list[float]]:
    return [[round(float(part), 4) for part in color] for color in colors]
