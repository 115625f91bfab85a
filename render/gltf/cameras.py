"""Cameras of a file, and one that sees everything where there is none.

glTF's camera looks along -z with y up; ours along z with y down.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from onespp.render.scene_files.extent import bounds
from onespp.scenes.animation import Animation
from onespp.scenes.description import Camera, SceneError, Shape
from onespp.scenes.transforms import Matrix, look_at
from onespp.scenes.validity import brief

from .document import Document
from .item import Item
from .nodes import Node

WIDTH, HEIGHT = 768, 576  # where no camera says its shape
_LARGEST_ASPECT = 16.0
_FRONT, _FOV = np.array([0.45, 0.35, 1.0]), 40.0  # glTF's front is +z


def camera(document: Document, nodes: Sequence[Node],
           number: int) -> tuple[Camera, int, int] | None:
    """Of the nodes that are shown the camera of that number, and a width and a height for it.

    None where there is none.
    """
    found = [node for node in nodes if "camera" in node.item]
    if not found and number == 0:
        return None
    if not 0 <= number < len(found):
        raise document.root.error(
            f"there is no sensor {number}: " + (f"use --sensor 0 to {len(found) - 1}"
                                                if found else "it has no cameras"))
    if len(found) > 1:
        document.leave(found[1 if number == 0 else 0].item, "another camera")
    node = found[number]
    item = document.refer(node.item, "camera", "cameras")
    if item.text("type") != "perspective":
        raise item.error(f"a camera of type {brief(item.text('type'))} cannot be rendered here: "
                         "use perspective")
    lens = item.part("perspective")
    fov = float(np.degrees(lens.number("yfov", 0)))
    aspect = lens.number("aspectRatio", WIDTH / HEIGHT, 1 / _LARGEST_ASPECT, _LARGEST_ASPECT)
    try:
        return Camera(_place(node), fov), WIDTH, max(round(WIDTH / aspect), 1)
    except SceneError as error:
        raise item.error(str(error)) from None


def _place(node: Node) -> Matrix | Animation:
    place = node.world_from_node
    return Animation(lambda frame: _upright(place(frame), node.item)) if callable(
        place) else _upright(place, node.item)


def _upright(matrix: np.ndarray, item: Item) -> Matrix:
    """world_from_camera of a node, without what scales, shears or mirrors it."""
    forward, up = -matrix[:3, 2], matrix[:3, 1]
    try:
        return look_at(matrix[:3, 3], matrix[:3, 3] + forward / np.abs(forward).max(), up)
    except (ValueError, FloatingPointError):
        raise item.error("a camera stands on it that its scale makes flat: scale by more than 0"
                         ) from None


def camera_of_all(shapes: Sequence[Shape]) -> Camera:
    """From the front, a little from the right and above, so far away that all is seen."""
    boxes = [bounds(shape) for shape in shapes]
    low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    middle, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2 or 1.0
    away = radius / np.sin(np.radians(_FOV) / 2)
    return Camera(look_at(middle + away * _FRONT / np.linalg.norm(_FRONT), middle), _FOV)
