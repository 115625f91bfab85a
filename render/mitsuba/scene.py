"""A scene description set up as a live Mitsuba scene, set to one frame at a time.

Traps that this file exists for:
- `load_dict` reorders and merges shapes unless `parallel` and `optimize` are off;
- a shape's name may hold a dot (`Cube.001`), which Mitsuba's names may not, hence `_ids`;
- a shape's index in the JIT registry is not its index in the scene, hence `id_from_registry`;
- Mitsuba computes in float32, so everything is placed relative to `origin` (where the camera is
  at frame 0): a scene far from the world's origin renders as well as one at it;
- a ray starts 1.5e-4 (1 + distance from the origin) above its surface, more than a tiny scene is
  wide, so everything is divided by `unit`, a power of two that is 1 but in small scenes;
- at every update Mitsuba turns the normals of balls and cylinders that are mirrored once more, and
  tells the sky of the scene's size before it has taken that anew;
- Mitsuba inverts matrices, so what is scaled to nothing is placed as a dot too small to be hit.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, cast

import drjit as dr
import numpy as np

from onespp.render.host.aligned import owned
from onespp.scenes.description import (
    Cylinder,
    Disk,
    Mesh,
    Rectangle,
    Scene,
    SceneError,
    Shape,
    Sphere,
)
from onespp.scenes.validity import BUFFERS

from . import merged, pictured_lamps, plugins
from .appearance import Appearance
from .boxes import slab_words
from .images import Images, only_mirrors
from .textures import Meshes
from .variant import check_variant, mi

_SMALL = 0.125   # a scene that reaches less far has a unit of its own
_SHEARED = 1e-4  # how far axes may be from perpendicular, as a cosine
_MIRROR = np.diag([-1.0, 1, 1, 1])
_DOT = 1e-7      # half the size of what has none, in stage units

_ANALYTIC = {Sphere: "sphere", Rectangle: "rectangle", Disk: "disk", Cylinder: "cylinder"}


class MitsubaScene:
    """The Mitsuba scene of a description.

    Attributes:
        description: the scene. mi_scene: the live `mi.Scene`, in stage space.
        origin: (3,) float64, world space. unit: a stage unit's length in world units; a point of
            the world is `origin + unit * (its point in stage space)`.
        id_from_registry: UInt32 table, registry index of a shape -> object ID; of a merged one, the
            number of objects plus that of its first face among all merged faces.
        frame: the frame it is set to.

    Raises:
        InputError: another Mitsuba variant was set since, as in a scene's file or a function of it.
    """

    def __init__(self, description: Scene, frame: float = 0) -> None:
        check_variant()
        self.description = description
        self.origin = description.camera.world_from_camera_at(0)[:3, 3].copy()
        self.unit = _unit(description, self.origin)
        self.frame = frame
        self._mirrored = {shape.name: _mirrors(shape.world_from_object_at(frame))
                          for shape in description.shapes}
        self._ids = {name: f"shape_{i:06d}" for i, name in enumerate(description.object_names)}
        self._bsdfs: dict[int, Any] = {}
        self._meshes = Meshes()
        scene: dict[str, Any] = {"type": "scene"}
        together = merged.groups(description)
        alone = {shape.name for shape in description.shapes} - {
            shape.name for group in together for shape in group}
        for shape in description.shapes:
            if shape.name in alone:
                scene[self._ids[shape.name]] = self._load_shape(shape, frame)
        for i, group in enumerate(together):
            scene[f"merged_{i:06d}"] = self._load_merged(f"merged_{i:06d}", group)
        if description.environment is not None:
            scene["environment"] = plugins.environment(
                description.environment, f"the environment of scene '{description.name}'")
        for i, light in enumerate(description.lights):
            scene[f"light_{i:06d}"] = plugins.light(
                light.emitter, self._local(light.world_from_light), self.unit,
                f"light {i} of scene '{description.name}'")
        self.mi_scene = mi.load_dict(scene, parallel=False, optimize=False)
        self._parameters = mi.traverse(self.mi_scene)
        self._by_name = {shape.id(): shape for shape in self.mi_scene.shapes()}
        self.id_from_registry, self._id_from_face = self._registry_table(together)
        self._still = np.stack([shape.world_from_object_at(frame) for shape in description.shapes])
        self._move(frame)  # an updated scene differs from a loaded one by roundings of its rays

    def set_frame(self, frame: float) -> None:
        """Move what moves to where it is at `frame`. Nothing happens if it is there already."""
        if frame != self.frame:
            self._move(frame)

    def _move(self, frame: float) -> None:
        shapes = self.description.shapes
        # The author's code first: where it raises, or sets a variant, nothing has moved.
        places = [(shape, shape.world_from_object_at(frame)) for shape in shapes if shape.moves]
        lights = [(shape, shape.emission_at(frame)) for shape in shapes if callable(shape.emission)]
        check_variant()
        self.frame = float("nan")  # whatever interrupts it: it is at no frame
        for shape, place in places:
            self._place(shape, place)
        for shape, radiance in lights:
            key = f"{self._ids[shape.name]}.emitter.radiance.value"
            self._parameters[key] = dr.opaque(mi.Color3f, radiance)
        self._parameters.update()
        self._set_normals(places)
        if self.mi_scene.environment() is not None:
            self.mi_scene.environment().set_scene(self.mi_scene)
        self.frame = frame

    def _set_normals(self, places: Sequence[tuple[Shape, np.ndarray]]) -> None:
        """Turn those of balls and cylinders as a scene that was loaded so would have them."""
        wrong = []
        for shape, place in places:
            if isinstance(shape.geometry, Sphere | Cylinder):
                is_mirrored = _mirrors(_checked(shape, self._local(place)))
                now = self._by_name[self._ids[shape.name]].has_flipped_normals()
                if now != (shape.geometry.flipped != is_mirrored):
                    wrong.append((shape, place, is_mirrored))
        for shape, place, is_mirrored in wrong:
            self._place(shape, place if is_mirrored else place @ _MIRROR)
        if wrong:
            self._parameters.update()
        if back := [(shape, place) for shape, place, is_mirrored in wrong if not is_mirrored]:
            for shape, place in back:
                self._place(shape, place)
            self._parameters.update()

    @property
    def turned(self) -> tuple[bool, ...]:
        """Of the balls and cylinders that move, whether their normals are turned, at the current
        frame: no array, so that kernels hold it."""
        return tuple(self._by_name[self._ids[shape.name]].has_flipped_normals()
                     for shape in self.description.shapes
                     if shape.moves and isinstance(shape.geometry, Sphere | Cylinder))

    def world_from_image(self) -> np.ndarray:
        """(n, 4, 4) float64 by ID of objects and of their images, at the current frame."""
        return self.images.places(self.frame, self.world_from_object())

    def world_from_object(self) -> np.ndarray:
        """(n, 4, 4) float64 by object ID, at the current frame."""
        places = self._still.copy()
        for i, shape in enumerate(self.description.shapes):
            if shape.moves:
                places[i] = shape.world_from_object_at(self.frame)
        return places

    def stage_from_stage(self, world_from_object: np.ndarray) -> np.ndarray:
        """(n, 4, 4) float64 by object ID: what objects' points at other places move by to here.

        Exactly the identity for an object at rest; NaN for one that was flat there.
        """
        places = self.world_from_object()
        moves = np.tile(np.eye(4), (len(places), 1, 1))
        for i in np.flatnonzero((world_from_object != places).any((1, 2))):
            then, now = world_from_object[i], places[i]
            moves[i] = (np.nan if np.linalg.det(then) == 0
                        else self._local(now) @ np.linalg.inv(self._local(then)))
        return moves

    def object_id(self, registry_index: Any, face: Any) -> mi.Int32:
        """Object IDs of shapes by their index in the JIT registry; 0 is no shape, -1.

        Args:
            face: of the shape, which tells those apart that were built as one.
        """
        valid = registry_index != 0
        number = dr.gather(mi.UInt32, self.id_from_registry, registry_index, valid)
        if self._id_from_face is not None:
            count = len(self.description.shapes)
            of_several = valid & (number >= count)
            number = dr.select(of_several, dr.gather(
                mi.UInt32, self._id_from_face, number - count + face, of_several), number)
        return dr.select(valid, mi.Int32(number), -1)

    def image_id(self, registry_index: Any, face: Any, row: mi.UInt32 | None) -> mi.Int32:
        """`object_id` of what is seen itself, or of its image.

        Args:
            row: of `row_of_images`, None where there are no mirrors.
        """
        number = self.object_id(registry_index, face)
        if row is None:
            return number
        count = len(self.description.shapes)
        return dr.select(number >= 0, number + mi.Int32(row * count), number)

    def row_of_images(self, shape: mi.UInt32, several: mi.Bool) -> mi.UInt32:
        """Which images are seen in a shape, by its registry index, or in several."""
        row = dr.gather(mi.UInt32, self.image_rows, shape, shape != 0)
        return dr.select(several, self.images.in_several, row)

    @cached_property
    def images(self) -> Images:
        """In the shapes that mirror or let light through."""
        names = {identifier: name for name, identifier in self._ids.items()}
        shapes = {_registry_index(shape): shape for shape in self.mi_scene.shapes()}
        return Images(self.description, shapes,
                      {i: names[s.id()] for i, s in shapes.items() if s.id() in names})

    @cached_property
    def image_rows(self) -> mi.UInt32:
        """The rows of `images`, by registry index."""
        return owned(mi.UInt32, self.images.rows)

    @cached_property
    def masks(self) -> mi.UInt32 | None:
        """Which shapes are cut out by masks, by registry index; None if none is."""
        return _where_any(self.images.masks)

    @property
    def tables(self) -> list[Any]:
        """By registry index, and by merged face: all arrays that kernels read of it beside
        `mi_scene`; None where there are none."""
        return [self.id_from_registry, self._id_from_face, self.image_rows, self.masks, self.clear,
                self.bent_glass, *self.appearance.tables]

    @cached_property
    def recordable(self) -> bool:
        """Whether what its kernels read is where it was when a frame is set, or in `tables` and the
        parameters of `mi_scene`: not if a mesh that shines as a picture moves, as Mitsuba then
        traces rays through another scene of its uv (`pictured_lamps.py`)."""
        lamps = [self._by_name[self._ids[shape.name]].emitter() for shape in self.description.shapes
                 if shape.moves and shape.emission is not None and isinstance(shape.geometry, Mesh)]
        return not any(mi.has_flag(lamp.flags(), mi.EmitterFlags.SpatiallyVarying)
                       for lamp in lamps)

    @cached_property
    def bent_glass(self) -> mi.UInt32 | None:
        """`bent` of `images`, None if there is none."""
        return _where_any(self.images.bent)

    @cached_property
    def clear(self) -> mi.UInt32 | None:
        """Which shapes let light straight through, by registry index; None if none does."""
        return _where_any(self.images.clear)

    def flat_mirrors(self) -> tuple[np.ndarray, np.ndarray]:
        """Registry indices (m,) uint32 of flat mirrors and panes, and (m, 4) their planes (n, d),
        n . x = d in the stage, at the current frame."""
        found = self.images.flat_planes(self.frame)
        point, normal = (found[:, 0] - self.origin) / self.unit, found[:, 1]
        distance = (point * normal).sum(-1, keepdims=True)
        return (np.array(self.images.flat, np.uint32),
                np.concatenate([normal, distance], -1).astype(np.float32))

    def balls(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Registry indices (m,) uint32 of smooth balls, (m, 4) their centres and radii in the
        stage, at the current frame, and (m,) indices of refraction, 0 for metal; radii are 0 of
        what does not count."""
        places = self.images.balls(self.frame)
        places[:, :3] -= self.origin
        return (np.array(self.images.round, np.uint32), (places / self.unit).astype(np.float32),
                self.images.index)

    def slabs(self) -> tuple[np.ndarray, np.ndarray]:
        """Registry indices (m,) uint32 of boxes of glass, and (m, 17) their words in the stage, at
        the current frame, of `tracer/lights/slabs.py`."""
        boxes = self.images.boxes(self.frame)
        boxes[:, 0] -= self.origin
        words = slab_words(boxes / self.unit, self.images.slab_index)
        return np.array(self.images.slabs, np.uint32), words

    @cached_property
    def appearance(self) -> Appearance:
        """What its materials say of themselves."""
        return Appearance({_registry_index(s): s.bsdf() for s in self.mi_scene.shapes()})

    @property
    def glossy(self) -> bool:
        """Whether light is left that some material reflects, or lets pass, in a lobe of its own.

        Not of mirrors: what they show is looked for there (`images`).
        """
        return any(mi.has_flag(shape.bsdf().flags(), lobe) for shape in self.mi_scene.shapes()
                   if not only_mirrors(shape)
                   for lobe in (mi.BSDFFlags.Glossy, mi.BSDFFlags.Delta))

    def sensor(self, height: int, width: int) -> mi.Sensor:
        """Mitsuba's own pinhole camera at the same place, for comparisons with its integrators."""
        camera = self.description.camera
        # Mitsuba's camera has x to the left and y up, and no scale.
        world_from_sensor = self._local(camera.world_from_camera_at(self.frame)) @ np.diag(
            [-self.unit, -self.unit, self.unit, 1.0])
        return mi.load_dict({
            "type": "perspective", "fov": camera.fov, "fov_axis": camera.fov_axis,
            "near_clip": 1e-4, "far_clip": 1e6,
            "to_world": mi.ScalarTransform4f(world_from_sensor.tolist()),
            "film": {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb",
                     "rfilter": {"type": "box"}},
        })

    def _local(self, matrix: np.ndarray) -> np.ndarray:
        """The same transform into stage space."""
        local = matrix.copy()
        local[:3, 3] -= self.origin
        local[:3] /= self.unit
        return local

    def _load_shape(self, shape: Shape, frame: float) -> Any:
        emission = shape.emission_at(frame)
        parts = {"bsdf": self._bsdf(shape, self._ids[shape.name])}
        if emission is not None:
            parts["emitter"] = plugins.area_light(emission, f"the emission of shape '{shape.name}'")
        local = self._local(shape.world_from_object_at(frame))
        if isinstance(shape.geometry, Mesh):
            return self._load_mesh(shape, local, parts)
        return {"type": _ANALYTIC[type(shape.geometry)], "flip_normals": shape.geometry.flipped,
                "to_world": mi.ScalarTransform4f(_checked(shape, local).tolist()), **parts}

    def _bsdf(self, shape: Shape, name: str) -> Any:
        """What a shape is made of; shapes that have one material have one BSDF.

        name: of its mesh, whose data a material may show: then the BSDF is its own.
        """
        what = f"the material of shape '{shape.name}'"
        own = self._meshes.material(shape.material, name)
        if own is not shape.material:
            return plugins.bsdf(own, what)
        key = id(shape.material)  # alive as long as the description is
        if key not in self._bsdfs:
            self._bsdfs[key] = plugins.bsdf(shape.material, what)
        return self._bsdfs[key]

    def _load_mesh(self, shape: Shape, local: np.ndarray, parts: dict[str, Any]) -> mi.Mesh:
        geometry = shape.geometry
        assert isinstance(geometry, Mesh)
        buffers = _buffers(geometry, local)
        mesh = self._built(self._ids[shape.name], buffers, parts)
        emitter = parts.get("emitter")
        if (emitter is not None
                and mi.has_flag(emitter.flags(), mi.EmitterFlags.SpatiallyVarying)
                and not pictured_lamps.is_found(mesh, geometry)):
            parts["emitter"] = plugins.area_light(
                shape.emission_at(0), f"the emission of shape '{shape.name}'", by_area=True)
            return self._built(self._ids[shape.name], buffers, parts)
        return mesh

    def _load_merged(self, name: str, group: Sequence[Shape]) -> mi.Mesh:
        """Still meshes of one material as one."""
        return self._built(name, merged.joined([
            _buffers(cast(Mesh, shape.geometry), self._local(shape.world_from_object_at(0)))
            for shape in group]), {"bsdf": self._bsdf(group[0], name)})

    def _built(self, name: str, buffers: dict[str, np.ndarray], parts: dict[str, Any]) -> mi.Mesh:
        properties = mi.Properties()
        for key, part in parts.items():
            properties[key] = part
        mesh = mi.Mesh(name, len(buffers["vertex_positions"]), len(buffers["faces"]), properties,
                       "vertex_normals" in buffers, "vertex_texcoords" in buffers)
        for key, value in buffers.items():
            if key not in BUFFERS and key != "faces":
                mesh.add_attribute(key, value.shape[1], [0.0] * value.size)
        parameters = mi.traverse(mesh)
        for key, value in buffers.items():
            parameters[key] = _jit(value)
        parameters.update()
        self._meshes[name] = mesh
        return mesh

    def _place(self, shape: Shape, world_from_object: np.ndarray) -> None:
        local = self._local(world_from_object)
        if isinstance(shape.geometry, Mesh):
            mirrored = _mirrors(local)
            placed = _placed(shape.geometry, local)
            if mirrored == self._mirrored[shape.name]:
                del placed["faces"]
            self._mirrored[shape.name] = mirrored
            for key, value in placed.items():
                self._parameters[f"{self._ids[shape.name]}.{key}"] = _jit(value)
        else:
            to_world = mi.Transform4f(_checked(shape, local).tolist())
            dr.make_opaque(to_world)  # else what a shape derives of it is literals in the kernel
            self._parameters[f"{self._ids[shape.name]}.to_world"] = to_world

    def _registry_table(self, together: Sequence[Sequence[Shape]],
                        ) -> tuple[mi.UInt32, mi.UInt32 | None]:
        """`id_from_registry`; and the object ID of each merged face, None where there are none."""
        registry_index = {s.id(): _registry_index(s) for s in self.mi_scene.shapes()}
        table = np.zeros(max(registry_index.values()) + 1, np.uint32)
        names = self.description.object_names
        for object_id, name in enumerate(names):
            if (index := registry_index.get(self._ids[name])) is not None:
                table[index] = object_id
        if not together:
            return owned(mi.UInt32, table), None
        number = {name: object_id for object_id, name in enumerate(names)}
        faces: list[np.ndarray] = []
        start = len(names)
        for i, group in enumerate(together):
            table[registry_index[f"merged_{i:06d}"]] = start
            for shape in group:
                count = len(cast(Mesh, shape.geometry).faces)
                faces.append(np.full(count, number[shape.name], np.uint32))
                start += count
        return owned(mi.UInt32, table), owned(mi.UInt32, np.concatenate(faces))


def _where_any(marks: np.ndarray) -> mi.UInt32 | None:
    """Marks of shapes by registry index, None where none is marked."""
    return owned(mi.UInt32, marks) if marks.any() else None


def _registry_index(shape: Any) -> int:
    return int(cast(Any, dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape)))[0])


def _mirrors(matrix: np.ndarray) -> bool:
    return bool(np.linalg.det(matrix[:3, :3]) < 0)


def _unit(description: Scene, eye: np.ndarray) -> float:
    """The power of two nearest to how far things reach from the camera at frame 0 (median)."""
    reach = []
    for shape in description.shapes:
        place = shape.world_from_object_at(0)
        mesh = shape.geometry.vertices if isinstance(shape.geometry, Mesh) else np.eye(3)
        points = mesh @ place[:3, :3].T + place[:3, 3]
        reach.append(np.linalg.norm(points - eye, axis=1).max())
    typical = float(np.median(reach))
    return 2.0**round(np.log2(typical)) if 0 < typical < _SMALL else 1.0


def _checked(shape: Shape, matrix: np.ndarray) -> np.ndarray:
    """The matrix, if Mitsuba's analytic shapes can take it; a dot, if it leaves no size."""
    if np.abs(matrix[:3, :3]).max() < _DOT:
        matrix = matrix.copy()
        matrix[:3, :3] = _DOT * np.eye(3)
    elif np.linalg.det(matrix[:3, :3]) == 0:
        raise SceneError(f"shape '{shape.name}' is a {type(shape.geometry).__name__} that its "
                         "matrix flattens: scale all its axes by more than 0, or use a mesh")
    if isinstance(shape.geometry, Sphere | Cylinder):
        sizes = np.linalg.norm(matrix[:3, :3], axis=0)
        round_ = sizes[:2] if isinstance(shape.geometry, Cylinder) else sizes
        if round_.max() > round_.min() * (1 + 1e-6):
            raise SceneError(f"shape '{shape.name}' is a {type(shape.geometry).__name__} with "
                             f"non-uniform scale {np.round(sizes, 4).tolist()}: use a mesh")
        axes = matrix[:3, :3] / sizes
        if abs(axes.T @ axes - np.eye(3)).max() > _SHEARED:
            raise SceneError(f"shape '{shape.name}' is a {type(shape.geometry).__name__} that its "
                             "matrix shears: use a mesh")
    return matrix


def _placed(mesh: Mesh, matrix: np.ndarray) -> dict[str, np.ndarray]:
    """A mesh's positions, faces and normals after a transform computed in float64."""
    linear = matrix[:3, :3]
    faces = mesh.faces[:, ::-1] if _mirrors(matrix) else mesh.faces
    placed = {"vertex_positions": mesh.vertices @ linear.T + matrix[:3, 3],
              "faces": np.asarray(faces, np.uint32)}
    if mesh.normals is not None:
        normals = mesh.normals @ _cofactors(linear).T * (-1 if _mirrors(matrix) else 1)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        placed["vertex_normals"] = normals / np.where(lengths > 0, lengths, 1)
    return placed


def _buffers(mesh: Mesh, matrix: np.ndarray) -> dict[str, np.ndarray]:
    """All buffers of a mesh at a place."""
    own = dict(mesh.attributes) | ({} if mesh.uv is None else {"vertex_texcoords": mesh.uv})
    return own | _placed(mesh, matrix)


def _cofactors(linear: np.ndarray) -> np.ndarray:
    """det(A) A^-T, which a matrix that cannot be inverted has too."""
    a, b, c = linear.T / max(np.abs(linear).max(), 1e-300)  # of any size: no under- or overflow
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)


def _jit(array: np.ndarray) -> mi.Float | mi.UInt32:
    if array.dtype == np.uint32:
        return owned(mi.UInt32, array)
    return owned(mi.Float, array.astype(np.float32))
