"""What a data set is to be: a TOML file, or one of the plans that come along.

A sequence is a pure function of the plan and its number; how many sequences there are does not
matter to it, so that a data set can grow.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, FiniteFloat, ValidationError, model_validator

from onespp.render.channels import asked_channels
from onespp.render.errors import InputError
from onespp.render.files.atomic import read_bytes
from onespp.render.files.json_file import JsonFile, explain
from onespp.scenes.description import LARGEST_SIDE, MOST_FRAMES, SceneError
from onespp.scenes.drawn.choices import Choices, HeldOut
from onespp.scenes.drawn.draw import Request, spread

from .patterns import READ, names_of

if sys.version_info >= (3, 11):
    import tomllib
else:  # Python 3.10 reads no TOML; tomli is what became tomllib
    import tomli as tomllib  # pyright: ignore[reportMissingImports]

PRESETS = ("simple", "rooms", "hard")
SPLITS = ("train", "validation", "test")
MOST_SEEDS = 1000
Share = Annotated[FiniteFloat, Field(ge=0, le=1)]
SplitName = Literal["train", "validation", "test"]


class Split(JsonFile):
    """Shares of the sequences that are for validation and for the test; the rest is to train on."""

    validation: Share = 0.1
    test: Share = 0.1

    @model_validator(mode="after")
    def _not_too_much(self) -> Split:
        if self.validation + self.test > 1:
            raise ValueError("validation and test together are more than 1")
        return self


class Plan(JsonFile):
    """A data set.

    Attributes:
        name: of the data set and its scenes. about, licence: for its card.
        seed: of all that is drawn. sequences: how many. frames: of each. height, width: pixels.
        seeds: noisy renders of each frame, which share a reference.
        reference_spp, reference_error: as of `onespp render`; one of them, or none.
        antialias, half, channels: likewise.
        draw: what from. split: for what. held_out: what the test split alone has.
        folder: from which the names of files in `draw` and `held_out` are.
        contents: of each of these files, a hash; see `files.opened`.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$")]
    about: Annotated[str, Field(max_length=300)] = ""
    licence: Annotated[str, Field(max_length=100)] = ""
    seed: Annotated[int, Field(ge=0, lt=1 << 32)] = 1
    sequences: Annotated[int, Field(ge=1, lt=1_000_000)]
    frames: Annotated[int, Field(ge=1, le=MOST_FRAMES)]
    height: Annotated[int, Field(ge=1, le=LARGEST_SIDE)]
    width: Annotated[int, Field(ge=1, le=LARGEST_SIDE)]
    seeds: Annotated[int, Field(ge=1, le=MOST_SEEDS)] = 1
    reference_spp: Annotated[int, Field(ge=4)] | None = None
    reference_error: Annotated[FiniteFloat, Field(gt=0)] | None = None
    antialias: bool = False
    half: bool = True
    channels: str = "training"
    draw: Choices = Choices()
    split: Split = Split()
    held_out: HeldOut = HeldOut()
    folder: str = ""
    contents: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _makes_sense(self) -> Plan:
        if self.reference_spp is not None and self.reference_error is not None:
            raise ValueError("reference_spp and reference_error both say how good references are "
                             "to be: use one of them")
        try:
            asked_channels(self.channels)
            self._choices("train")
            self._choices("test")
        except (InputError, SceneError) as error:
            raise ValueError(str(error)) from None
        return self

    @property
    def named(self) -> tuple[str, ...]:
        """All files in `draw` and `held_out`."""
        return tuple(dict.fromkeys((*self.draw.files, *self.held_out.files, *self.draw.meshes,
                                    *self.held_out.meshes)))

    @property
    def key(self) -> str:
        """A hash of all that a sequence follows from."""
        text = self.model_dump_json(exclude={"sequences", "about", "licence", "folder"})
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def split_of(self, number: int) -> str:
        """What a sequence is for; splits are spread evenly over the numbers."""
        at = spread(number)
        if at < self.split.test:
            return "test"
        return "validation" if at < self.split.test + self.split.validation else "train"

    def request(self, number: int, attempt: int = 0) -> Request:
        """What scene a sequence shows."""
        split = self.split_of(number)
        held_out = self.held_out if split == "test" else None
        return Request(self.name, self.seed, number, self.frames, self.height, self.width,
                       self._choices(split), held_out, attempt)

    def noise_seed(self, number: int, k: int) -> int:
        """Of the k-th render of a sequence: no two renders share their noise, whatever they show.

        What is the same in all of them would be learnt.
        """
        return MOST_SEEDS * number + k

    def _choices(self, split: str) -> Choices:
        of = self.held_out.alone if split == "test" else self.held_out.left
        return of(self.draw)


def read_plan(plan: str | Path, changes: Mapping[str, Any] | None = None) -> Plan:
    """The plan of a name of `PRESETS`, or of a TOML file.

    Args:
        changes: key -> value that replaces the file's; a key inside a table is "draw.things".

    Patterns of files become names, from the folder that the file is in; for a plan that comes
    along, from the working directory.

    Raises:
        InputError: no such plan, or something in it cannot be used.
    """
    path, folder = Path(plan), Path(plan).parent
    if str(plan) in PRESETS:
        folder = Path()
        path = Path(__file__).with_name(f"{plan}.toml")
    elif path.suffix != ".toml":
        close = difflib.get_close_matches(str(plan), PRESETS, n=1)
        raise InputError(f"unknown plan '{plan}': " + (f"did you mean '{close[0]}'? " if close
                         else "") + f"there are {', '.join(PRESETS)}, or give a .toml file")
    try:
        values = tomllib.loads(read_bytes(path).decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not a TOML file ({error})") from None
    return changed(values, changes or {}, str(path), folder)


def changed_plan(plan: Plan, changes: Mapping[str, Any]) -> Plan:
    """The plan with other settings; InputError where they do not fit."""
    return changed(plan.model_dump(mode="json", exclude_none=True), changes, "the plan", Path())


def changed(values: dict[str, Any], changes: Mapping[str, Any], what: str, folder: Path) -> Plan:
    """A plan of a TOML file's tables, some settings changed; files are from `folder`."""
    for key, value in changes.items():
        _change(values, key, value)
    if changes:
        what += f" with {', '.join(f'{key}={value}' for key, value in changes.items())}"
    plan = checked_plan(values, what)
    if not plan.named:
        return plan
    values = plan.model_dump(mode="json", exclude_none=True)
    folder = (folder / plan.folder).resolve()
    for table in ("draw", "held_out"):
        for kind, suffixes in READ.items():
            values[table][kind] = names_of(values[table][kind], folder,
                                           f"{what}, {table}.{kind},", suffixes)
    return checked_plan({**values, "folder": folder.as_posix()}, what)


def checked_plan(values: Mapping[str, Any], what: str) -> Plan:
    """A plan of a dictionary; InputError, one sentence, where it does not fit."""
    strange = _unknown(values)
    if strange:
        raise InputError(f"{what} has an unknown key '{strange}': see docs/datasets.md, or "
                         "`onespp.datasets.plan.Plan`, for those there are")
    try:  # as JSON, where a list may be a tuple
        return Plan.model_validate_json(json.dumps(values, default=str))
    except ValidationError as error:
        raise InputError(f"{what} {explain(error, 'correct it')}") from None


def value_of(text: str) -> tuple[str, Any]:
    """The key and the value of 'KEY=VALUE', the value as TOML has it; a bare word is text.

    Example:
        >>> value_of("draw.things=[3, 5]"), value_of("name=mine")
        (('draw.things', [3, 5]), ('name', 'mine'))

    Raises:
        InputError: there is no '='.
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError(f"--set {text} is not understood: use KEY=VALUE, as draw.things=[3,5]")
    try:
        return key.strip(), tomllib.loads(f"x = {value}")["x"]
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()


def _change(values: dict[str, Any], key: str, value: Any) -> None:
    *tables, last = key.split(".")
    for table in tables:
        values = values.setdefault(table, {})
        if not isinstance(values, dict):
            raise InputError(f"the plan has no table '{table}', which {key} would be in")
    values[last] = value
    if last in ("reference_spp", "reference_error") and not tables:  # the other one gives way
        other = {"reference_spp", "reference_error"} - {last}
        values.pop(other.pop(), None)


def _unknown(values: Mapping[str, Any]) -> str | None:
    """The first key that no plan has. (A dataclass takes whatever it is given.)"""
    for table, model in (("draw", Choices), ("held_out", HeldOut)):
        inner = values.get(table)
        known = model.__dataclass_fields__
        for key in inner if isinstance(inner, dict) else ():
            if key not in known:
                return f"{table}.{key}"
    return None
