"""What materials say of themselves: the normal that they shade with, the width of their highlight,
and the reflectance of what is diffuse in them.

Mitsuba has no question for the first two from Python (the shading frame of a normal map is not
exposed, and not passed on by `twosided`, `mask` and `blendbsdf`), so its tree of live BSDFs is
walked. What each adapter does to the frame and to the directions of what it holds is written down
here as its plugin does it (Mitsuba 3.9, `src/bsdfs`).

Symbols: n the local shading normal (0, 0, 1), n' the one that a map makes of it; h a bump map's
height, d its scale; wi the local direction to the viewer; alpha the width of GGX.

    normal map   n' = 2 t - 1 of its texture t, in the local shading frame
    bump map     n' = (dp/du + n (d dh/du - n . dp/du)) x (the same of v), on the side of the
                 geometric normal
    both         mirrored to (-n'_x, -n'_y, n'_z) where it would face away from a viewer whom n
                 faces (`flip_invalid_normals`, Mitsuba's default; Schüssler et al. 2017)
    two sides    seen from behind, the nested BSDF sees wi mirrored in z, so n' is mirrored too
    blend        n' interpolated by weight; the smallest alpha that has a weight
    nested maps  each perturbs the frame of the one around it (a bump map in a bump map is not
                 modelled exactly: Mitsuba's normals there differ by some hundredths)
    mask         what is nested; where it is a hole, light passes straight on: alpha 0

alpha is the parameter of microfacet plugins (the geometric mean of two axes), roughness^2 and at
least 0.001 for Disney's (the main lobe's, not the clear coat's), 0 for mirrors, panes and smooth
plastic, 1 without a glossy lobe. For any other plugin it is taken from the density of its glossy
lobe: along the normal that of the mirror direction is D / 4 = 1 / (4 pi alpha^2) for microfacets
sampled by visible normals (Walter et al. 2007; exact for GGX and Beckmann, if nothing else is in
the density).

Of the diffuse reflectance Mitsuba knows only for some plugins what it is (`_TOLD`). Asked of any
other, it takes what comes back along the normal, highlight included: 1 for a polarizing plastic, 12
for a blend with metal. Here a blend has the mean of its parts, by weight, of which those that are
not diffuse add nothing, and other plugins answer with their diffuse lobes alone. Of Disney's it
takes the base colour, which is that of metal and glass too: here only what is neither is diffuse.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import drjit as dr
import numpy as np

from onespp.render.host.aligned import owned

from .variant import mi

_MICROFACETS = ("RoughConductor", "RoughDielectric", "RoughPlastic", "PolarizedPlastic")
_DISNEY = ("Principled", "PrincipledThin")
_MAPS = ("NormalMap", "BumpMap")
_TOLD = ("SmoothDiffuse", "SmoothPlastic", "RoughPlastic", *_DISNEY)
_NOT_DIFFUSE = ("metallic", "spec_trans")  # shares of Disney's
_LEAST_DISNEY = 1e-3
_NO_LENGTH = 1e-8  # squared; a texel (0.5, 0.5, 0.5) but for the rounding of its interpolation
_MIRROR = +mi.BSDFFlags.DeltaReflection | +mi.BSDFFlags.DeltaTransmission


class Appearance:
    """The materials of a scene's shapes. Built once: nothing in it changes from frame to frame.

    Args:
        bsdf_from_shape: index in the JIT registry of each shape -> its BSDF.
    """

    def __init__(self, bsdf_from_shape: Mapping[int, mi.BSDF]) -> None:
        size = max(bsdf_from_shape) + 1
        alphas, self._varying, self._mapped = np.ones(size, np.float32), [], []
        self._untold: list[mi.BSDF] = []
        rows = np.zeros((3, size), np.uint32)  # which of the lists' entries, from 1; 0: none
        nothing = dr.zeros(mi.SurfaceInteraction3f)
        shapes_of: dict[int, list[int]] = {}  # shapes that share a BSDF
        for index, bsdf in bsdf_from_shape.items():
            shapes_of.setdefault(id(bsdf), []).append(index)
        for shapes in shapes_of.values():
            bsdf = bsdf_from_shape[shapes[0]]
            if _varies(bsdf):
                self._varying.append(bsdf)
                rows[0, shapes] = len(self._varying)
            else:
                with dr.suspend_grad():
                    alphas[shapes] = _alpha(bsdf, nothing, mi.Bool(True)).numpy()[0]
            if _is_mapped(bsdf):
                self._mapped.append(bsdf)
                rows[1, shapes] = len(self._mapped)
            if not _is_told(bsdf):
                self._untold.append(bsdf)
                rows[2, shapes] = len(self._untold)
        self._alphas = owned(mi.Float, alphas)
        self._varying_row, self._mapped_row, self._untold_row = (owned(mi.UInt32, row)
                                                                 for row in rows)

    @property
    def tables(self) -> list[Any]:
        """By registry index: all arrays of its own that kernels read."""
        return [self._alphas, self._varying_row, self._mapped_row, self._untold_row]

    def roughness(self, si: mi.SurfaceInteraction3f) -> mi.Float:
        """GGX alpha of the glossy lobe; 0: a mirror, 1: no such lobe, or no surface."""
        shape, valid = mi.UInt32(dr.reinterpret_array(mi.UInt32, si.shape)), si.is_valid()
        alpha = dr.select(valid, dr.gather(mi.Float, self._alphas, shape, valid), 1)
        row = dr.gather(mi.UInt32, self._varying_row, shape, valid) if self._varying else None
        for number, bsdf in enumerate(self._varying, 1):
            here = valid & (row == number)
            alpha = dr.select(here, _alpha(bsdf, si, here), alpha)
        return dr.clip(alpha, 0, 1)

    def may_be_narrow(self, alpha: float) -> bool:
        """Whether some glossy lobe may be narrower than alpha."""
        alphas = self._alphas.numpy()
        return bool(self._varying) or bool(((alphas > 0) & (alphas < alpha)).any())

    def is_narrow(self, si: mi.SurfaceInteraction3f, alpha: float) -> mi.Bool:
        """Where all lobes are narrower than alpha, or there are none."""
        return (self.roughness(si) < alpha) & dr.all(self.albedo(si) == 1)

    def normal(self, si: mi.SurfaceInteraction3f) -> mi.Vector3f:
        """Shading normal, as its material perturbs it: world space, unit length.

        It is on the side of the surface that the camera sees, by the geometric normal.
        """
        valid = si.is_valid()
        seen_from_behind = dr.dot(si.n, si.to_world(si.wi)) < 0
        # (The two normals of a rectangle that its matrix mirrors are opposite to one another.)
        is_turned = seen_from_behind ^ (dr.dot(si.n, si.sh_frame.n) < 0)
        n = mi.Vector3f(dr.select(is_turned, -si.sh_frame.n, si.sh_frame.n))
        if self._mapped:
            smooth = mi.Vector3f(n)
            shape = mi.UInt32(dr.reinterpret_array(mi.UInt32, si.shape))
            row = dr.gather(mi.UInt32, self._mapped_row, shape, valid)
            for number, bsdf in enumerate(self._mapped, 1):
                here = valid & (row == number)
                mapped = dr.normalize(si.to_world(_normal(bsdf, si, here)))
                mapped = dr.select(dr.dot(mapped, smooth) < 0, -mapped, mapped)
                n = dr.select(here, mapped, n)
        return dr.select(valid, n, 0)

    def albedo(self, si: mi.SurfaceInteraction3f) -> mi.Color3f:
        """Diffuse reflectance, 1 where there is no diffuse lobe, 0 where there is no surface."""
        valid, bsdf = si.is_valid(), si.bsdf()
        diffuse = mi.has_flag(bsdf.flags(), mi.BSDFFlags.DiffuseReflection)
        value = dr.select(diffuse, mi.Color3f(bsdf.eval_diffuse_reflectance(si, valid)), 1)
        if self._untold:
            shape = mi.UInt32(dr.reinterpret_array(mi.UInt32, si.shape))
            row = dr.gather(mi.UInt32, self._untold_row, shape, valid)
            for number, one in enumerate(self._untold, 1):
                here = valid & (row == number)
                found, share = _diffuse(one, si, here)
                value = dr.select(here, dr.select(share > 0, found, 1), value)
        return dr.select(valid, dr.clip(value, 0, 1), 0)


def _diffuse(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f,
             active: mi.Bool) -> tuple[mi.Color3f, mi.Float]:
    """Diffuse reflectance of one material, and the share of it, by weight, that is diffuse."""
    kind, parts = bsdf.class_name(), _objects(bsdf)
    if kind == "TwoSidedBRDF":
        front, back = (_diffuse(side, si, active) for side in _sides(parts))
        behind = si.wi.z < 0
        return dr.select(behind, back[0], front[0]), dr.select(behind, back[1], front[1])
    if kind in ("MaskBSDF", *_MAPS):
        return _diffuse(parts["nested_bsdf"], si, active)
    if kind == "BlendBSDF":
        weight = dr.clip(parts["weight"].eval_1(si, active), 0, 1)
        (a, of_a), (b, of_b) = (_diffuse(parts[name], si, active) for name in ("bsdf_0", "bsdf_1"))
        return a * (1 - weight) + b * weight, of_a * (1 - weight) + of_b * weight
    if not bsdf.flags() & +mi.BSDFFlags.DiffuseReflection:
        return mi.Color3f(0), mi.Float(0)
    if kind in _TOLD:
        share = mi.Float(1)
        for name in _NOT_DIFFUSE:
            share *= 1 - (parts[name].eval_1(si, active) if name in parts else 0)
        return mi.Color3f(bsdf.eval_diffuse_reflectance(si, active)) * share, share
    if "diffuse_reflectance" in parts:
        return mi.Color3f(parts["diffuse_reflectance"].eval(si, active)), mi.Float(1)
    along = mi.Vector3f(0, 0, 1)
    facing = mi.SurfaceInteraction3f(si)
    facing.wi = along
    context = mi.BSDFContext()
    context.type_mask = mi.BSDFFlags.Diffuse
    return mi.Color3f(bsdf.eval(context, facing, along, active)) * dr.pi, mi.Float(1)


def _is_told(bsdf: mi.BSDF) -> bool:
    """Whether Mitsuba knows the diffuse reflectance of a material, or it has none."""
    kind, parts = bsdf.class_name(), _objects(bsdf)
    if kind == "TwoSidedBRDF":  # one value for both sides, unless one is not diffuse
        lobes = {bool(side.flags() & +mi.BSDFFlags.DiffuseReflection) for side in nested(bsdf)}
        return len(lobes) == 1 and all(map(_is_told, nested(bsdf)))
    if kind in ("MaskBSDF", *_MAPS):
        return all(map(_is_told, nested(bsdf)))
    if kind in _DISNEY and any(parts[name].is_spatially_varying() or parts[name].max() > 0
                               for name in _NOT_DIFFUSE if name in parts):
        return False
    return kind in _TOLD or not bsdf.flags() & +mi.BSDFFlags.DiffuseReflection


def _alpha(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Float:
    """alpha at a point of one material."""
    kind, parts = bsdf.class_name(), _objects(bsdf)
    if kind == "TwoSidedBRDF":
        front, back = _sides(parts)
        alpha = _alpha(front, si, active)
        return alpha if back is front else dr.select(si.wi.z < 0, _alpha(back, si, active), alpha)
    if kind == "MaskBSDF":
        opacity = parts["opacity"].eval_1(si, active)
        return dr.select(opacity > 0, _alpha(parts["nested_bsdf"], si, active), 0)
    if kind == "BlendBSDF":
        weight = parts["weight"].eval_1(si, active)
        return dr.minimum(dr.select(weight < 1, _alpha(parts["bsdf_0"], si, active), 1),
                          dr.select(weight > 0, _alpha(parts["bsdf_1"], si, active), 1))
    if kind in _MAPS:
        return _alpha(parts["nested_bsdf"], si, active)
    if kind in _DISNEY:
        roughness = parts["roughness"].eval_1(si, active)
        return dr.maximum(roughness * roughness, _LEAST_DISNEY)
    if kind in _MICROFACETS:
        return _microfacet_alpha(bsdf, parts, si, active)
    flags = bsdf.flags()
    if flags & _MIRROR or (flags & +mi.BSDFFlags.Null and not flags & +mi.BSDFFlags.Smooth):
        return mi.Float(0)
    if flags & +mi.BSDFFlags.Glossy:
        return _alpha_from_density(bsdf, si, active)
    return mi.Float(1)


def _microfacet_alpha(bsdf: mi.BSDF, parts: Mapping[str, Any], si: mi.SurfaceInteraction3f,
                      active: mi.Bool) -> mi.Float:
    if "alpha_u" in parts:
        u, v = (parts[name].eval_1(si, active) for name in ("alpha_u", "alpha_v"))
        return dr.sqrt(dr.maximum(u * v, 0))
    if "alpha" in parts:
        return parts["alpha"].eval_1(si, active)
    return mi.Float(mi.traverse(bsdf)["alpha"])  # a number, of `roughplastic`


def _alpha_from_density(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Float:
    along = mi.Vector3f(0, 0, 1)
    facing = mi.SurfaceInteraction3f(si)
    facing.wi = along
    context = mi.BSDFContext()
    context.type_mask = mi.BSDFFlags.Glossy
    density = bsdf.pdf(context, facing, along, active)
    return dr.rsqrt(dr.maximum(4 * dr.pi * density, 1))


def _normal(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Vector3f:
    """The normal that a material shades with, in the local frame, on the side of `si.wi`."""
    kind, parts = bsdf.class_name(), _objects(bsdf)
    if kind == "TwoSidedBRDF":
        front, back = _sides(parts)
        behind = si.wi.z < 0
        mirrored = mi.SurfaceInteraction3f(si)
        mirrored.wi.z = dr.abs(si.wi.z)
        n = _normal(front, mirrored, active)
        if back is not front:
            n = dr.select(behind, _normal(back, mirrored, active), n)
        return mi.Vector3f(n.x, n.y, dr.select(behind, -n.z, n.z))
    if kind == "MaskBSDF":
        return _normal(parts["nested_bsdf"], si, active)
    if kind == "BlendBSDF":
        weight = dr.clip(parts["weight"].eval_1(si, active), 0, 1)
        a, b = (_normal(parts[name], si, active) for name in ("bsdf_0", "bsdf_1"))
        return _unit(dr.lerp(a, b, weight), a)
    if kind in _MAPS:
        frame = _perturbed(kind, bsdf, parts, si, active)
        inner = mi.SurfaceInteraction3f(si)
        inner.sh_frame = mi.Frame3f(si.to_world(frame.s), si.to_world(frame.t),
                                    si.to_world(frame.n))
        inner.wi = frame.to_local(si.wi)
        return frame.to_world(_normal(parts["nested_bsdf"], inner, active))
    return mi.Vector3f(0, 0, dr.select(si.wi.z < 0, mi.Float(-1), 1))


def _perturbed(kind: str, bsdf: mi.BSDF, parts: Mapping[str, Any], si: mi.SurfaceInteraction3f,
               active: mi.Bool) -> mi.Frame3f:
    """The frame that a map makes of the local one."""
    if kind == "NormalMap":
        n = mi.Vector3f(parts["normalmap"].eval_3(si, active)) * 2 - 1
        n = dr.select(dr.squared_norm(n) < _NO_LENGTH, mi.Vector3f(0, 0, 1), n)
    else:
        slope = mi.traverse(bsdf)["scale"] * parts["nested_texture"].eval_1_grad(si, active)
        shading = mi.Vector3f(si.sh_frame.n)
        along_u, along_v = (p + shading * (rise - dr.dot(shading, p))
                            for p, rise in ((si.dp_du, slope.x), (si.dp_dv, slope.y)))
        across = dr.cross(along_u, along_v)
        n = si.to_local(dr.select(dr.dot(si.n, across) < 0, -across, across))
    away = si.wi.z * dr.dot(si.wi, n) <= 0
    n = _unit(dr.select(away, mi.Vector3f(-n.x, -n.y, n.z), n), mi.Vector3f(0, 0, 1))
    s = _unit(mi.Vector3f(1, 0, 0) - n * n.x, mi.Vector3f(0, 1, 0))
    return mi.Frame3f(s, dr.cross(n, s), n)


def _unit(vector: mi.Vector3f, otherwise: mi.Vector3f) -> mi.Vector3f:
    """Of unit length; `otherwise` where there is no length."""
    scale = dr.rsqrt(dr.squared_norm(vector))
    return dr.select(dr.isfinite(scale), vector * scale, otherwise)


def _is_mapped(bsdf: mi.BSDF) -> bool:
    return bsdf.class_name() in _MAPS or any(_is_mapped(part) for part in nested(bsdf))


def _varies(bsdf: mi.BSDF) -> bool:
    """Whether alpha may differ from point to point, or between the sides."""
    kind, parts = bsdf.class_name(), _objects(bsdf)
    if kind == "TwoSidedBRDF" and len({id(side) for side in _sides(parts)}) > 1:
        return True
    parts_of = nested(bsdf)
    if not parts_of and kind not in _MICROFACETS + _DISNEY:
        return bool(bsdf.flags() & +mi.BSDFFlags.Glossy)  # from the density
    read = [parts[name] for name in ("opacity", "weight", "roughness", "alpha", "alpha_u",
                                     "alpha_v") if name in parts]
    return any(texture.is_spatially_varying() for texture in read) or any(map(_varies, parts_of))


def nested(bsdf: mi.BSDF) -> Sequence[mi.BSDF]:
    """The materials that one is made of."""
    return [part for part in _objects(bsdf).values() if isinstance(part, mi.BSDF)]


def _sides(parts: Mapping[str, Any]) -> tuple[mi.BSDF, mi.BSDF]:
    return parts["brdf_0"], parts.get("brdf_1", parts["brdf_0"])


class _Objects(mi.TraversalCallback):
    def __init__(self) -> None:
        super().__init__()
        self.found: dict[str, Any] = {}

    def put(self, name: str, value: Any, flags: Any, *_: Any) -> None:
        if isinstance(value, mi.Object):
            self.found[name] = value


def _objects(owner: mi.Object) -> dict[str, Any]:
    """The objects (textures, BSDFs) that one holds, by Mitsuba's name for them."""
    callback = _Objects()
    owner.traverse(callback)
    return callback.found
