"""The G-buffer: what the primary hit says about the visible surface.

One function a channel of `render/channels.py`; only those asked for are computed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import drjit as dr

from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi

from .replacement import Replaced


@dataclass
class PrimaryHit:
    """The first hit of a camera ray. `si` is in the stage's space.

    behind: if it may be behind mirrors; then `ray` is the camera's, and what is told is of its
    image.
    """

    stage: MitsubaScene
    ray: mi.Ray3f
    si: mi.SurfaceInteraction3f
    depth_per_length: mi.Float
    behind: Replaced | None = None

    @cached_property
    def layer(self) -> PrimaryHit:
        """What the brightest layer left aside comes to."""
        assert self.behind is not None
        layer = self.behind.layer
        return PrimaryHit(self.stage, self.ray, layer.pi.compute_surface_interaction(layer.ray),
                          self.depth_per_length, layer)


def albedo(hit: PrimaryHit) -> mi.Color3f:
    """Diffuse reflectance, 1 where there is no diffuse lobe: a divisor of light.

    In mirrors it is what is left of it.
    """
    value = hit.stage.appearance.albedo(hit.si)
    if hit.behind is None:
        return value
    left = dr.minimum(hit.behind.throughput, 1)
    if hit.behind.opacity is not None:
        left *= hit.behind.opacity
    return dr.select(dr.all(value == 1), value, value * left)


def normal(hit: PrimaryHit) -> mi.Vector3f:
    """Shading normal, turned to the side that the camera sees (by the geometric normal)."""
    value = hit.stage.appearance.normal(hit.si)
    return value if hit.behind is None else hit.behind.unfolded(value)


def position(hit: PrimaryHit) -> mi.Vector3f:
    origin = mi.Vector3f(*(dr.opaque(mi.Float, value) for value in hit.stage.origin.tolist()))
    unit = dr.opaque(mi.Float, hit.stage.unit)
    p = hit.si.p
    if hit.behind is not None:
        p = dr.select(hit.behind.before > 0, hit.ray(hit.behind.length), p)
    return dr.select(hit.si.is_valid(), dr.fma(mi.Vector3f(p), unit, origin), 0)


def depth(hit: PrimaryHit) -> mi.Float:
    length = hit.si.t if hit.behind is None else hit.behind.length
    return dr.select(hit.si.is_valid(), length * hit.depth_per_length, 0)


def object_id(hit: PrimaryHit) -> mi.Int32:
    return hit.stage.image_id(dr.reinterpret_array(mi.UInt32, hit.si.shape), hit.si.prim_index,
                              hit.behind and hit.behind.row(hit.stage))


def roughness(hit: PrimaryHit) -> mi.Float:
    """Alpha; 0 too where the only specular light is an image: a layer's, but no mask's own."""
    value = hit.stage.appearance.roughness(hit.si)
    if hit.behind is None or hit.behind.other is None:
        return value
    other = hit.behind.other
    is_image = dr.max(other.throughput) > 0
    if other.opacity is not None:
        is_image &= other.opacity == 1
    return dr.select((value == 1) & is_image, 0, value)


def layer_share(hit: PrimaryHit) -> mi.Float:
    assert hit.behind is not None
    return hit.behind.layer_share


GBUFFER: dict[str, Callable[[PrimaryHit], mi.Float | mi.Vector3f | mi.Color3f | mi.Int32]] = {
    "albedo": albedo,
    "normal": normal,
    "position": position,
    "depth": depth,
    "id": object_id,
    "roughness": roughness,
    "layer_share": layer_share,
    "layer_albedo": lambda hit: albedo(hit.layer),
    "layer_normal": lambda hit: normal(hit.layer),
    "layer_depth": lambda hit: depth(hit.layer),
    "layer_id": lambda hit: object_id(hit.layer),
}
