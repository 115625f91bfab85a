"""What a sequence and a denoiser's run say about themselves, in JSON beside the images."""

from __future__ import annotations

import re
from collections.abc import Iterable
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    FiniteFloat,
    PlainSerializer,
    ValidationInfo,
    field_validator,
)

from onespp.render.channels import CHANNELS
from onespp.render.errors import InputError

from .frame_ranges import format_frames, parse_frames
from .json_file import JsonFile

FORMAT = 1
DIRECT, SAMPLERS, JITTERS = ("mis", "resampled"), ("pcg", "zsobol", "bluenoise"), ("none", "halton")
"""What a render can be asked for, by the name that its manifest has."""


def _frames(value: Any) -> tuple[int, ...]:
    if not isinstance(value, str | list | tuple | range):
        raise ValueError("should be text such as '0:20'")
    return parse_frames(value if isinstance(value, str) else ",".join(map(str, value)))


Size = Annotated[int, Field(ge=1, le=1 << 16)]
Name = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]+$")]


_UNKNOWN = ("spp", "max_depth", "direct", "sampler", "jitter", "reference_filter",
            "tracing")  # of an import


class Manifest(JsonFile):
    """What a sequence is, in `manifest.json`.

    `reference_spp` is the fewest samples that a reference has (while they are rendered: is to
    have), None where there is none; `reference_filter` is "centre" where samples go through pixel
    centres, as a frame's do, "box" where they are spread over the pixel.
    `jitter` says how far a frame's rays are from centres: "none", or "halton" for an offset a
    frame, which its matrices contain. `tracing` is `render.channels.TRACING` of the onespp that
    made the frames, 1 of those that did not say. `seed`, `spp`, `max_depth`, `direct`, `sampler`,
    `jitter`, `reference_filter` and `tracing` are None for imports, where nobody knows them (older
    versions wrote defaults there, which are not read). `objects` are names in order of ID, `moving`
    those of them that have matrices in the frames' files (the others stand still), None where all
    have. `fingerprint` is a hash of what the scene describes (or an import holds), so that an
    edited scene is not taken for the old one; `later` has hashes of frames after the scene's last
    one, by their number.
    `commands` are the command lines that made it, as they were typed, in order; `machine` is that
    of the first.
    """

    model_config = ConfigDict(validate_default=True)

    format: Annotated[int, Field(ge=FORMAT, le=FORMAT)] = FORMAT
    source: Literal["render", "games202", "foreign"] = "render"
    scene: Name
    about: str = ""
    frames: Annotated[tuple[int, ...], BeforeValidator(_frames),
                      PlainSerializer(format_frames, return_type=str)]
    width: Size
    height: Size
    fps: Annotated[FiniteFloat, Field(gt=0)] = 24.0
    seed: Annotated[int, Field(ge=0)] | None = 0
    spp: Annotated[int, Field(ge=1)] | None = 1
    reference_spp: Annotated[int, Field(ge=1)] | None = None
    reference_filter: Literal["centre", "box"] | None = "centre"
    max_depth: Annotated[int, Field(ge=1)] | None = None
    direct: Name | None = "mis"
    sampler: Name | None = "pcg"
    jitter: Literal["none", "halton"] | None = "none"
    tracing: Annotated[int, Field(ge=1)] | None = 1
    channels: Annotated[tuple[str, ...], Field(min_length=1)]
    half: bool = False
    objects: Annotated[tuple[Name, ...], Field(min_length=1)]
    moving: tuple[Name, ...] | None = None
    fingerprint: str = ""
    later: dict[int, str] = Field(default_factory=dict)
    device: str = ""
    versions: dict[str, str] = Field(default_factory=dict)
    created: str = ""
    machine: str = ""
    commands: tuple[str, ...] = ()

    @field_validator(*_UNKNOWN)
    @classmethod
    def _known_of_renders_only(cls, value: Any, info: ValidationInfo) -> Any:
        return value if info.data.get("source", "render") == "render" else None

    @field_validator("channels")
    @classmethod
    def _known(cls, channels: tuple[str, ...]) -> tuple[str, ...]:
        for name in channels:
            if name not in CHANNELS:
                raise ValueError(f"{name[:40]!r} is not a channel, the channels are "
                                 f"{', '.join(CHANNELS)}")
        return _unique(channels)

    @field_validator("objects")
    @classmethod
    def _unique_objects(cls, objects: tuple[str, ...]) -> tuple[str, ...]:
        return _unique(objects)

    @field_validator("moving")
    @classmethod
    def _are_objects(cls, moving: tuple[str, ...] | None,
                     info: ValidationInfo) -> tuple[str, ...] | None:
        unknown = {*(moving or ())} - {*info.data.get("objects", moving or ())}
        if unknown:
            raise ValueError(f"{min(unknown)[:80]!r} is not one of the objects")
        return moving


# What two manifests of the same sequence have in common. The rest may change from run to run.
_IDENTITY = ("source", "scene", "fingerprint", "width", "height", "fps", "seed", "spp",
             "max_depth", "direct", "sampler", "jitter", "channels", "half", "objects", "tracing")


def first_difference(a: Manifest, b: Manifest) -> str | None:
    """The first setting in which two manifests are of different sequences; None: of the same."""
    both_have_references = a.reference_spp is not None and b.reference_spp is not None
    keys = (*_IDENTITY, "reference_filter") if both_have_references else _IDENTITY
    return next((key for key in keys if getattr(a, key) != getattr(b, key)), None)


class Run(JsonFile):
    """How a denoised result came to be, in `denoised/NAME/run.json`.

    `method` is what ran, whatever the results are called: a name of `onespp denoise --list`,
    `external` (the program is in `parameters`), `files` (results taken as they were), or a file
    of the user's, as `f.py:Name`, whose hash `source` is.
    `changed` are those of the `parameters` that are not the method's defaults.
    `ms` holds milliseconds by frame number, reading and writing of files excluded; `first_ms`
    the first call's, compilation included; `peak_mb` the most memory that the calls took, in MiB.
    `energy_kept` is the share of the input's mean radiance that outlier removal let through.
    `command` is the command line as it was typed. All are empty where they are not known.
    """

    method: Name
    parameters: dict[str, Any] = Field(default_factory=dict)
    changed: dict[str, Any] = Field(default_factory=dict)
    device: str = ""
    threads: int | None = None
    versions: dict[str, str] = Field(default_factory=dict)
    machine: str = ""
    source: str = ""
    command: str = ""
    first_ms: FiniteFloat | None = None
    ms: dict[int, FiniteFloat] = Field(default_factory=dict)
    peak_mb: FiniteFloat | None = None
    energy_kept: FiniteFloat | None = None


RESERVED = MappingProxyType({
    "input": "tables call the noisy frames so", "reference": "tables call the ground truth so",
    "all": "`--method all` means every method", "oidn": "`--method oidn` means its qualities"})
"""Names that results cannot have, and why."""


def check_result_name(name: str, others: Iterable[str] = ()) -> str:
    """A name for results; InputError if it is none, is taken by tables, or hides another one.

    Args:
        others: names of the results that are there. Some file systems cannot tell a name from
            one in other letters, small or capital, so no two may differ in that alone.
    """
    check_name(name, "method")
    if why := RESERVED.get(name.lower()):
        raise InputError(f"{name!r} cannot be the name of results, since {why}: use another --name")
    same = [other for other in others if other.lower() == name.lower() and other != name]
    if same:
        raise InputError(f"there are results called {same[0]!r}, which some file systems take for "
                         f"{name!r}: use another --name")
    return name


def check_name(name: str, what: str) -> str:
    """A name that is safe as a folder's; InputError otherwise."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,99}", name):
        raise InputError(f"{name[:40]!r} is not a name for a {what}: use letters, digits, "
                         "'.', '_', '+' and '-'")
    return name


def _unique(names: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(names)) < len(names):
        twice = next(n for n in names if names.count(n) > 1)
        raise ValueError(f"{twice[:80]!r} is listed twice")
    return names
