"""Points of meshes that shine as a picture: drawn by the picture where Mitsuba can, else by area.

It picks a place of the picture and asks which face has that uv. Where several have it, only one is
found, and where none in [0, 1]^2 has, none: such a lamp would be too dark. It asks by tracing rays
through a scene of uv, and OptiX cannot trace two scenes in one kernel: there it leaves them out.
"""

from __future__ import annotations

import numpy as np

from onespp.render.host import backend
from onespp.scenes.description import Mesh

from .variant import mi

BY_AREA = "onespp_by_area"
"""Name of the texture that says of its `picture` that it is the same all over."""

_POINTS = 8  # in each face
_OUTSIDE = 1e-6


class _ByArea(mi.Texture):
    """Has an area light draw points by area; each then shines as the picture does there."""

    def __init__(self, properties: mi.Properties) -> None:
        super().__init__(properties)
        self.picture = properties["picture"]

    def is_spatially_varying(self) -> bool:
        return False

    def eval(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Color3f:
        return self.picture.eval(si, active)

    def eval_1(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Float:
        return self.picture.eval_1(si, active)

    def eval_3(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Color3f:
        return self.picture.eval_3(si, active)

    def mean(self) -> mi.Float:
        return self.picture.mean()


mi.register_texture(BY_AREA, _ByArea)


def is_found(mesh: mi.Mesh, geometry: Mesh) -> bool:
    """Whether points may be drawn by the picture: each face is the one that has its uv.

    By some points in each face.
    """
    if geometry.uv is None or mi.variant() == backend.VARIANTS["cuda"]:
        return False
    corners = geometry.uv[geometry.faces]
    if corners.min() < -_OUTSIDE or corners.max() > 1 + _OUTSIDE:
        return False
    weights = np.random.default_rng(0).dirichlet((1, 1, 1), (len(corners), _POINTS))
    uv = np.einsum("fpc,fcd->dfp", weights, corners).reshape(2, -1)
    found = mesh.eval_parameterization(mi.Point2f(uv.astype(np.float32)))
    face = np.repeat(np.arange(len(corners)), _POINTS)
    area = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    told = np.repeat(area > 0, _POINTS)  # a face without an area in the picture gives no light
    right = np.array(found.prim_index)[told] == face[told]
    return bool(right.size and right.mean() > 0.99)  # edges
