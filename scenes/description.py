"""What a scene is made of: shapes, materials, lights, a camera, and how they move.

Everything is a pure function of the frame number (a float, so that motion can be sampled
between frames): any frame can be asked for alone, in any order, with the same result. What does
not move is given as a plain matrix, what moves as a function; a renderer updates only the latter.

Materials are Mitsuba BSDF dictionaries in plain Python: colours as (r, g, b) tuples, textures as
nested dictionaries, images as float (h, w, 3) arrays of linear values (8-bit ones become such by
`materials.srgb8`). See `scenes/materials.py`.

What cannot be is refused where it is given, with a SceneError of one sentence. What a function of
the frame returns is checked when it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sized
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from onespp.user_code import said

from . import validity
from .transforms import Matrix, identity
from .validity import SceneError

Color = tuple[float, float, float]
Motion = Callable[[float], Matrix]
Material = Mapping[str, Any]
Radiance = Color | np.ndarray | Mapping[str, Any]

FOV_AXES = ("x", "y", "smaller", "larger")
MOST_FRAMES, LARGEST_SIDE, LONGEST_PATH = 100_000, 16384, 10_000

__all__ = ["Camera", "Color", "Cylinder", "Disk", "Geometry", "Light", "Material", "Mesh",
           "Motion", "Rectangle", "Scene", "SceneError", "Shape", "Sphere"]


LATER = {"later": True}
"""Metadata of a field that older scenes had not: at its default, `fingerprint` leaves it out."""


@dataclass(frozen=True)
class _Analytic:
    """A shape that renderers know by name; flipped: it faces the other way."""

    flipped: bool = field(default=False, metadata=LATER)


@dataclass(frozen=True)
class Sphere(_Analytic):
    """Unit sphere at the origin. Takes uniform scale only."""


@dataclass(frozen=True)
class Rectangle(_Analytic):
    """The square [-1, 1]^2 in the xy plane, facing +z, uv in [0, 1]^2."""


@dataclass(frozen=True)
class Disk(_Analytic):
    """Unit disk in the xy plane, facing +z."""


@dataclass(frozen=True)
class Cylinder(_Analytic):
    """Open unit-radius tube from z = 0 to z = 1, facing outward; x and y take one scale only."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in object space.

    Attributes:
        vertices: (n, 3) float. faces: (m, 3) int, counter-clockwise from outside.
        normals: (n, 3) for smooth shading, None for flat. uv: (n, 2) or None.
        attributes: other data, which materials show by {"type": "mesh_attribute", "name": ...}:
            "vertex_NAME" of vertices, (n, 1) or (n, 3), interpolated between them; "face_NAME" of
            faces, (m, 1) or (m, 3). Colours are linear.

    Raises:
        SceneError: shapes disagree, there is no face, something is not finite, a normal has no
            length, a face names a vertex that is not there, or an attribute has no such name.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    uv: np.ndarray | None = None
    attributes: Mapping[str, np.ndarray] = field(default_factory=dict, metadata=LATER)

    def __post_init__(self) -> None:
        n = len(self.vertices) if isinstance(self.vertices, Sized) else 0
        for name, columns in (("vertices", 3), ("normals", 3), ("uv", 2)):
            array = getattr(self, name)
            if array is not None:
                array = validity.rows(array, f"mesh {name}", n, columns)
                object.__setattr__(self, name, array)
        try:
            faces = np.asarray(self.faces)
        except ValueError:
            raise SceneError("mesh faces are not numbers in rows of 3") from None
        if faces.ndim != 2 or faces.shape[1] != 3 or not np.issubdtype(faces.dtype, np.integer):
            raise SceneError(f"mesh faces have shape {faces.shape} and type {faces.dtype}, "
                             "expected (m, 3) integers")
        if not faces.size:
            raise SceneError("a mesh has no faces: give it at least one triangle, or leave it out")
        if not (faces.min() >= 0 and faces.max() < n):
            odd = faces.min() if faces.min() < 0 else faces.max()
            raise SceneError(f"mesh faces use vertex {odd}, but there are {n} vertices, "
                             "numbered from 0")
        if self.normals is not None:
            used = np.unique(faces)
            without = used[~np.any(self.normals[used], axis=1)]
            if without.size:  # Mitsuba shades what surrounds them with NaN, which shows as black
                raise SceneError(f"mesh normals have no length at {without.size} of {used.size} "
                                 f"vertices, such as {without[0]}: give each a direction, or leave "
                                 "normals out")
        object.__setattr__(self, "faces", faces.astype(np.uint32))
        object.__setattr__(self, "attributes",
                           validity.attributes(self.attributes, n, len(faces)))


Geometry = Sphere | Rectangle | Disk | Cylinder | Mesh


@dataclass(frozen=True)
class Shape:
    """A thing with a name, a place and a surface.

    Attributes:
        name: unique in the scene and stable over frames; object IDs follow the names.
        geometry: what it is, in object space.
        material: a Mitsuba BSDF dictionary.
        world_from_object: a matrix, or a function of the frame number where it moves.
        emission: radiance of an area light: (r, g, b), a number, or a function of the frame
            number that returns one of these; where the geometry is no mesh also an (h, w, 3)
            image over uv, the path of one, or a texture's dictionary.
    """

    name: str
    geometry: Geometry
    material: Material
    world_from_object: Matrix | Motion = field(default_factory=identity)
    emission: float | Radiance | Callable[[float], float | Color] | None = None

    def __post_init__(self) -> None:
        validity.text(self.name, "the name of a shape", 200)
        # Renderers ask for the type itself: what inherits from a Sphere is drawn by nobody.
        if not (isinstance(self.geometry, Mesh)
                or type(self.geometry) in (Sphere, Rectangle, Disk, Cylinder)):
            raise SceneError(f"the geometry of shape '{self.name}' is "
                             f"{validity.brief(self.geometry)}: use Sphere(), Rectangle(), Disk(), "
                             "Cylinder() or a Mesh")
        validity.material(self.material, f"the material of shape '{self.name}'")
        validity.check_attributes(self.material, self.name, self.geometry.attributes if isinstance(
            self.geometry, Mesh) else None)
        if not callable(self.world_from_object):
            place = validity.matrix(self.world_from_object, f"the place of shape '{self.name}'")
            object.__setattr__(self, "world_from_object", place)
        if self.emission is not None and not callable(self.emission):
            radiance = validity.emission(self.emission, f"the emission of shape '{self.name}'")
            object.__setattr__(self, "emission", radiance)

    @property
    def moves(self) -> bool:
        return callable(self.world_from_object)

    def world_from_object_at(self, frame: float) -> Matrix:
        """(4, 4) float64, affine and finite."""
        place = self.world_from_object
        if not callable(place):
            return place
        what = f"the place of '{self.name}' in frame {frame:g}"
        return validity.matrix(_called(place, frame, what), what)

    def emission_at(self, frame: float) -> Radiance | None:
        """Radiance; of a light that changes, (r, g, b)."""
        if not callable(self.emission):
            return self.emission  # type: ignore[return-value]  # checked, no number any more
        what = f"the emission of '{self.name}' in frame {frame:g}"
        radiance = validity.emission(_called(self.emission, frame, what), what)
        if not isinstance(radiance, tuple):
            raise SceneError(f"{what} is a texture: a light that changes has a colour, (r, g, b)")
        return radiance


@dataclass(frozen=True)
class Light:
    """A light that is no shape: it comes from a point or a direction, and no path runs into it.

    Attributes:
        emitter: a Mitsuba dictionary of type "point" (of "intensity"), "spot" (along +z, of
            "intensity", "cutoff_angle", "beam_width" and "texture") or "directional" (along +z, of
            "irradiance").
        world_from_light: where it is; it does not move.
    """

    emitter: Mapping[str, Any]
    world_from_light: Matrix = field(default_factory=identity)

    def __post_init__(self) -> None:
        validity.light(self.emitter, "a light")
        place = validity.matrix(self.world_from_light, "the place of a light")
        object.__setattr__(self, "world_from_light", place)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Attributes:
        world_from_camera: a matrix (see `transforms.look_at`), or a function of the frame.
            Camera space: x right, y down, z forward; a rigid transform (to 1e-4).
        fov: field of view, degrees.
        fov_axis: what it spans: "y" the picture's height, "x" its width, or whichever of the two
            is "smaller" or "larger".
        mirrored: whether the transform may mirror, and with it the picture.
    """

    world_from_camera: Matrix | Motion
    fov: float = 40.0
    fov_axis: str = field(default="y", metadata=LATER)
    mirrored: bool = field(default=False, metadata=LATER)

    def __post_init__(self) -> None:
        fov = validity.number(self.fov, "the camera's field of view")
        if not 0.01 <= fov <= 179:
            raise SceneError(f"the camera's field of view is {self.fov} degrees: use 0.01 to 179")
        if self.fov_axis not in FOV_AXES:
            raise SceneError(f"the camera's fov_axis is {validity.brief(self.fov_axis)}: use "
                             f"{', '.join(FOV_AXES[:-1])} or {FOV_AXES[-1]}")
        if not callable(self.world_from_camera):
            place = validity.rigid(self.world_from_camera, "the place of 'camera'", self.mirrored)
            object.__setattr__(self, "world_from_camera", place)

    @property
    def moves(self) -> bool:
        return callable(self.world_from_camera)

    def world_from_camera_at(self, frame: float) -> Matrix:
        """(4, 4) float64, rigid."""
        place = self.world_from_camera
        if not callable(place):
            return place
        what = f"the place of 'camera' in frame {frame:g}"
        return validity.rigid(_called(place, frame, what), what, self.mirrored)

    def screen_from_camera(self, height: int, width: int) -> Matrix:
        """Projection to pixels: x in [0, w), y in [0, h) down after dividing by depth.

        The third coordinate is 1 / depth, so that the matrix can be inverted.
        """
        spanned = {"y": height, "x": width, "smaller": min(height, width),
                   "larger": max(height, width)}[self.fov_axis]
        focal = 0.5 * spanned / np.tan(np.radians(self.fov) / 2)
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
        environment: radiance of everything that is not a shape: (r, g, b), a number, or an
            (h, w, 3) image by latitude (from +y down) and longitude, or the path of one; or a
            Mitsuba dictionary of type "envmap" (of "filename" or "bitmap"), "constant" or "sunsky",
            which may be turned by "to_world", a matrix; or None.
        lights: those that are no shapes.
    """

    name: str
    about: str
    shapes: tuple[Shape, ...]
    camera: Camera
    frames: int
    width: int
    height: int
    max_depth: int = 6
    fps: float = 24
    environment: float | str | Path | Radiance | None = None
    lights: tuple[Light, ...] = ()

    def __post_init__(self) -> None:
        what = f"scene '{validity.text(self.name, 'the name of a scene', 100)}' has"
        shapes = self.shapes
        if isinstance(shapes, Shape) or not isinstance(shapes, Iterable):
            raise SceneError(f"{what} {validity.brief(type(shapes).__name__)} as its shapes: use a "
                             "tuple of Shape")
        shapes = tuple(shapes)
        for shape in shapes:
            if not isinstance(shape, Shape):
                raise SceneError(f"{what} {validity.brief(shape)} among its shapes: use Shape(...) "
                                 "only, with * before a list of them")
        object.__setattr__(self, "shapes", tuple(sorted(shapes, key=lambda s: s.name)))
        names = [shape.name for shape in self.shapes]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise SceneError(f"scene '{self.name}' has two shapes named '{twice[0]}'")
        if not names:
            raise SceneError(f"scene '{self.name}' has no shapes")
        if not isinstance(self.camera, Camera):
            raise SceneError(f"{what} {validity.brief(self.camera)} as its camera: use Camera(...)")
        if not isinstance(self.about, str) or not (self.about or "-").isprintable():
            raise SceneError(f"{what} about = {validity.brief(self.about)}: use one line of text")
        for name, most in (("frames", MOST_FRAMES), ("width", LARGEST_SIDE),
                           ("height", LARGEST_SIDE), ("max_depth", LONGEST_PATH)):
            value = validity.whole(getattr(self, name), f"{what} {name}", 1, most)
            object.__setattr__(self, name, value)
        fps = validity.number(self.fps, f"{what} fps that")
        if not 1 <= fps <= 1000:
            raise SceneError(f"{what} fps = {self.fps}: use 1 to 1000")
        lights = tuple(self.lights) if isinstance(self.lights, Iterable) else (self.lights,)
        for light in lights:
            if not isinstance(light, Light):
                raise SceneError(f"{what} {validity.brief(light)} among its lights: use Light(...) "
                                 "only")
        object.__setattr__(self, "lights", lights)
        if self.environment is not None:
            around = validity.environment(self.environment,
                                          f"the environment of scene '{self.name}'")
            object.__setattr__(self, "environment", around)
        elif not lights and all(shape.emission is None for shape in self.shapes):
            raise SceneError(f"scene '{self.name}' has no light: give a shape an emission, "
                             "or the scene an environment")

    def try_frames(self, frames: Iterable[float]) -> None:
        """Ask for everything that changes in each of these frames, so that a mistake shows now.

        Raises:
            SceneError: something is not there, is not what it may be, or differs when asked twice.
        """
        changing: list[tuple[str, Callable[[float], Any]]] = [
            *[("the place of 'camera'", self.camera.world_from_camera_at)] * self.camera.moves,
            *((f"the place of '{s.name}'", s.world_from_object_at) for s in self.shapes if s.moves),
            *((f"the emission of '{s.name}'", s.emission_at) for s in self.shapes
              if callable(s.emission))]
        for frame in frames:
            for what, at in changing:
                if not np.array_equal(at(frame), at(frame)):  # as of a random number, or a counter
                    raise SceneError(f"{what} is not the same when frame {frame:g} is asked for "
                                     "twice: let it depend on the frame's number alone (a random "
                                     "one on a seed)")

    @property
    def object_names(self) -> tuple[str, ...]:
        """Shape names in order of their object ID."""
        return tuple(shape.name for shape in self.shapes)

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of what moves, 'camera' first if it does."""
        return (("camera",) if self.camera.moves else ()) + tuple(
            shape.name for shape in self.shapes if shape.moves)


def _called(function: Callable[[float], Any], frame: float, what: str) -> Any:
    """What a function of the frame returns; SceneError where it raises."""
    try:
        return function(frame)
    except (SceneError, MemoryError):
        raise
    except (Exception, SystemExit, GeneratorExit) as error:  # the author's code may raise anything
        raise SceneError(f"{what} raises {said(error)}") from error
