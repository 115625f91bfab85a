"""The box at a quarter of its pace: a scene made of another by changing its clock."""

from dataclasses import replace

from onespp.scenes.box import box
from onespp.scenes.description import Scene, Shape

PACE = 0.25


def scene() -> Scene:
    fast = box()
    return replace(fast, name="slow_box", shapes=tuple(map(slowed, fast.shapes)))


def slowed(shape: Shape) -> Shape:
    if not shape.moves:
        return shape
    return replace(shape, world_from_object=lambda f: shape.world_from_object_at(PACE * f))
