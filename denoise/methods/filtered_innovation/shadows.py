"""What each pixel's rays say: how its shadow moves, how soft that is, what is near, and whether
what it reflects moves."""

# pyright: standard
from __future__ import annotations

from typing import NamedTuple

import drjit as dr

from onespp.denoise.filters.contact import Contact, contact_samples, dark_in_slits
from onespp.denoise.filters.penumbra import PenumbraSample, left_in_hard_shadow, penumbra_samples
from onespp.denoise.history.reflections import image_motion
from onespp.denoise.history.shadow_motion import ShadowMotion, shadow_motion
from onespp.denoise.inputs.path_hits import Hits
from onespp.denoise.inputs.shadow_rays import ShadowRays, stopped
from onespp.denoise.inputs.signals import Chosen, Signal, Signals
from onespp.denoise.inputs.surface import SurfaceSample
from onespp.denoise.jit.arrays import Color, Float, Vector3
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.structure import mapped
from onespp.denoise.jit.vector import dot, transform


class Shadows(NamedTuple):
    """What shadow rays tell of each pixel, or means over the pixels around."""

    motion: ShadowMotion
    rests: Float
    penumbra: PenumbraSample


class Surroundings(NamedTuple):
    """What the rays of each pixel met, of each light, or means over the pixels around; image: of
    `reflections.image_motion`, None where nothing is glossy."""

    shadows: list[Shadows]
    contact: Contact | None
    image: Float | None = None


def follow_shadows(stencil: Stencil, rays: ShadowRays, surface: SurfaceSample,
                   position: Vector3) -> Shadows:
    """`shadow_motion` and `penumbra_samples` of each pixel; arguments as of the former."""
    blocked, scale = stopped(rays, surface.id)
    light = transform(rays.camera_from_world, rays.ray.light)
    cosine = dr.abs(dot(surface.normal, light)) * scale
    return Shadows(*shadow_motion(stencil, rays, surface, position),
                   penumbra_samples(stencil, blocked, rays.ray.blocker_distance * scale, cosine,
                                    rays.ray.light_id, surface.depth, focal_length(rays),
                                    rays.light_sizes))


def focal_length(rays: ShadowRays) -> Float:
    """Pixels of a unit length at depth 1."""
    return dr.abs(rays.screen_from_camera.x.x)


def look_around(stencil: Stencil, rays: ShadowRays, hits: Hits, chosen: Chosen | None,
                groups: int, surface: SurfaceSample, position: Vector3,
                roughness: Float | None) -> Surroundings:
    """What each pixel knows; arguments as of `of_each_light`, `shadow_motion`, `contact_samples`.
    """
    blocked, _ = stopped(rays, surface.id)
    image = None
    if roughness is not None:
        image = image_motion(stencil, hits, roughness, surface.normal, position)
    return Surroundings(
        of_each_light(follow_shadows(stencil, rays, surface, position), chosen, groups),
        contact_samples(blocked, rays.ray.blocker_distance, hits.distance,
                        focal_length(rays) / surface.depth, roughness), image)


def of_each_light(shadows: Shadows, chosen: Chosen | None, groups: int) -> list[Shadows]:
    """What rays tell of each group of lights, nothing where a ray went to another; of all lights
    where they are one."""
    if chosen is None:
        return [shadows]
    group = chosen.group
    return [mapped(lambda x, g=g: dr.select(group == g, x, 0), shadows) for g in range(groups)]


def as_own_rays_say(light: Signals, output: list[Signal], frame: Color, own: Surroundings,
                    line: Float) -> Color:
    """The colour of filtered signals, but where a pixel's own rays know better than those around:
    in hard shadows (`penumbra.py`) and in slits (`contact.py`).

    Args:
        frame: colour of the frame. own: of `look_around`. line: of `share_of_line`.
    """
    output, first = list(output), len(output) - len(own.shadows)
    for s, shadow in enumerate(own.shadows, first):
        left = left_in_hard_shadow(shadow.penumbra.inverse_width)
        output[s] = output[s]._replace(luminance=output[s].luminance * left)
    assert own.contact is not None
    return dark_in_slits(light.color(output), frame, own.contact, line)
