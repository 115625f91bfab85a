"""How large things are, which way is up, and what is in the way: what moves take their sizes from.

Points are world space. "Up" is the axis of the world that the camera's own up is closest to, since
files do not say whether y or z is up.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi
from onespp.scenes.description import Cylinder, Mesh, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse

_GRAY = diffuse((0.5, 0.5, 0.5))
_GRID = 8  # rays a side that look how far away things are
_AROUND = np.array([d for d in product((-1, 0, 1), repeat=3) if any(d)], float)
_AROUND /= np.linalg.norm(_AROUND, axis=1, keepdims=True)


def bounds(shape: Shape, frame: float = 0) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of a shape's box, (3,) each, world space."""
    geometry = shape.geometry
    if isinstance(geometry, Mesh):
        points = geometry.vertices[np.unique(geometry.faces)]
    else:
        depth = {Sphere: (-1, 1), Cylinder: (0, 1)}.get(type(geometry), (0, 0))
        points = np.array(list(product((-1, 1), (-1, 1), depth)), float)
    place = shape.world_from_object_at(frame)
    points = points @ place[:3, :3].T + place[:3, 3]
    return points.min(0), points.max(0)


def upward(scene: Scene) -> np.ndarray:
    """The axis of the world that is up, (3,)."""
    up = -scene.camera.world_from_camera_at(0)[:3, 1]
    axis = int(np.argmax(abs(up)))
    return np.sign(up[axis]) * np.eye(3)[axis]


class Surroundings:
    """Rays into a scene as it is in frame 0; distances and points are the world's."""

    def __init__(self, scene: Scene) -> None:
        self._stage = MitsubaScene(replace(  # what things are made of takes long to load
            scene, environment=1.0, lights=(),
            shapes=tuple(replace(s, material=_GRAY, emission=None) for s in scene.shapes)))
        self._camera = scene.camera

    def focus_distance(self) -> float:
        """How far away what the camera sees is, in the middle (median over the middle half).

        Where it sees nothing, as far as the scene's shapes are.
        """
        place = self._camera.world_from_camera_at(0)
        span = np.tan(np.radians(self._camera.fov) / 2) / 2
        x, y = np.meshgrid(*[np.linspace(-span, span, _GRID)] * 2)
        rays = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], 1) @ place[:3, :3].T
        found = self._distances(np.broadcast_to(place[:3, 3], rays.shape), rays)
        found = found[np.isfinite(found)]
        if found.size:
            return float(np.median(found))
        boxes = [bounds(shape) for shape in self._stage.description.shapes]
        middle = np.mean([low + high for low, high in boxes], axis=0) / 2
        return float(np.linalg.norm(middle - place[:3, 3])) or 1.0

    def room_at(self, point: np.ndarray) -> float:
        """How far the nearest surface is from a point, over 26 directions."""
        return float(self._distances(np.broadcast_to(point, _AROUND.shape), _AROUND).min())

    def is_free(self, path: np.ndarray, margin: float) -> bool:
        """Whether a path, (n, 3) points, passes through no surface, nor nearer by than `margin`
        at any of its points."""
        steps = np.diff(path, axis=0)
        moving = steps.any(axis=1)
        if (self._distances(path[:-1][moving], steps[moving])
                <= np.linalg.norm(steps[moving], axis=1)).any():
            return False
        origins = np.repeat(path, len(_AROUND), axis=0)
        return bool((self._distances(origins, np.tile(_AROUND, (len(path), 1))) >= margin).all())

    def _distances(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(n,) distances to what rays meet, infinite for nothing."""
        if not len(origins):
            return np.empty(0)
        stage = self._stage
        start = (origins - stage.origin) / stage.unit
        unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        ray = mi.Ray3f(mi.Point3f(*_columns(start)), mi.Vector3f(*_columns(unit)))
        found = stage.mi_scene.ray_intersect_preliminary(ray)
        return np.array(found.t, np.float64) * stage.unit


def _columns(rows: np.ndarray) -> list[mi.Float]:
    return [mi.Float(np.ascontiguousarray(column, np.float32)) for column in rows.T]
