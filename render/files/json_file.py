"""JSON files that are checked when read: what does not fit ends in one sentence.

The sentence names the file, the key and the rule, and shows nothing of the file but names.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from onespp.render.errors import InputError

from .atomic import read_bytes


class JsonFile(BaseModel):
    """What a JSON file holds: no other keys, no conversion of types."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


_Model = TypeVar("_Model", bound=JsonFile)


def read_json(path: Path, model: type[_Model]) -> _Model:
    """A checked JSON file; InputError, one sentence, where it is missing or does not fit."""
    data = read_bytes(path)
    try:
        return model.model_validate_json(data)
    except ValidationError as error:
        raise InputError(f"{path} {explain(error)}") from None


def checked(model: type[_Model], what: str, **values: Any) -> _Model:
    """A model of values that a user gave; InputError, one sentence, where they do not fit."""
    try:
        return model(**values)
    except ValidationError as error:
        raise InputError(f"{what} {explain(error)}") from None


def format_json(model: JsonFile) -> str:
    return model.model_dump_json(indent=2) + "\n"


def explain(error: ValidationError, remedy: str = "make it again") -> str:
    """The first of pydantic's complaints, as the end of a sentence that begins with the file.

    remedy: what to do where something is missing, or does not fit together.
    """
    first = error.errors(include_url=False, include_input=False)[0]
    if first["type"] == "json_invalid":
        return f"is not valid JSON ({_line(first['msg'].removeprefix('Invalid JSON: '))})"
    where = ".".join(map(str, first["loc"]))
    if first["type"] == "extra_forbidden":
        return f"has an unknown key '{_line(where)}': remove it, or use the version that wrote it"
    if first["type"] == "missing":
        return f"lacks the key '{_line(where)}': {remedy}"
    message = first["msg"].removeprefix("Value error, ")
    if not where:
        return f"does not hold what it should ({_line(message)}): {remedy}"
    return f"has an invalid '{_line(where)}' ({_line(message[:1].lower() + message[1:])})"


def _line(text: str) -> str:
    """Text from a file, made fit for one line of a message."""
    shown = "".join(c if c.isprintable() else "?" for c in text)
    return shown if len(shown) <= 400 else f"{shown[:397]}..."
