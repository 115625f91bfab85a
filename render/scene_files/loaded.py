"""What a scene file gives: a scene, and what has to be said about it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from onespp.scenes.description import Scene

FRAMES = 24  # as many as nothing says otherwise


@dataclass(frozen=True)
class Loaded:
    """A scene from a file.

    Attributes:
        unused: what of the file is not used, in words; "" if nothing.
        added: what it has beside, in a sentence; "" if nothing.
        files: what it was read from: the file itself, and those that it names.
    """

    scene: Scene
    unused: str
    added: str = ""
    files: tuple[Path, ...] = ()


def scene_name(path: Path) -> str:
    """What a file's scene is called."""
    name = "".join(letter if letter.isprintable() else "_" for letter in path.stem)[:100]
    return name if name.strip(". ") else "scene"


def unique_names(names: Iterable[str]) -> list[str]:
    """Names of which those that come again have a number behind them."""
    made: list[str] = []
    taken: dict[str, int] = {}
    for name in names:
        name = "".join(letter if letter.isprintable() else "_" for letter in name)[:180]
        chosen = name
        while chosen in taken:
            taken[name] += 1
            chosen = f"{name} {taken[name]}"
        taken[chosen] = 1
        made.append(chosen)
    return made
