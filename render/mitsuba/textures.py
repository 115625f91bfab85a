"""Textures that Mitsuba has not, in dictionaries like its own, and its mesh_attribute made fast.

    {"type": "onespp_product", "factor_0": a, "factor_1": b}      a b; each a texture or a value
    {"type": "onespp_step", "stepped": a, "at_least": threshold}  1 where a is that or more, else 0

They are what glTF makes of a picture with colours of vertices, and of holes whose edge is between
vertices.
A kernel has the same instructions as of a texture of Mitsuba's: Python is asked when it is traced.

Mitsuba's mesh_attribute asks whichever shape was hit, so a kernel has the data of all shapes in
each material that shows any. Sixty meshes of sixty materials took 4.5 s a frame, to record it, and
take 0.1 s where each material asks its own mesh (`Meshes`).
"""

from __future__ import annotations

import itertools
import weakref
from collections.abc import Mapping
from typing import Any

import drjit as dr

from .variant import mi

PRODUCT, STEP = "onespp_product", "onespp_step"
_OF_MESH = "onespp_mesh_attribute"


class Meshes(dict[str, Any]):
    """Meshes of one scene by name, which textures ask for data while it lives.

    A mesh holds its material, and that these textures: they refer back by names alone, for what is
    held in a circle stays, and would be part of later scenes' kernels.
    """

    def __init__(self) -> None:
        super().__init__()
        self._number = next(_numbers)
        _living[self._number] = self

    def material(self, material: Mapping[str, Any], name: str) -> Mapping[str, Any]:
        """A material's dictionary whose mesh_attribute textures ask the mesh of that name; the same
        object where it has none."""
        made = {key: self.material(part, name) if isinstance(part, Mapping) else part
                for key, part in material.items()}
        if made.get("type") == "mesh_attribute":
            return {**made, "type": _OF_MESH, "scene": self._number, "mesh": name}
        return made if any(made[key] is not part for key, part in material.items()) else material


_numbers = itertools.count()
_living: weakref.WeakValueDictionary[int, Meshes] = weakref.WeakValueDictionary()


class _Attribute(mi.Texture):
    """Data of vertices or faces of one mesh; nothing before that mesh is there."""

    def __init__(self, properties: mi.Properties) -> None:
        super().__init__(properties)
        self._name, self._mesh = properties["name"], properties["mesh"]
        self._scale = float(properties.get("scale", 1.0))
        self._meshes = weakref.ref(_living[int(properties["scene"])])

    def _asked(self, form: str, nothing: Any, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Any:
        mesh = (self._meshes() or {}).get(self._mesh)
        if mesh is None:
            return nothing
        return getattr(mesh, form)(self._name, si, active) * self._scale

    def is_spatially_varying(self) -> bool:
        return True

    def eval(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Color3f:
        return self._asked("eval_attribute", mi.Color3f(0), si, active)

    def eval_1(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Float:
        return self._asked("eval_attribute_1", mi.Float(0), si, active)

    def eval_3(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Color3f:
        return self._asked("eval_attribute_3", mi.Color3f(0), si, active)


class _Product(mi.Texture):
    def __init__(self, properties: mi.Properties) -> None:
        super().__init__(properties)
        self._factors = [properties.get_texture(f"factor_{i}") for i in range(2)]

    def is_spatially_varying(self) -> bool:
        return True

    def eval(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Color3f:
        a, b = self._factors
        return a.eval(si, active) * b.eval(si, active)

    def eval_1(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Float:
        a, b = self._factors
        return a.eval_1(si, active) * b.eval_1(si, active)

    def eval_3(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Color3f:
        a, b = self._factors
        return a.eval_3(si, active) * b.eval_3(si, active)


class _Step(mi.Texture):
    def __init__(self, properties: mi.Properties) -> None:
        super().__init__(properties)
        self._stepped = properties.get_texture("stepped")
        self._threshold = float(properties["at_least"])

    def is_spatially_varying(self) -> bool:
        return True

    def eval(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Color3f:
        return mi.Color3f(self.eval_1(si, active))

    def eval_1(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Float:
        return dr.select(self._stepped.eval_1(si, active) >= self._threshold, mi.Float(1), 0)


KINDS = {PRODUCT: _Product, STEP: _Step, _OF_MESH: _Attribute}
NEEDED = {PRODUCT: ("factor_0", "factor_1"), STEP: ("stepped", "at_least")}
for _name, _class in KINDS.items():
    mi.register_texture(_name, _class)
