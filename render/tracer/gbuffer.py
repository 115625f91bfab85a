"""The G-buffer: what the primary hit says about the visible surface.

One function a channel of `render/channels.py`; only those asked for are computed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr

from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi


@dataclass
class PrimaryHit:
    """The first hit of a camera ray. `si` is in the stage's space."""

    stage: MitsubaScene
    si: mi.SurfaceInteraction3f
    depth_per_length: mi.Float


def albedo(hit: PrimaryHit) -> mi.Color3f:
    """Diffuse reflectance, 1 where there is no diffuse lobe: a divisor of light."""
    return hit.stage.appearance.albedo(hit.si)


def normal(hit: PrimaryHit) -> mi.Vector3f:
    """Shading normal, turned to the side that the camera sees (by the geometric normal)."""
    return hit.stage.appearance.normal(hit.si)


def position(hit: PrimaryHit) -> mi.Vector3f:
    origin = mi.Vector3f(*(dr.opaque(mi.Float, value) for value in hit.stage.origin.tolist()))
    unit = dr.opaque(mi.Float, hit.stage.unit)
    return dr.select(hit.si.is_valid(), dr.fma(mi.Vector3f(hit.si.p), unit, origin), 0)


def depth(hit: PrimaryHit) -> mi.Float:
    return dr.select(hit.si.is_valid(), hit.si.t * hit.depth_per_length, 0)


def object_id(hit: PrimaryHit) -> mi.Int32:
    return hit.stage.object_id(dr.reinterpret_array(mi.UInt32, hit.si.shape), hit.si.prim_index)


def roughness(hit: PrimaryHit) -> mi.Float:
    return hit.stage.appearance.roughness(hit.si)


GBUFFER: dict[str, Callable[[PrimaryHit], mi.Float | mi.Vector3f | mi.Color3f | mi.Int32]] = {
    "albedo": albedo,
    "normal": normal,
    "position": position,
    "depth": depth,
    "id": object_id,
    "roughness": roughness,
}
