"""The channel table: every image that a frame can carry, written once.

A new signal is one row here and one function in `render/tracer/gbuffer.py` (or one more output of
the path tracer). Files, frames, imports, `--channels`, the report and the documentation all read
this table.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

from onespp.show.pictures import Display

from .errors import InputError


class Stored(Enum):
    """The type in the file. In memory all is float32, but for object IDs, which are int32."""

    FLOAT = "float, half with `--half`"
    EXACT = "float"
    HALF = "half"
    OBJECT_ID = "float "


FLOAT, EXACT, HALF, OBJECT_ID = Stored.FLOAT, Stored.EXACT, Stored.HALF, Stored.OBJECT_ID


class Group(Enum):
    """What channels come together, and when."""

    RADIANCE = "light by scattering events"
    GUIDES = "what is seen, without noise"
    PATH = "the path's first segment"
    SPLIT = "direct light as unshadowed light and the share of it that arrives"
    SHADOW = "the shadow ray at the first hit"
    GROUPED = "direct light by groups of lights, of scenes that have several"
    GLOSS = "reflections, of scenes that have glossy surfaces"
    CAUSTIC = "lamps by way of glass and mirrors, of scenes that have smooth balls"
    LAYER = "what else is seen, of scenes that have glass or masks"
    REPLAY = "samples of the last frame, shaded again"
    MOTION = "of imports alone, whose motion no matrices tell"
    TRUTH = "of references alone"


@dataclass(frozen=True)
class Channel:
    """One named image.

    Attributes:
        name: key in `Frame.images`.
        group: which channels it comes with (`channels_of`).
        exr: channel names in the file, in component order; their number is the number of
            components. One component is an (h, w) image, more are (h, w, c).
        stored: type in the file. HALF loses nothing that matters there; EXACT is what
            reprojection compares; OBJECT_ID is float32 there, which viewers expect.
        display: how pictures show it.
        background: value of a pixel whose ray hits nothing.
        about: meaning, space and unit.
    """

    name: str
    group: Group
    exr: tuple[str, ...]
    stored: Stored
    display: Display
    background: float
    about: str

    @property
    def components(self) -> int:
        return len(self.exr)

    @property
    def is_id(self) -> bool:
        """Whether its values are indices of objects, or of groups of lights; -1 for none."""
        return self.stored is OBJECT_ID

    def is_half(self, half: bool) -> bool:
        """Whether a file has it in half precision, in a sequence with (or without) `--half`."""
        return self.stored is HALF or (half and self.stored is FLOAT)


def _rgb(layer: str) -> tuple[str, ...]:
    return tuple(f"{layer}.{c}" for c in "RGB")


MOST_GROUPS = 4  # of lights, each with a visibility of its own
SUN = -2  # `light_id` of the environment's brightest spot, where it is a light of its own
TRACING = 12
"""Counts the changes of what frames hold. Raise it whenever the same scene, frame and seed give
other values than rounding explains in any channel, of frames or references: sequences and data sets
begun before are then not continued. One number serves both, since what changes the mean of light
changes both, and more than one would let a folder hold frames that its references do not fit.

2: the first surface behind mirrors, clear glass and masks is the pixel's (`tracer/replacement.py`);
under half-open masks mirrors and glass show lamps; the sun of a sky is a light (`lights/sun.py`).
3: lamps in other layers of glass and masks have no noise (`tracer/layers.py`).
4: of more than 64 lights fewer are cut, of more than 96 some speak for others (`clusters.py`).
5: of several lights, lamps count in direct light as if they were picked for sure (`strata.py`).
6: where lobes are narrow, unshadowed light has nothing of the sky (`resampling.py`).
7: shadow rays go through masks and panes, and light is looked for in flat mirrors (`mirrors.py`).
8: light is looked for by way of smooth balls (`lights/balls/`).
9: lamps have no noise after two turns inside of bent glass (`layers.py`).
10: later vertices of a frame's path leave light by way of balls to chance (`path.py`).
11: frames' first vertices look for lights in directions toward balls, too (`lights/balls/`).
12: shadow rays go through slabs of glass (`lights/slabs.py`), and light is looked for in what they
and panes mirror (`lights/mirrors.py`), also where masks are.
"""

_ROWS = (
    Channel("color", Group.RADIANCE, ("R", "G", "B"), FLOAT, Display.LIGHT, 0.0,
            "radiance, linear Rec. 709; emission + direct + indirect (+ the environment)"),
    Channel("emission", Group.RADIANCE, _rgb("emission"), FLOAT, Display.LIGHT, 0.0,
            "radiance that the visible surface (or the environment) emits itself, with that of "
            "lamps and the environment in other layers of glass and masks; no noise"),
    Channel("direct", Group.RADIANCE, _rgb("direct"), FLOAT, Display.LIGHT, 0.0,
            "light from emitters scattered once, at the first hit; not demodulated"),
    Channel("indirect", Group.RADIANCE, _rgb("indirect"), FLOAT, Display.LIGHT, 0.0,
            "light scattered twice or more; not demodulated"),
    Channel("albedo", Group.GUIDES, _rgb("albedo"), HALF, Display.LIGHT, 0.0,
            "diffuse reflectance in [0, 1], less what mirrors and glass before the surface take; 1 "
            "where there is no diffuse part"),
    Channel("normal", Group.GUIDES, ("N.X", "N.Y", "N.Z"), FLOAT, Display.AXES, 0.0,
            "shading normal, normal and bump maps included, world space, unit length, facing the "
            "camera"),
    Channel("position", Group.GUIDES, ("P.X", "P.Y", "P.Z"), EXACT, Display.RANGE, 0.0,
            "first hit, or its image in a mirror or glass, world space, scene units (float32: see "
            "`depth` far from the origin)"),
    Channel("depth", Group.GUIDES, ("Z",), EXACT, Display.RANGE, 0.0,
            "camera-space z of the first hit (not distance along the ray), scene units, > 0"),
    Channel("id", Group.GUIDES, ("ID",), OBJECT_ID, Display.OBJECT, -1.0,
            "object ID: rank of the shape's name in sorted order; images in mirrors and bent glass "
            "have others, see the manifest's `objects`; -1: nothing there"),
    Channel("hit_distance", Group.PATH, ("hit.Z",), FLOAT, Display.RANGE, 0.0,
            "from the first hit to what the path met next, scene units; 0: nothing"),
    Channel("unshadowed", Group.SPLIT, _rgb("unshadowed"), FLOAT, Display.LIGHT, 0.0,
            "direct light as if nothing cast a shadow, noise-free (`--direct resampled` only); "
            "of a sky none where all lobes are narrow"),
    Channel("visibility", Group.SPLIT, ("visibility",), FLOAT, Display.UNIT, 0.0,
            "share of `unshadowed` that arrives, one noisy sample, may exceed 1, at most 10000 "
            "(likewise)"),
    Channel("light", Group.SHADOW, ("light.X", "light.Y", "light.Z"), FLOAT, Display.RANGE, 0.0,
            "from the first hit to the point of a light that its shadow ray asked for, world axes, "
            "scene units; 0: no ray (likewise)"),
    Channel("light_id", Group.SHADOW, ("light.ID",), OBJECT_ID, Display.OBJECT, -1.0,
            "object ID of that light; -1: none, or the environment, -2: its sun (likewise)"),
    Channel("blocker_distance", Group.SHADOW, ("blocker.Z",), FLOAT, Display.RANGE, 0.0,
            "from the first hit to what stopped that ray, scene units; 0: nothing did (likewise)"),
    Channel("blocker_id", Group.SHADOW, ("blocker.ID",), OBJECT_ID, Display.OBJECT, -1.0,
            "object ID of what stopped it; -1: nothing (likewise)"),
    Channel("group", Group.GROUPED, ("group.ID",), OBJECT_ID, Display.OBJECT, -1.0,
            "group of lights that the shadow ray went to; -1: no ray (with --direct resampled and "
            "two lights or more)"),
    Channel("group_sample", Group.GROUPED, ("group.V", "group.W", "group.P"), FLOAT, Display.RANGE,
            0.0,
            "what that ray says of its group: visibility sample y, its weight (the mean of y were "
            "nothing in the way), and the chance that the ray had to go there (likewise)"),
    *(Channel(f"unshadowed{g}", Group.GROUPED, _rgb(f"unshadowed{g}"), FLOAT, Display.LIGHT, 0.0,
              f"part of `unshadowed` that light sampling finds in group {g} (likewise)")
      for g in range(MOST_GROUPS)),
    Channel("specular", Group.GLOSS, _rgb("specular"), FLOAT, Display.LIGHT, 0.0,
            "part of `indirect` whose first direction a glossy or mirror lobe chose"),
    Channel("hit_id", Group.GLOSS, ("hit.ID",), OBJECT_ID, Display.OBJECT, -1.0,
            "object ID of what the path met next; -1: nothing"),
    Channel("roughness", Group.GLOSS, ("roughness",), HALF, Display.UNIT, 1.0,
            "GGX alpha of the surface's glossy lobe; 0: a mirror or a hole, 1: no such lobe"),
    Channel("caustic", Group.CAUSTIC, _rgb("caustic"), FLOAT, Display.LIGHT, 0.0,
            "part of `indirect` that lamps send to the first hit through one ball of glass, or by "
            "its reflection or that of one of metal; not demodulated"),
    Channel("layer_share", Group.LAYER, ("layer.A",), FLOAT, Display.UNIT, 0.0,
            "share that the brightest other layer has in what glass or a mask shows, by what of "
            "its light gets here; 0: there is none"),
    Channel("layer_albedo", Group.LAYER, _rgb("layer.albedo"), HALF, Display.LIGHT, 0.0,
            "`albedo` of that layer's surface, less what is lost of its light on the way"),
    Channel("layer_normal", Group.LAYER, ("layer.N.X", "layer.N.Y", "layer.N.Z"), FLOAT,
            Display.AXES, 0.0, "its `normal`, of the image"),
    Channel("layer_depth", Group.LAYER, ("layer.Z",), EXACT, Display.RANGE, 0.0,
            "its `depth`, of the image; 0: none, or nothing there"),
    Channel("layer_id", Group.LAYER, ("layer.ID",), OBJECT_ID, Display.OBJECT, -1.0,
            "its `id`, of the image; -1: none, or nothing there"),
    Channel("replay", Group.REPLAY, ("replay.direct", "replay.indirect"), FLOAT, Display.UNIT, -1.0,
            "luminance of some samples of the frame one number before (in the sequence or not), "
            "shaded again here; -1: no sample"),
    Channel("replay_before", Group.REPLAY, ("before.direct", "before.indirect"), FLOAT,
            Display.UNIT, -1.0,
            "luminance that the same samples had in that frame; -1: no sample"),
    Channel("motion", Group.MOTION, ("motion.X", "motion.Y"), EXACT, Display.RANGE, 0.0,
            "from a pixel's centre to where its surface was on the screen of the frame before, "
            "pixels, x to the right and y down; not finite: unknown"),
    Channel("variance", Group.TRUTH, _rgb("variance"), EXACT, Display.LIGHT, 0.0,
            "variance of the mean that `color` holds, radiance^2 (older references only)"),
    Channel("half", Group.TRUTH, _rgb("half"), HALF, Display.LIGHT, 0.0,
            "first half of a reference's samples minus `color`; `color` minus this is the second "
            "half (references only)"),
    Channel("quarter0", Group.TRUTH, _rgb("quarter0"), HALF, Display.LIGHT, 0.0,
            "first quarter of a reference's samples minus the first half; that half minus this is "
            "the second quarter (likewise)"),
    Channel("quarter1", Group.TRUTH, _rgb("quarter1"), HALF, Display.LIGHT, 0.0,
            "third quarter minus the second half; that half minus this is the fourth (likewise)"),
)

CHANNELS = MappingProxyType({row.name: row for row in _ROWS})


def channels_of(*groups: Group) -> tuple[str, ...]:
    """Names of the channels of some groups, group by group, in the order of the table.

    Example:
        >>> channels_of(Group.SPLIT)
        ('unshadowed', 'visibility')
    """
    return tuple(row.name for group in groups for row in _ROWS if row.group is group)


RADIANCE, PATH, SPLIT, SHADOW, GROUPED, GLOSS, CAUSTIC, LAYER, REPLAY = (
    channels_of(group) for group in (
        Group.RADIANCE, Group.PATH, Group.SPLIT, Group.SHADOW, Group.GROUPED, Group.GLOSS,
        Group.CAUSTIC, Group.LAYER, Group.REPLAY))
UNSHADOWED = tuple(name for name in GROUPED if name.startswith("unshadowed"))
FRAME = channels_of(Group.RADIANCE, Group.GUIDES, Group.PATH)
"""What can be said of every scene."""
OFFERED = channels_of(*(group for group in Group if group not in (Group.TRUTH, Group.MOTION)))
"""What a rendered frame can carry."""
TRAINING = tuple(name for name in OFFERED if name not in ("color", "position", *REPLAY))
"""What training and methods read, but for what `asvgf` alone does, without what follows from it
(`render/derived.py`)."""
REFERENCE = ("color", "half", "quarter0", "quarter1")
"""What the file of a reference has."""


def asked_channels(text: str | None) -> tuple[tuple[str, ...] | None, tuple[str, ...]]:
    """The channels that `--channels` asks for, None for the default ones, and those to add.

    Raises:
        InputError: a name that is not in `OFFERED`, or none.

    Example:
        >>> asked_channels("id,color"), asked_channels("+gradient")
        ((('color', 'id'), ()), (None, ('replay', 'replay_before')))
    """
    if text is None or text == "training":
        return None, ()
    added = text.startswith("+")
    names = [name.strip() for name in text[added:].split(",") if name.strip()]
    names = [n for name in names for n in (REPLAY if name == "gradient" else (name,))]
    unknown = [name for name in names if name not in OFFERED]
    if unknown or not names:
        raise InputError(f"--channels names {unknown[0] if unknown else 'nothing'}: "
                         f"use some of {', '.join(OFFERED)}")
    chosen = tuple(name for name in OFFERED if name in names)
    return (None, chosen) if added else (chosen, ())
