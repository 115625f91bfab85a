"""A frame's matrices on disk: JSON that a person can read and that loses no bit of a float64.

`b_from_a` maps column vectors of space a to space b; a matrix is its rows, a line each.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, FiniteFloat

from onespp.render.errors import InputError

from .json_file import JsonFile, read_json

_Row = Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)]
_Matrix = Annotated[list[_Row], Field(min_length=4, max_length=4)]


class _Object(JsonFile):
    id: int
    world_from_object: _Matrix


class _Matrices(JsonFile):
    frame: int
    camera_from_world: _Matrix
    screen_from_world: _Matrix
    objects: dict[str, _Object]


def format_matrices(frame: int, camera_from_world: np.ndarray, screen_from_world: np.ndarray,
                    objects: Mapping[str, np.ndarray]) -> str:
    """JSON of a frame's matrices, a row a line. Numbers are written so that they read back exactly.

    Args:
        objects: name -> world_from_object (4, 4), in order of ID.
    """
    def text(matrix: np.ndarray, indent: str) -> str:
        rows = (f"\n{indent}  [{', '.join(repr(float(x)) for x in row)}]" for row in matrix)
        return f"[{','.join(rows)}\n{indent}]"

    entries = (f'\n    {json.dumps(name)}: '
               f'{{"id": {i}, "world_from_object": {text(matrix, "    ")}}}'
               for i, (name, matrix) in enumerate(objects.items()))
    return (f'{{\n  "frame": {frame},\n'
            f'  "camera_from_world": {text(camera_from_world, "  ")},\n'
            f'  "screen_from_world": {text(screen_from_world, "  ")},\n'
            f'  "objects": {{{",".join(entries)}\n  }}\n}}\n')


def read_matrices(path: Path, frame: int, objects: tuple[str, ...],
                  ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """camera_from_world, screen_from_world (4, 4) and world_from_object (n, 4, 4), float64.

    Args:
        frame, objects: what the file must be of: frame number, and names in order of ID.

    Raises:
        InputError: missing, malformed, of another frame or of other objects.
    """
    found = read_json(path, _Matrices)
    if found.frame != frame:
        raise InputError(f"{path} holds frame {found.frame}, expected {frame}: render it again")
    ids = {name: part.id for name, part in found.objects.items()}
    if ids != {name: i for i, name in enumerate(objects)}:
        odd = next(n for n in (*objects, *ids) if n not in ids or n not in objects
                    or ids[n] != objects.index(n))
        raise InputError(f"{path} disagrees with the manifest about the object {odd[:80]!r}: "
                         "render the frame again")
    parts = [found.objects[name].world_from_object for name in objects]
    return (np.array(found.camera_from_world), np.array(found.screen_from_world),
            np.array(parts).reshape(-1, 4, 4))
