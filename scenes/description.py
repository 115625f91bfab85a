"""What a scene is made of: shapes, materials, lights, a camera, and how they move.

Everything is a pure function of the frame number (a float, so that motion can be sampled
between frames): any frame can be asked for alone, in any order, with the same result. What does
not move is given as a plain matrix, what moves as a function; a renderer updates only the latter.

Materials are Mitsuba BSDF dictionaries in plain Python: colours as (r, g, b) tuples, textures as
nested dictionaries, images as float (h, w, 3) arrays. See `scenes/materials.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .transforms import Matrix, identity

Color = tuple[float, float, float]
Motion = Callable[[float], Matrix]
Material = Mapping[str, Any]


class SceneError(ValueError):
    """A scene that cannot be built. The message is one sentence meant for its author."""


@dataclass(frozen=True)
class Sphere:
    """Unit sphere at the origin. Takes uniform scale only."""


@dataclass(frozen=True)
class Rectangle:
    """The square [-1, 1]^2 in the xy plane, facing +z, uv in [0, 1]^2."""


@dataclass(frozen=True)
class Disk:
    """Unit disk in the xy plane, facing +z."""


@dataclass(frozen=True)
class Cylinder:
    """Open unit-radius tube from z = 0 to z = 1, facing outward. Takes uniform scale only."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in object space.

    Attributes:
        vertices: (n, 3) float. faces: (m, 3) int, counter-clockwise from outside.
        normals: (n, 3) for smooth shading, None for flat. uv: (n, 2) or None.

    Raises:
        SceneError: shapes disagree, or a face names a vertex that is not there.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    uv: np.ndarray | None = None

    def __post_init__(self) -> None:
        n = len(self.vertices)
        for name, columns in (("vertices", 3), ("normals", 3), ("uv", 2)):
            array = getattr(self, name)
            if array is not None:
                array = np.asarray(array, np.float64)
                if array.shape != (n, columns):
                    raise SceneError(f"mesh {name} have shape {array.shape}, "
                                     f"expected ({n}, {columns})")
                object.__setattr__(self, name, array)
        faces = np.asarray(self.faces)
        if faces.ndim != 2 or faces.shape[1] != 3 or not np.issubdtype(faces.dtype, np.integer):
            raise SceneError(f"mesh faces have shape {faces.shape} and type {faces.dtype}, "
                             "expected (m, 3) integers")
        if faces.size and not (faces.min() >= 0 and faces.max() < n):
            raise SceneError(f"mesh faces use vertex {faces.max()}, but there are {n} vertices")
        object.__setattr__(self, "faces", faces.astype(np.uint32))


Geometry = Sphere | Rectangle | Disk | Cylinder | Mesh


@dataclass(frozen=True)
class Shape:
    """A thing with a name, a place and a surface.

    Attributes:
        name: unique in the scene and stable over frames; object IDs follow the names.
        geometry: what it is, in object space.
        material: a Mitsuba BSDF dictionary.
        world_from_object: a matrix, or a function of the frame number where it moves.
        emission: radiance (r, g, b) of an area light, or a function of the frame number.
    """

    name: str
    geometry: Geometry
    material: Material
    world_from_object: Matrix | Motion = field(default_factory=identity)
    emission: Color | Callable[[float], Color] | None = None

    @property
    def moves(self) -> bool:
        return callable(self.world_from_object)

    def world_from_object_at(self, frame: float) -> Matrix:
        place = self.world_from_object
        return np.asarray(place(frame) if callable(place) else place, np.float64)

    def emission_at(self, frame: float) -> Color | None:
        return self.emission(frame) if callable(self.emission) else self.emission


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Attributes:
        world_from_camera: a matrix (see `transforms.look_at`), or a function of the frame.
            Camera space: x right, y down, z forward; a rigid transform.
        fov: vertical field of view, degrees.
    """

    world_from_camera: Matrix | Motion
    fov: float = 40.0

    def __post_init__(self) -> None:
        if not 0 < self.fov < 180:
            raise SceneError(f"the camera's field of view is {self.fov} degrees: use 0 to 180")

    @property
    def moves(self) -> bool:
        return callable(self.world_from_camera)

    def world_from_camera_at(self, frame: float) -> Matrix:
        place = self.world_from_camera
        return np.asarray(place(frame) if callable(place) else place, np.float64)

    def screen_from_camera(self, height: int, width: int) -> Matrix:
        """Projection to pixels: x in [0, w), y in [0, h) down after dividing by depth.

        The third coordinate is 1 / depth, so that the matrix can be inverted.
        """
        focal = 0.5 * height / np.tan(np.radians(self.fov) / 2)
        return np.array([[focal, 0, width / 2, 0],
                         [0, focal, height / 2, 0],
                         [0, 0, 0, 1],
                         [0, 0, 1, 0]], np.float64)


@dataclass(frozen=True)
class Scene:
    """A scene and its animation.

    Attributes:
        name: a short identifier. about: one line for `onespp scenes`.
        shapes, camera: what there is.
        frames: default number of frames, numbered from 0. fps: frames a second.
        width, height: default size in pixels.
        max_depth: longest path in segments, camera ray included (2: direct light only),
            as in Mitsuba's `path`.
        environment: radiance of everything that is not a shape: (r, g, b), or an (h, w, 3) image
            by latitude (from +y down) and longitude, or None.
    """

    name: str
    about: str
    shapes: tuple[Shape, ...]
    camera: Camera
    frames: int
    width: int
    height: int
    max_depth: int = 6
    fps: int = 24
    environment: Color | np.ndarray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "shapes", tuple(sorted(self.shapes, key=lambda s: s.name)))
        names = [shape.name for shape in self.shapes]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise SceneError(f"scene '{self.name}' has two shapes named '{twice[0]}'")
        if not names:
            raise SceneError(f"scene '{self.name}' has no shapes")
        for name in ("frames", "width", "height", "max_depth", "fps"):
            if getattr(self, name) < 1:
                raise SceneError(f"scene '{self.name}' has {name} = {getattr(self, name)}: "
                                 "use 1 or more")
        if isinstance(self.environment, np.ndarray):
            shape = self.environment.shape
            if len(shape) != 3 or shape[2] != 3 or not np.isfinite(self.environment).all():
                raise SceneError(f"scene '{self.name}' has an environment image of shape {shape}: "
                                 "use (h, w, 3), all of it finite")
        if self.environment is None and not any(shape.emission for shape in self.shapes):
            raise SceneError(f"scene '{self.name}' has no light: give a shape an emission, "
                             "or the scene an environment")

    @property
    def object_names(self) -> tuple[str, ...]:
        """Shape names in order of their object ID."""
        return tuple(shape.name for shape in self.shapes)

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of what moves, 'camera' first if it does."""
        return (("camera",) if self.camera.moves else ()) + tuple(
            shape.name for shape in self.shapes if shape.moves)
