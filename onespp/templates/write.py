"""Writes a file to begin from: a method, a metric or a scene of one's own."""

from __future__ import annotations

import keyword
import re
from pathlib import Path

from onespp.render.errors import InputError

KINDS = ("method", "metric", "scene")
_LONGEST = 40


def write_new(kind: str, name: str) -> Path:
    """Write `name`.py, a commented file that runs as it is.

    Args:
        kind: one of `KINDS`. name: of the method, metric or scene, with the folder where the file
            is to be, or without.
    Returns:
        The file.

    Raises:
        InputError: a name that code cannot have or that is taken, a file that is there, or a folder
            that is not.
    """
    path = Path(name if name.endswith(".py") else f"{name}.py")
    stem = path.stem
    if not stem.isidentifier() or not stem.isascii() or keyword.iskeyword(stem) or (
            stem.startswith("_") or len(stem) > _LONGEST):
        raise InputError(f"'{stem[:60]}' cannot be the name of a {kind}: use up to {_LONGEST} "
                         "letters, digits and '_', a letter first")
    if stem in _taken(kind):
        raise InputError(f"'{stem}' is taken by onespp: use another name")
    template = text = (Path(__file__).parent / f"{kind}.py").read_text("utf-8")
    for old, new in (("my_filter", stem), ("MyFilter", _capitals(stem)), ("my_metric", stem),
                     ("my metric", stem.replace("_", " ")), ("my_scene", stem)):
        if new != old in template and kind != "scene" and re.search(rf"\b{new}\b", template):
            raise InputError(f"'{new}' is a name that the file uses for something else: use "
                             "another name")
        text = text.replace(old, new)
    # Where the file goes, onespp is a package like NumPy, and import sorters want them together.
    text = text.replace("import numpy as np\n\nfrom", "import numpy as np\nfrom")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise InputError(f"{path} is there already: remove it, or use another name") from None
    except FileNotFoundError:
        raise InputError(f"there is no folder {path.parent}: make it first") from None
    return path


def _taken(kind: str) -> set[str]:
    """Names that such a thing cannot have."""
    if kind == "method":
        from onespp.denoise.catalog import METHODS, PEERS
        from onespp.render.files.manifest import RESERVED

        return {*METHODS, *PEERS, *RESERVED}
    if kind == "metric":
        from onespp.denoise.score.scorecard import taken_names

        return taken_names()
    from onespp.scenes.catalog import SCENES

    return {*SCENES}


def _capitals(name: str) -> str:
    """MyFilter of my_filter."""
    return "".join(word[:1].upper() + word[1:] for word in name.split("_"))
