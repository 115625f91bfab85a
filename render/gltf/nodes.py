"""The node tree: where each node is, in the world, in each frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from onespp.scenes import quaternions
from onespp.scenes.animation import Animation, compose
from onespp.scenes.description import Motion
from onespp.scenes.transforms import Matrix, scale, translate

from .animations import Track
from .document import Document
from .item import Item

_PROPERTIES = ("translation", "rotation", "scale")
_MOST = 100_000
_ROUNDING = 1e-5


@dataclass(frozen=True)
class Node:
    """A node of the scene that is shown. world_from_node: a matrix, or a function of the frame."""

    item: Item
    name: str
    world_from_node: Matrix | Motion

    def at(self, frame: float) -> Matrix:
        place = self.world_from_node
        return place(frame) if callable(place) else place


def nodes(document: Document, tracks: Mapping[tuple[int, str], Track]) -> list[Node]:
    """All nodes that are shown, parents before what hangs on them."""
    root = document.root
    every = root.parts("nodes")
    waiting: list[tuple[Item, int, Matrix | Motion]] = []
    waiting += [(item, index, np.eye(4)) for item, index in _roots(document)][::-1]
    found: list[Node] = []
    seen: set[int] = set()
    while waiting:
        said, index, above = waiting.pop()
        if index >= len(every):
            raise said.error(f"it names node {index}, and there are {len(every)} nodes: export "
                             "the file again")
        if index in seen or len(seen) > _MOST:
            raise said.error(f"it names node {index}, which is somewhere else already: a node has "
                             "one parent")
        seen.add(index)
        item = every[index]
        place = _product(above, _local(item, index, tracks))
        found.append(Node(item, item.text("name") or f"node {index}", place))
        waiting += [(child, number, place) for child, number in item.wholes("children")][::-1]
    return found


def _roots(document: Document) -> Iterator[tuple[Item, int]]:
    root = document.root
    scenes = root.parts("scenes")
    if scenes:
        number = root.whole("scene", 0)
        yield from document.numbered(root, number, "scene", "scenes").wholes("nodes")
        if len(scenes) > 1:
            document.leave(scenes[1 if number == 0 else 0], "another scene of the file")
        return
    children = {index for node in root.parts("nodes") for _, index in node.wholes("children")}
    yield from ((node, index) for index, node in enumerate(root.parts("nodes"))
                if index not in children)


def _product(above: Matrix | Motion, local: Matrix | Motion) -> Matrix | Motion:
    if callable(above) or callable(local):
        return compose(above, local)
    return above @ local


def _local(item: Item, index: int,
           tracks: Mapping[tuple[int, str], Track]) -> Matrix | Motion:
    own = {name: tracks[index, name] for name in _PROPERTIES if (index, name) in tracks}
    if "matrix" in item:
        if own:
            raise item.error("it is animated and has a matrix: use translation, rotation and scale")
        matrix = item.numbers("matrix", np.eye(4).ravel().tolist()).reshape(4, 4).T.copy()
        if abs(matrix[3] - (0, 0, 0, 1)).max() > _ROUNDING:
            raise item.error("its matrix is a projection: use an affine one")
        matrix[3] = 0, 0, 0, 1
        return matrix
    x, y, z, w = item.numbers("rotation", (0, 0, 0, 1))
    turn = np.array([w, x, y, z])
    length = np.linalg.norm(turn)
    if not length > 0:
        raise item.error("its rotation has no length: export the file again")
    still = {"translation": item.numbers("translation", (0, 0, 0)), "rotation": turn / length,
             "scale": item.numbers("scale", (1, 1, 1))}
    still |= {name: track.at(0) for name, track in own.items()}
    moving = {name: track.at for name, track in own.items() if not track.is_still}
    placed = partial(_placed, still, moving)
    return Animation(placed) if moving else placed(0)


def _placed(still: Mapping[str, np.ndarray],
            moving: Mapping[str, Callable[[float], np.ndarray]], frame: float) -> Matrix:
    now = {**still, **{name: at(frame) for name, at in moving.items()}}
    return (translate(now["translation"]) @ quaternions.to_matrix(now["rotation"])
            @ scale(now["scale"]))
