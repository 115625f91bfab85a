"""Whether Mitsuba finds all the light of a picture on a mesh.

It picks a place of the picture and asks which face has that uv. Where several have it, only one is
found, and where none in [0, 1]^2 has, none: such a lamp is too dark.
"""

from __future__ import annotations

import numpy as np

from onespp.scenes.description import Mesh

from .variant import mi

_POINTS = 8  # in each face
_OUTSIDE = 1e-6


def is_found(mesh: mi.Mesh, geometry: Mesh) -> bool:
    """Whether each face of a mesh is the one that has its uv, by some points in each."""
    if geometry.uv is None:
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
