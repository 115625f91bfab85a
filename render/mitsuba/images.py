"""Images in mirrors and glass: which shapes show others in them, and how what they show moves.

Primary surface replacement shows, where there is a mirror or clear glass, the first surface behind
it that scatters light, at the place of its image (`render/tracer/replacement.py`). An object's
image in a mirror is an object of its own: it has an ID, and a matrix that says how it moves. With
the object's place M_o and the mirror's A at a frame, that matrix is

    R M_o    in a flat mirror, R being the reflection in its plane, which A moves: exact;
    A        in any other, and in bent glass: what they show moves with them, nearly, if small;
    1        in one after another, and in those that have no row of their own.

(Behind a pane an object is where it is: that is no image.) So whoever reprojects by matrices
follows images as they follow objects, and needs to know nothing of mirrors.

Source: primary surface replacement, as in Zimmer et al. 2015, "Path-space motion estimation and
decomposition for robust animation filtering"; that images are objects is our own.
"""

from __future__ import annotations

from collections.abc import Mapping

import drjit as dr
import numpy as np

from onespp.render.host.aligned import owned
from onespp.scenes.description import Disk, Mesh, Rectangle, Scene, Shape, Sphere

from .appearance import nested
from .boxes import half_edges
from .variant import mi

_CLEAR = ("SmoothConductor", "SmoothDielectric", "ThinDielectric", "Null")
_AROUND = ("TwoSidedBRDF", "NormalMap", "BumpMap")
_STRAIGHT_ON = ("Null", "MaskBSDF", "ThinDielectric")
_FLAT_SHAPES = ("Rectangle", "Disk")
_THROUGH = +mi.BSDFFlags.DeltaTransmission | +mi.BSDFFlags.Null
MOST = 16  # shapes whose images have matrices of their own, the largest ones,
MOST_IMAGES = 2048  # of objects, in all of them
_FLAT = 1e-5  # a mesh's thickness, as a share of its size
_STRAIGHT = 1e-3  # difference of the normals of a flat mesh


class Images:
    """Those of a scene.

    Attributes:
        rows: (registry indices) uint32, which row of images is in a shape, from 1; 0: none.
        masks: (registry indices) uint32, 1 for shapes cut out by a mask. clear: the same, for those
            that let light straight through. bent: the same, for glass that is no pane.
        flat: registry indices of flat mirrors that nothing but their shape bends, and then of flat
            panes without thickness, which mirror as well. round: of smooth spheres, of metal or
            denser than what is around. index: (round,) of refraction, 0: none.
        slabs: of boxes of smooth glass without maps. slab_index: (slabs,) of refraction.
        in_several: the row of what is seen in one after another. layered: whether anything lets
            light through.

    Args:
        shapes: Mitsuba's, by registry index. names: of those that are one object each.
    """

    def __init__(self, scene: Scene, shapes: Mapping[int, mi.Shape],
                 names: Mapping[int, str]) -> None:
        self._scene = scene
        by_name = {shape.name: shape for shape in scene.shapes}
        found = [index for index, shape in shapes.items() if is_clear(shape)]
        by_size = sorted((i for i in found if i in names),
                         key=lambda i: (-_area(shapes[i]), names[i]))
        most = min(MOST, MOST_IMAGES // len(scene.shapes))
        listed = sorted(by_size[:most], key=names.__getitem__)
        self._mirrors = [by_name[names[i]] for i in listed]
        self._planes = [_plane(shape) for shape in self._mirrors]
        flat = [(index, mirror, plane) for is_so in (_is_plain, _is_pane) for index, mirror, plane
                in zip(listed, self._mirrors, self._planes)
                if plane is not None and is_so(shapes[index].bsdf())]
        self.flat = [index for index, *_ in flat]
        self._flat = [(mirror, plane) for _, mirror, plane in flat]
        round_ = [(index, mirror, _of_refraction(shapes[index].bsdf())) for index, mirror
                  in zip(listed, self._mirrors)
                  if isinstance(mirror.geometry, Sphere) and not mirror.geometry.flipped]
        round_ = [(index, ball, eta) for index, ball, eta in round_ if eta is not None]
        self.round, self._round = [i for i, *_ in round_], [ball for _, ball, _ in round_]
        self.index = np.array([eta for *_, eta in round_], np.float32)
        slabs = [(index, mirror, edges, eta) for index, mirror in zip(listed, self._mirrors)
                 if (eta := _of_refraction(shapes[index].bsdf()))
                 and (edges := half_edges(mirror.geometry)) is not None]
        self.slabs = [index for index, *_ in slabs]
        self._slabs = [(slab, edges) for _, slab, edges, _ in slabs]
        self.slab_index = np.array([eta for *_, eta in slabs], np.float32)
        indices = np.arange(max(shapes) + 1)
        self.masks, self.clear, self.bent = (
            np.isin(indices, those).astype(np.uint32) for those in (
                [i for i, shape in shapes.items() if _is_mask(shape)],
                [i for i, shape in shapes.items() if _lets_through(shape.bsdf())],
                [i for i in found if _is_bent_glass(shapes[i])]))
        self.layered = bool(self.masks.any()) or any(not only_mirrors(shapes[i]) for i in found)
        self.in_several = len(listed) + 1
        self.rows = np.zeros(max(shapes) + 1, np.uint32)
        self.rows[found] = self.in_several
        self.rows[listed] = 1 + np.arange(len(listed))

    @property
    def any(self) -> bool:
        """Whether there is anything that primary surfaces can be behind."""
        return self.layered or self._are_there

    @property
    def _are_there(self) -> bool:
        return bool(self.rows.any())

    def names(self) -> tuple[str, ...]:
        """Of objects and then of their images, mirror by mirror, in order of ID."""
        objects = self._scene.object_names
        if not self._are_there:
            return objects
        mirrors = [mirror.name for mirror in self._mirrors]
        names = [*objects, *(f"{name} in {mirror}" for mirror in mirrors for name in objects),
                 *(f"{name} in several" for name in objects)]
        taken: set[str] = set()
        for i, name in enumerate(names):
            while name in taken:
                name += "'"
            names[i] = name
            taken.add(name)
        return tuple(names)

    def moving(self) -> tuple[str, ...]:
        """Those of `names` that have matrices which change."""
        shapes = self._scene.shapes
        moves = [shape.moves for shape in shapes]
        if self._are_there:
            for mirror, plane in zip(self._mirrors, self._planes):
                moves += [mirror.moves or (plane is not None and shape.moves) for shape in shapes]
            moves += [False] * len(shapes)
        return tuple(name for name, is_so in zip(self.names(), moves, strict=True) if is_so)

    def numbered(self, shapes: np.ndarray, count: np.ndarray | bool = True) -> mi.UInt32:
        """By registry index, which of some shapes it is, from 1, if it counts; 0: none."""
        rows = np.zeros(len(self.rows), np.uint32)
        rows[shapes] = np.where(count, 1 + np.arange(len(shapes)), 0)
        return owned(mi.UInt32, rows)

    def flat_planes(self, frame: float) -> np.ndarray:
        """(n, 2, 3) a point and the unit normal of each of `flat`, world space."""
        return np.array([_plane_at(mirror.world_from_object_at(frame), *plane)
                         for mirror, plane in self._flat]).reshape(-1, 2, 3)

    def balls(self, frame: float) -> np.ndarray:
        """(n, 4) centre and radius of each of `round`, world space; 0 where a matrix mirrors one,
        as Mitsuba turns its normals inside out then."""
        places = [ball.world_from_object_at(frame) for ball in self._round]
        return np.array([[*place[:3, 3], np.linalg.norm(place[:3, 0])
                          * (np.linalg.det(place[:3, :3]) > 0)]
                         for place in places]).reshape(-1, 4)

    def boxes(self, frame: float) -> np.ndarray:
        """(n, 4, 3) centre and half edges of each of `slabs`, world space."""
        boxes = []
        for slab, edges in self._slabs:
            place = slab.world_from_object_at(frame)
            boxes.append(np.vstack([edges[0] @ place[:3, :3].T + place[:3, 3],
                                    edges[1:] @ place[:3, :3].T]))
        return np.array(boxes).reshape(-1, 4, 3)

    def places(self, frame: float, world_from_object: np.ndarray) -> np.ndarray:
        """(n, 4, 4) of the objects -> those of objects and images, by ID, float64."""
        if not self._are_there:
            return world_from_object
        places = [world_from_object]
        for mirror, plane in zip(self._mirrors, self._planes):
            at = mirror.world_from_object_at(frame)
            if plane is None:
                places.append(np.broadcast_to(at, world_from_object.shape))
            else:
                places.append(_reflection(at, *plane) @ world_from_object)
        places.append(np.broadcast_to(np.eye(4), world_from_object.shape))
        return np.concatenate(places)


def only_mirrors(shape: mi.Shape) -> bool:
    """Whether a surface reflects in one direction, and does nothing else."""
    return is_clear(shape) and not _lobes(shape) & _THROUGH


def is_clear(shape: mi.Shape) -> bool:
    """Whether a surface reflects and lets through in one direction each, and does nothing else.

    Of what Mitsuba has, those whose lobes can be asked for one by one (not blends, nor masks).
    """
    return not shape.is_emitter() and _only(shape.bsdf(), _CLEAR)


def shape_index(shape: mi.ShapePtr, active: mi.Bool) -> mi.UInt32:
    """Index in the JIT registry, 0 where not `active`."""
    return dr.select(active, dr.reinterpret_array(mi.UInt32, shape), 0)


def _is_bent_glass(shape: mi.Shape) -> bool:
    """Whether a clear surface refracts, and is not flat or of flat faces."""
    lobes = _lobes(shape)
    if not lobes & +mi.BSDFFlags.DeltaTransmission or lobes & +mi.BSDFFlags.Null:
        return False
    if shape.class_name() in _FLAT_SHAPES:  # (a rectangle says that it is a mesh)
        return False
    if not shape.is_mesh():
        return True
    if not shape.has_vertex_normals():
        return False
    params = mi.traverse(shape)
    normals = np.asarray(params["vertex_normals"]).reshape(-1, 3)
    of_faces = normals[np.asarray(params["faces"]).reshape(-1, 3)]
    return bool(np.ptp(of_faces, axis=1).max(initial=0) > _STRAIGHT)


def _lets_through(bsdf: mi.BSDF) -> bool:
    """Whether light goes straight on through a surface, by as much as the material tells when it is
    asked (a normal map of a mask does not)."""
    if not bsdf.flags() & +mi.BSDFFlags.Null:
        return False
    kind = bsdf.class_name()
    return kind in _STRAIGHT_ON or (kind == "BlendBSDF" and all(
        _lets_through(part) or not part.flags() & +mi.BSDFFlags.Null for part in nested(bsdf)))


def _is_plain(bsdf: mi.BSDF) -> bool:
    """Whether a surface mirrors in its own plane, without maps."""
    kind = bsdf.class_name()
    return kind == "SmoothConductor" or (kind == "TwoSidedBRDF" and all(map(_is_plain,
                                                                            nested(bsdf))))


def _is_pane(bsdf: mi.BSDF) -> bool:
    """Whether a surface is glass without thickness, without maps."""
    return bsdf.class_name() == "ThinDielectric"


def _of_refraction(bsdf: mi.BSDF) -> float | None:
    """Index of glass that is denser than what is around it, 0 of a mirror; None of others."""
    if bsdf.class_name() != "SmoothDielectric":
        return 0.0 if _is_plain(bsdf) else None
    eta = float(mi.traverse(bsdf)["eta"])
    return eta if eta > 1 else None


def _is_mask(shape: mi.Shape) -> bool:
    return shape.bsdf().class_name() == "MaskBSDF" and not shape.is_emitter()


def _only(bsdf: mi.BSDF, kinds: tuple[str, ...]) -> bool:
    kind = bsdf.class_name()
    return kind in kinds or (kind in _AROUND and all(_only(part, kinds) for part in nested(bsdf)))


def _lobes(shape: mi.Shape) -> int:
    return shape.bsdf().flags() & +mi.BSDFFlags.All


def _area(shape: mi.Shape) -> float:
    return float(np.asarray(shape.surface_area()).ravel()[0])


def _plane(shape: Shape) -> tuple[np.ndarray, np.ndarray] | None:
    """A point and the normal, in object space, of a flat shape; None of another."""
    if isinstance(shape.geometry, Rectangle | Disk):
        return np.zeros(3), np.array([0.0, 0.0, 1.0])
    if not isinstance(shape.geometry, Mesh):
        return None
    vertices, normals = shape.geometry.vertices, shape.geometry.normals
    middle = vertices.mean(axis=0)
    _, sizes, axes = np.linalg.svd(vertices - middle, full_matrices=False)
    is_flat = len(sizes) == 3 and sizes[2] <= _FLAT * sizes[0]
    is_bent = normals is not None and np.ptp(normals, axis=0).max() > _STRAIGHT
    return (middle, axes[2]) if is_flat and not is_bent else None


def _reflection(world_from_object: np.ndarray, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(4, 4) in the plane that a shape's matrix takes its plane to; of no plane, the identity."""
    moved = np.eye(4)
    point, n = _plane_at(world_from_object, point, normal)
    moved[:3, :3] -= 2 * np.outer(n, n)
    moved[:3, 3] = 2 * n * (n @ point)
    return moved


def _plane_at(world_from_object: np.ndarray, point: np.ndarray,
              normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A point and the unit normal of the plane that a matrix takes a plane to; 0 for no plane."""
    linear = world_from_object[:3, :3]
    a, b = np.linalg.svd(normal[None])[2][1:]  # along the plane
    n = np.cross(linear @ a, linear @ b)
    length = np.linalg.norm(n)
    return linear @ point + world_from_object[:3, 3], n / length if length > 0 else 0 * n
