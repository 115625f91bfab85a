"""A frame's matrices on disk: JSON that a person can read and that loses no bit of a float64.

`b_from_a` maps column vectors of space a to space b; a matrix is its rows, a line each.

Of hundreds of objects few move, and what is asked of matrices is how objects moved between frames.
Those that the manifest's `moving` leaves out stand still: they are not in the file, and the space
of such an object is the world's.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
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
                    objects: Mapping[str, np.ndarray],
                    moving: Collection[str] | None = None) -> str:
    """JSON of a frame's matrices, a row a line. Numbers are written so that they read back exactly.

    Args:
        objects: name -> world_from_object (4, 4), in order of ID.
        moving: those that are written; None: all.
    """
    def text(matrix: np.ndarray, indent: str) -> str:
        rows = (f"\n{indent}  [{', '.join(repr(float(x)) for x in row)}]" for row in matrix)
        return f"[{','.join(rows)}\n{indent}]"

    written = frozenset(objects if moving is None else moving)
    entries = (f'\n    {json.dumps(name)}: '
               f'{{"id": {i}, "world_from_object": {text(matrix, "    ")}}}'
               for i, (name, matrix) in enumerate(objects.items())
               if name in written)
    return (f'{{\n  "frame": {frame},\n'
            f'  "camera_from_world": {text(camera_from_world, "  ")},\n'
            f'  "screen_from_world": {text(screen_from_world, "  ")},\n'
            f'  "objects": {{{",".join(entries)}\n  }}\n}}\n')


def read_matrices(path: Path, frame: int, objects: tuple[str, ...],
                  moving: Collection[str] | None = None,
                  ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """camera_from_world, screen_from_world (4, 4) and world_from_object (n, 4, 4), float64.

    Args:
        frame, objects: what the file must be of: frame number, and names in order of ID.
        moving: those of the objects that it has, None: all. The others' matrix is the identity.

    Raises:
        InputError: missing, malformed, of another frame or of other objects.
    """
    found = read_json(path, _Matrices)
    if found.frame != frame:
        raise InputError(f"{path} holds frame {found.frame}, expected {frame}: render it again")
    ids = {name: part.id for name, part in found.objects.items()}
    written = frozenset(objects if moving is None else moving)
    expected = {name: i for i, name in enumerate(objects) if name in written}
    if ids != expected:
        odd = next(n for n in (*expected, *ids) if ids.get(n) != expected.get(n))
        raise InputError(f"{path} disagrees with the manifest about the object {odd[:80]!r}: "
                         "render the frame again")
    world_from_object = np.tile(np.eye(4), (len(objects), 1, 1))
    if ids:
        world_from_object[[*ids.values()]] = [o.world_from_object for o in found.objects.values()]
    return np.array(found.camera_from_world), np.array(found.screen_from_world), world_from_object
