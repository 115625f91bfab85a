"""The channel table: every image that a frame can carry, written once.

A new signal is one row here and one function in `render/gbuffer.py` (or one more output of
the path tracer). Files, frames, imports and the documentation all read this table.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Channel:
    """One named image.

    Attributes:
        name: key in `Frame.images`.
        exr: channel names in the file, in component order; their number is the number of
            components. One component is an (h, w) image, more are (h, w, c).
        half: stored as float16 (16-bit data loses nothing that matters there), else float32.
            In memory everything is float32, `id` int32; other object IDs are int32 as rendered and
            float32 as read.
        background: value of a pixel whose ray hits nothing.
        about: meaning, space and unit.
    """

    name: str
    exr: tuple[str, ...]
    half: bool
    background: float
    about: str

    @property
    def components(self) -> int:
        return len(self.exr)


def _rgb(layer: str) -> tuple[str, ...]:
    return tuple(f"{layer}.{c}" for c in "RGB")


MOST_GROUPS = 4  # of lights, each with a visibility of its own

_ROWS = (
    Channel("color", ("R", "G", "B"), False, 0.0,
            "radiance, linear Rec. 709; emission + direct + indirect (+ the environment)"),
    Channel("emission", _rgb("emission"), False, 0.0,
            "radiance that the visible surface (or the environment) emits itself"),
    Channel("direct", _rgb("direct"), False, 0.0,
            "light from emitters scattered once, at the first hit; not demodulated"),
    Channel("indirect", _rgb("indirect"), False, 0.0,
            "light scattered twice or more; not demodulated"),
    Channel("unshadowed", _rgb("unshadowed"), False, 0.0,
            "direct light as if nothing cast a shadow, noise-free (`--direct resampled` only)"),
    Channel("visibility", ("visibility",), False, 0.0,
            "share of `unshadowed` that arrives, one noisy sample, may exceed 1 (likewise)"),
    Channel("light", ("light.X", "light.Y", "light.Z"), False, 0.0,
            "from the first hit to the point of a light that its shadow ray asked for, world axes, "
            "scene units; 0: no ray (likewise)"),
    Channel("light_id", ("light.ID",), False, -1.0,
            "object ID of that light; -1: none, or the environment (likewise)"),
    Channel("blocker_distance", ("blocker.Z",), False, 0.0,
            "from the first hit to what stopped that ray, scene units; 0: nothing did (likewise)"),
    Channel("blocker_id", ("blocker.ID",), False, -1.0,
            "object ID of what stopped it; -1: nothing (likewise)"),
    Channel("group", ("group.ID",), False, -1.0,
            "group of lights that the shadow ray went to; -1: no ray (with --direct resampled and "
            "two lights or more)"),
    Channel("group_sample", ("group.V", "group.W", "group.P"), False, 0.0,
            "what that ray says of its group: visibility sample y, its weight (the mean of y were "
            "nothing in the way), and the chance that the ray had to go there (likewise)"),
    *(Channel(f"unshadowed{g}", _rgb(f"unshadowed{g}"), False, 0.0,
              f"part of `unshadowed` that light sampling finds in group {g} (likewise)")
      for g in range(MOST_GROUPS)),
    Channel("specular", _rgb("specular"), False, 0.0,
            "part of `indirect` whose first direction a glossy or mirror lobe chose"),
    Channel("hit_distance", ("hit.Z",), False, 0.0,
            "from the first hit to what the path met next, scene units; 0: nothing"),
    Channel("hit_id", ("hit.ID",), False, -1.0,
            "object ID of what the path met next; -1: nothing"),
    Channel("roughness", ("roughness",), True, 1.0,
            "GGX alpha of the surface's glossy lobe; 0: a mirror or a hole, 1: no such lobe"),
    Channel("replay", ("replay.direct", "replay.indirect"), False, -1.0,
            "luminance of some samples of the frame one number before (in the sequence or not), "
            "shaded again here; -1: no sample"),
    Channel("replay_before", ("before.direct", "before.indirect"), False, -1.0,
            "luminance that the same samples had in that frame; -1: no sample"),
    Channel("albedo", _rgb("albedo"), True, 0.0,
            "diffuse reflectance in [0, 1]; 1 where the surface has no diffuse part"),
    Channel("normal", ("N.X", "N.Y", "N.Z"), False, 0.0,
            "shading normal, normal and bump maps included, world space, unit length, facing the "
            "camera"),
    Channel("position", ("P.X", "P.Y", "P.Z"), False, 0.0,
            "first hit, world space, scene units (float32: see `depth` far from the origin)"),
    Channel("depth", ("Z",), False, 0.0,
            "camera-space z of the first hit (not distance along the ray), scene units, > 0"),
    Channel("id", ("ID",), False, -1.0,
            "object ID: rank of the shape's name in sorted order; -1: nothing there"),
    Channel("variance", _rgb("variance"), False, 0.0,
            "variance of the mean that `color` holds, radiance^2 (references only)"),
)

CHANNELS = MappingProxyType({row.name: row for row in _ROWS})

RADIANCE = ("color", "emission", "direct", "indirect")
SPLIT = ("unshadowed", "visibility")
SHADOW = ("light", "light_id", "blocker_distance", "blocker_id")
UNSHADOWED = tuple(f"unshadowed{g}" for g in range(MOST_GROUPS))
GROUPED = ("group", "group_sample", *UNSHADOWED)
GLOSS = ("specular", "hit_distance", "hit_id", "roughness")
REPLAY = ("replay", "replay_before")
GBUFFER = ("albedo", "normal", "position", "depth", "id")
FRAME = RADIANCE + GBUFFER
REFERENCE = ("color", "variance")
IDS = ("id", "light_id", "blocker_id", "hit_id", "group")  # of objects, and of groups of lights
