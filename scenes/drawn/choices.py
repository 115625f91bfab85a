"""What a drawn scene may be made of: names of kinds, and ranges of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

from onespp.scenes.description import SceneError

Family = Literal["room", "window", "ground", "corner", "hall", "columns", "files"]
Object = Literal["crate", "ball", "vase", "ring", "block", "goblet", "sheet", "stack", "egg",
                 "hoop", "drum", "cone", "bowl", "pawn", "mesh"]
Material = Literal["plain", "checks", "varnish", "wood", "metal", "weave", "grain", "polished",
                   "varnished wood", "mirror", "glass"]
Light = Literal["panels", "unequal", "close", "changing", "sun", "overcast", "night"]
Motion = Literal["still", "spin", "slide", "stop and go", "bounce", "spline"]
CameraMove = Literal["still", "orbit", "dolly", "handheld", "cut"]

FILES = "files"
"""The family of scenes that are read from the user's own files, with the light that is in them."""
PLACES: tuple[Family, ...] = tuple(family for family in get_args(Family) if family != FILES)
MESH = "mesh"
"""The kind of objects that are read from the user's own files, made as large as the others."""
OBJECTS: tuple[Object, ...] = tuple(kind for kind in get_args(Object) if kind != MESH)
LIGHTS_OF: dict[str, tuple[str, ...]] = {
    "room": ("panels", "unequal", "close", "changing"),
    "window": ("sun", "panels", "overcast", "changing"),
    "ground": ("sun", "overcast", "night", "changing"),
    **dict.fromkeys(("corner", "hall", "columns"),
                    ("sun", "unequal", "close", "overcast", "changing")),
}
"""Family -> the lights that suit it: panels hang under ceilings, suns shine from a sky."""
CLOSED = ("ball", "egg", "ring", "hoop", "vase")
"""Objects that may be of glass."""


@dataclass(frozen=True)
class Choices:
    """What to draw from.

    Attributes:
        families: of places. objects, materials, lights, motions, cameras: names of kinds; a name
            that is there twice is drawn twice as often.
        files: names of scene files (in a plan file: patterns), for the family "files".
        meshes: names of OBJ and PLY files, likewise, for the object "mesh".
        things: fewest and most of them. speed: of things and cameras, 1: as `generated/` scenes.
        exposure: stops, 0: neither dark nor blown (`generated/exposure.py`).
        sharp: mirrors and glass among small lamps too, whose light in them references find late.

    Raises:
        SceneError: a list without names, a range that is empty or out of bounds, a family that
            none of the lights suits, nothing but glass and mirrors to make things of, files
            without their family or meshes without their object, or the reverse.
    """

    families: tuple[Family, ...] = PLACES
    files: tuple[str, ...] = ()
    objects: tuple[Object, ...] = OBJECTS
    meshes: tuple[str, ...] = ()
    materials: tuple[Material, ...] = get_args(Material)
    lights: tuple[Light, ...] = get_args(Light)
    motions: tuple[Motion, ...] = get_args(Motion)
    cameras: tuple[CameraMove, ...] = get_args(CameraMove)
    things: tuple[int, int] = (8, 12)
    speed: tuple[float, float] = (0.5, 1.5)
    exposure: tuple[float, float] = (-0.7, 0.5)
    sharp: bool = False

    def __post_init__(self) -> None:
        for name in ("families", "objects", "materials", "lights", "motions", "cameras"):
            if not getattr(self, name):
                raise SceneError(f"{name} is an empty list: name one or more, or leave it out")
        for name, least, most in (("things", 1, 30), ("speed", 0, 10), ("exposure", -8, 8)):
            low, high = getattr(self, name)
            if not least <= low <= high <= most:
                raise SceneError(f"{name} is [{low}, {high}]: use two numbers from {least} to "
                                 f"{most}, the smaller one first")
        for family in self.families:
            if family != FILES and not self.lights_of(family):
                raise SceneError(f"none of the lights suits the family '{family}': add one of "
                                 f"{', '.join(LIGHTS_OF[family])}")
        require_plain_material(self.materials, "materials")
        _require_both(self.families, "families", FILES, self.files, "files", "room", "*.glb")
        _require_both(self.objects, "objects", MESH, self.meshes, "meshes", "crate", "*.obj")

    def lights_of(self, family: str) -> tuple[str, ...]:
        """The chosen lights that suit a family."""
        return tuple(light for light in self.lights if light in LIGHTS_OF[family])


@dataclass(frozen=True)
class HeldOut:
    """What stands in scenes of the test split alone.

    Attributes:
        families: of which the test split's places are, if there are any. objects, materials: each
            thing of the test split is of one of these objects, or of one of these materials.
        files: those that the test split shows, as places of the family "files". meshes: count as
            objects.
    """

    families: tuple[Family, ...] = ()
    files: tuple[str, ...] = ()
    objects: tuple[Object, ...] = ()
    meshes: tuple[str, ...] = ()
    materials: tuple[Material, ...] = ()

    def __post_init__(self) -> None:
        if self.materials:
            require_plain_material(self.materials, "materials")

    def left(self, choices: Choices) -> Choices:
        """The choices without these.

        Raises:
            SceneError: nothing is left.
        """
        kept = {name: tuple(kind for kind in getattr(choices, name)
                            if kind not in getattr(self, name))
                for name in ("families", "files", "objects", "meshes", "materials")}
        return replace(choices, **{**kept,
                                   "files": kept["files"] if FILES in kept["families"] else (),
                                   "meshes": kept["meshes"] if MESH in kept["objects"] else ()})

    def alone(self, choices: Choices) -> Choices:
        """The choices with these families and files in place of theirs, where there are any.

        Raises:
            SceneError: the family "files" without files.
        """
        families = self.families or choices.families
        if self.families and self.files and FILES not in families:
            families += tuple(family for family in choices.families if family == FILES)
        files = self.files or choices.files
        return replace(choices, families=families, files=files if FILES in families else ())


def _require_both(kinds: Sequence[str], title: str, kind: str, names: Sequence[str], what: str,
                  other: str, pattern: str) -> None:
    """SceneError where a kind is drawn from files of which there are none, or the reverse."""
    if kind in kinds and not names:
        raise SceneError(f"{title} has '{kind}', and there are none: name some, as {what} = "
                         f"[\"models/{pattern}\"], hold fewer of them out, or leave '{kind}' out")
    if names and kind not in kinds:
        raise SceneError(f"there are {what}, and {title} has no '{kind}': add it, as {title} = "
                         f"[\"{other}\", \"{kind}\"], or leave the {what} out")


def require_plain_material(materials: Sequence[str], name: str) -> None:
    """SceneError where there are only materials that not everything may be of."""
    if set(materials) <= {"glass", "mirror"}:
        raise SceneError(f"{name} has only {' and '.join(sorted(set(materials)))}, which not "
                         "everything may be of: add another one")
