"""What the values of a scene may be, checked where they are given: plain Python and NumPy.

Mitsuba checks some of this, stops the whole process at some (a property that is None, an image
without pixels) and takes the rest as it comes: a reflectance of 255, NaN, a sheared camera. Each
check here returns the value in the one form that the rest of the code knows, or raises a SceneError
that says what is wrong, where, and what to do. `what` is where: "the emission of shape 'lamp'".
"""

from __future__ import annotations

import math
import numbers
import os
import re
import reprlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

Bounds = tuple[float, float]

ANY: Bounds = (-math.inf, math.inf)
FRACTION: Bounds = (0.0, 1.0)
POSITIVE: Bounds = (0.0, math.inf)
REFRACTION: Bounds = (0.1, 10.0)
RADIANCE: Bounds = (0.0, 1e12)  # 500 times the sun's in cd/m^2; its square is far from overflow

# Properties of Mitsuba's BSDFs that are fractions, whether numbers, colours or textures.
_FRACTIONS = frozenset((
    "reflectance", "diffuse_reflectance", "specular_reflectance", "specular_transmittance",
    "transmittance", "base_color", "opacity", "weight", "roughness", "metallic", "anisotropic",
    "spec_tint", "spec_trans", "sheen", "sheen_tint", "clearcoat", "clearcoat_gloss", "flatness"))
_NOT_NEGATIVE = frozenset(("alpha", "alpha_u", "alpha_v", "eta", "k", "specular",
                           "diff_trans"))
_INDICES = frozenset(("int_ior", "ext_ior"))  # one is divided by the other
_OF_A_TEXTURE = frozenset((  # bounded as the texture's own property is
    "bitmap", "color0", "color1", "value", "factor_0", "factor_1", "stepped"))
_SCALARS = frozenset((  # of which Mitsuba reads one number
    "opacity", "weight", "roughness", "metallic", "anisotropic", "spec_tint", "spec_trans", "sheen",
    "sheen_tint", "clearcoat", "clearcoat_gloss", "flatness", "diff_trans", "alpha", "alpha_u",
    "alpha_v"))
BUFFERS = frozenset(("vertex_positions", "vertex_normals", "vertex_texcoords"))
ENVIRONMENTS = ("envmap", "constant", "sunsky")
LIGHTS = ("point", "spot", "directional")
VECTORS = frozenset(("position", "direction", "sun_direction"))
PLACEMENTS = ("uv_from_surface", "to_uv")
_DEEPEST = 16
LARGEST = 1e30  # Mitsuba computes in float32, where 1e39 is infinite
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 200
_ROUNDING = 1e-6
_RIGID = 1e-4  # a matrix written with four decimals still passes; it moves no pixel by a tenth


@dataclass(frozen=True)
class Place:
    """Where in a dictionary a value is: "'bsdf.reflectance' of the material of shape 'x'"."""

    owner: str
    path: str = ""

    def inside(self, key: str) -> Place:
        return replace(self, path=f"{self.path}.{key}" if self.path else key)

    def __str__(self) -> str:
        return f"'{self.path}' of {self.owner}" if self.path else self.owner


def brief(value: object) -> str:
    """A value for a message: short, on one line."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    return " ".join(_SHORT.repr(value).split())


def number(value: Any, what: str, bounds: Bounds = ANY) -> float:
    """A finite number within bounds, as a float."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool | np.bool_) or not isinstance(value, numbers.Real):
        raise SceneError(f"{what} is {brief(value)}: use a number")
    return float(_within(np.asarray(_float(value)), what, bounds))


def whole(value: Any, what: str, least: int, most: int) -> int:
    """A whole number from `least` to `most`, as an int."""
    found = _float(value) if isinstance(value, numbers.Real) else math.nan
    if isinstance(value, bool | np.bool_) or not found.is_integer():
        raise SceneError(f"{what} = {brief(value)}: use a whole number from {least} to {most}")
    if not least <= found <= most:
        raise SceneError(f"{what} = {brief(value)}: use {least} or more" if found < least else
                         f"{what} = {brief(value)}: use at most {most}")
    return int(found)


def text(value: Any, what: str, longest: int) -> str:
    """Text that can be shown, written to files, and is not empty."""
    if not isinstance(value, str) or not value or len(value) > longest or not value.isprintable():
        raise SceneError(f"{what} is {brief(value)}: use text of 1 to {longest} printable letters")
    return value


def matrix(value: Any, what: str) -> np.ndarray:
    """A transform: (4, 4) float64, finite, its last row (0, 0, 0, 1)."""
    try:
        found = np.array(value, np.float64)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.shape != (4, 4) or not (abs(found) <= LARGEST).all():
        raise SceneError(f"{what} is not a 4x4 matrix of numbers of up to {LARGEST:g}")
    if not np.array_equal(found[3], (0, 0, 0, 1)):
        raise SceneError(f"{what} has {found[3].tolist()} as its last row: use (0, 0, 0, 1), with "
                         "the translation in the last column")
    return found


def rigid(value: Any, what: str, mirrored: bool = False) -> np.ndarray:
    """A transform that only turns and moves.

    Uniform scale is refused too: it would scale depths, which are world units. So is a mirror, if
    not `mirrored`: the axes were mistaken, more often than a mirrored picture is meant.
    """
    found = matrix(value, what)
    axes = found[:3, :3]
    lengths = np.linalg.norm(axes, axis=0)
    directions = axes / np.maximum(lengths, 1e-300)
    if abs(directions.T @ directions - np.diag(lengths > 0)).max() > _RIGID:
        raise SceneError(f"{what} is sheared: a camera only turns and moves, make the first three "
                         "columns perpendicular (see transforms.look_at)")
    if abs(lengths - 1).max() > _RIGID:
        raise SceneError(f"{what} scales its axes by {np.round(lengths, 4).tolist()}: a camera "
                         "only turns and moves, divide each of the first three columns by its "
                         "length")
    if np.linalg.det(axes) < 0 and not mirrored:
        raise SceneError(f"{what} mirrors the picture: its columns are the camera's axes, x to the "
                         "right, y down and z forward (see transforms.look_at)")
    return found


def color(value: Any, what: str, bounds: Bounds = POSITIVE) -> tuple[float, float, float]:
    """Three numbers of a tuple, a list or an array."""
    found = _numbers(value, what)
    if found.shape != (3,):
        raise SceneError(f"{what} is {brief(value)}: use a colour, (r, g, b)")
    r, g, b = _within(found, what, bounds).tolist()
    return r, g, b


def image(value: Any, what: str, bounds: Bounds = POSITIVE) -> np.ndarray:
    """An image of linear values with at least one pixel, (h, w), (h, w, 1) or (h, w, 3) floats."""
    found = np.asarray(value)
    if np.issubdtype(found.dtype, np.integer) or found.dtype == bool:
        raise SceneError(f"{what} is an image of whole numbers ({found.dtype}): make 8-bit colours "
                         "linear with onespp.scenes.materials.srgb8(...), and divide other data by "
                         "its largest value")
    found = _numbers(found, what)
    if found.ndim not in (2, 3) or (found.ndim == 3 and found.shape[2] not in (1, 3)):
        raise SceneError(f"{what} is an image of shape {found.shape}: use (h, w) or (h, w, 3)")
    if not found.size:
        raise SceneError(f"{what} is an image of shape {found.shape}: use one that has pixels")
    _within(found, what, bounds)
    return found


def rows(value: Any, what: str, count: int, *widths: int) -> np.ndarray:
    """A copy of an array of finite real numbers, (count, one of the widths) float64."""
    wide = " or ".join(map(str, widths))
    try:
        if np.iscomplexobj(value):
            raise TypeError
        found = np.array(value, np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"{what} are not real numbers in rows of {wide}") from None
    if found.shape not in [(count, width) for width in widths]:
        raise SceneError(f"{what} have shape {found.shape}, expected ({count}, {wide})")
    if not (abs(found) <= LARGEST).all():
        raise SceneError(f"{what} are not all finite: replace what is NaN, infinite, or above "
                         f"{LARGEST:g}")
    return found


def attributes(value: Any, vertices: int, faces: int) -> dict[str, np.ndarray]:
    """Data of a mesh's vertices and faces, float64, in the order of their names."""
    if not isinstance(value, Mapping):
        raise SceneError(f"mesh attributes are {brief(value)}: use a dictionary, such as "
                         "{'vertex_color': an (n, 3) array}")
    for name in value:
        if (not isinstance(name, str) or name in BUFFERS
                or not re.fullmatch(r"(vertex|face)_\w+", name, re.ASCII)):
            raise SceneError(f"a mesh attribute is named {brief(name)}: use vertex_ or face_ and a "
                             "word, but not vertex_positions, vertex_normals or vertex_texcoords")
    return {name: rows(part, f"the values of mesh attribute '{name}'",
                       faces if name.startswith("face_") else vertices, 1, 3)
            for name, part in sorted(value.items())}


def material(value: Any, what: str) -> Mapping[str, Any]:
    """A BSDF dictionary all of whose values are of kinds that Mitsuba survives."""
    if not isinstance(value, Mapping):
        raise SceneError(f"{what} is {brief(value)}: use a material, such as "
                         "onespp.scenes.materials.diffuse((0.8, 0.3, 0.2))")
    _check_plugin(value, Place(what), ANY, 0)
    return value


def emission(value: Any, what: str) -> tuple[float, float, float] | np.ndarray | Mapping[str, Any]:
    """Radiance: a number, a colour, an image, a texture's dictionary, or an image's path."""
    if isinstance(value, str | os.PathLike):
        return {"type": "bitmap", "filename": _path(value, what)}
    if isinstance(value, Mapping):
        if value.get("type") == "area" and set(value) == {"type", "radiance"}:
            return emission(value["radiance"], what)
        if value.get("type") == "rgb":
            return color(value.get("value"), what, RADIANCE)
        check_light(value, what)
        # A checkerboard's colours are reflectances for Mitsuba, whatever it is used for.
        _check_plugin(value, Place(what),
                      FRACTION if value.get("type") == "checkerboard" else RADIANCE, 0)
        return value
    return _radiance(value, what)


def environment(value: Any, what: str) -> tuple[float, float, float] | np.ndarray | Mapping:
    """Radiance from all around: a number, a colour, an (h, w, 3) image, an image's path, or a
    dictionary of Mitsuba's.

    A path becomes Mitsuba's dictionary of it, {"type": "envmap", "filename": ...}.
    """
    if isinstance(value, str | os.PathLike):
        return {"type": "envmap", "filename": _path(value, what)}
    if isinstance(value, Mapping):
        for kind, key in (("envmap", "filename"), ("envmap", "bitmap"), ("constant", "radiance")):
            if value.get("type") == kind and set(value) == {"type", key}:
                return environment(value[key], what)
        if value.get("type") not in ENVIRONMENTS:
            raise SceneError(f"{what} is {brief(dict(value))}: use a number, a colour, an image, "
                             f"the path of one, or a dictionary of type {', '.join(ENVIRONMENTS)}")
        if value["type"] == "envmap" and ("filename" in value) == ("bitmap" in value):
            raise SceneError(f"{what} is an envmap without an image, or with two: give it either a "
                             "\"bitmap\" or a \"filename\"")
        return _emitter(value, what)
    found = _radiance(value, what)
    if isinstance(found, np.ndarray) and found.shape[2:] != (3,):
        raise SceneError(f"{what} is an image of shape {found.shape}: use (h, w, 3)")
    return found


def light(value: Any, what: str) -> Mapping[str, Any]:
    """A light that is no shape, a dictionary of Mitsuba's."""
    if not isinstance(value, Mapping) or value.get("type") not in LIGHTS:
        raise SceneError(f"{what} is {brief(value)}: use a dictionary of type {', '.join(LIGHTS)}")
    if "to_world" in value or not VECTORS.isdisjoint(value):
        raise SceneError(f"{what} has a place among its properties: give it as world_from_light")
    return _emitter(value, what)


def _emitter(value: Mapping[str, Any], what: str) -> Mapping[str, Any]:
    """A dictionary of an emitter of Mitsuba's, whose matrices and vectors are numbers."""
    place = Place(what)
    for key, part in value.items():
        if key == "to_world":
            matrix(part, str(place.inside(key)))
        elif key in VECTORS and _numbers(part, str(place.inside(key))).shape != (3,):
            raise SceneError(f"{place.inside(key)} is {brief(part)}: use three numbers")
    check_light(value, what)
    _check_plugin({key: part for key, part in value.items()
                   if key not in VECTORS and key != "to_world"}, place, RADIANCE, 0)
    return value


def check_light(value: Mapping[str, Any], what: str) -> None:
    """SceneError where what is emitted is data of vertices: Mitsuba draws points of lamps without
    the triangle that they are in, and such lamps light nothing."""
    for place, *_ in _mesh_attributes(value, Place(what)):
        raise SceneError(f"{place} is a mesh_attribute texture, and lights here cannot shine by "
                         "data of vertices: use a colour or an image")


def check_attributes(material: Mapping[str, Any], name: str,
                     attributes: Mapping[str, np.ndarray] | None) -> None:
    """SceneError where a material's mesh_attribute textures are of other data than a shape has:
    Mitsuba shows black there.

    Args:
        name: the shape's. attributes: those of its mesh; None of what is no mesh.
    """
    for place, texture, key, bounds in _mesh_attributes(
            material, Place(f"the material of shape '{name}'")):
        asked = texture.get("name")
        if attributes is None:
            raise SceneError(f"{place} is the mesh_attribute {brief(asked)}, and shape '{name}' is "
                             "no mesh: use a Mesh that has it, or another texture")
        if not isinstance(asked, str) or asked not in attributes:
            raise SceneError(f"{place} is the mesh_attribute {brief(asked)}, and the mesh of shape "
                             f"'{name}' has {', '.join(attributes) or 'none'}: give it that "
                             "attribute, or use another texture")
        values, width = attributes[asked], 1 if key in _SCALARS else 3 if key == "normalmap" else 0
        if width and values.shape[1] != width:
            raise SceneError(f"{place} needs rows of {width}, and the attribute '{asked}' of shape "
                             f"'{name}' has rows of {values.shape[1]}: use another one")
        scale = number(texture.get("scale", 1.0), str(place.inside("scale")))
        _within(scale * values, f"{place}, {scale:g} times the attribute '{asked}',", bounds)


def _mesh_attributes(plugin: Mapping[Any, Any], place: Place, bounds: Bounds = ANY, key: str = "",
                     ) -> Iterator[tuple[Place, Mapping[Any, Any], str, Bounds]]:
    """The mesh_attribute textures in a dictionary: where, which, the property of a material that
    they are of, and its bounds."""
    if plugin.get("type") == "mesh_attribute":
        yield place, plugin, key, bounds
    for name, part in plugin.items():
        if isinstance(part, Mapping):
            yield from _mesh_attributes(part, place.inside(name), bounds_of(name, bounds),
                                        key if name in _OF_A_TEXTURE else name)


def _radiance(value: Any, what: str) -> tuple[float, float, float] | np.ndarray:
    if np.ndim(_array(value, what)) == 0:
        gray = number(value, what, RADIANCE)
        return gray, gray, gray
    if np.ndim(value) == 1:
        return color(value, what, RADIANCE)
    return image(value, what, RADIANCE)


def _check_plugin(plugin: Mapping[Any, Any], place: Place, bounds: Bounds, depth: int) -> None:
    """Check every value of a dictionary of Mitsuba's; `bounds` are those of its colours."""
    if depth > _DEEPEST:
        raise SceneError(f"{place.owner} is nested more than {_DEEPEST} deep: use a simpler one")
    kind = plugin.get("type")
    if not isinstance(kind, str) or not kind:
        raise SceneError(f"{place} has no type: give it one, such as \"type\": \"diffuse\"")
    for key, value in plugin.items():
        if not isinstance(key, str) or not key or "." in key:
            raise SceneError(f"{place} has a property {brief(key)}: use a name without dots")
        if key != "type":
            _check_value(kind, key, value, place.inside(key), bounds_of(key, bounds), depth)


def bounds_of(key: str, inherited: Bounds) -> Bounds:
    """What a property of a BSDF, or of a texture with inherited bounds, may be."""
    if key in _OF_A_TEXTURE:
        return inherited
    if key in _INDICES:
        return REFRACTION
    return FRACTION if key in _FRACTIONS else POSITIVE if key in _NOT_NEGATIVE else ANY


def _check_value(kind: str, key: str, value: Any, place: Place, bounds: Bounds,
                 depth: int) -> None:
    what = str(place)
    if key == "bitmap":
        image(value, what, bounds)
    elif key in PLACEMENTS:
        matrix(value, what)
    elif key == "filename":
        _path(value, what)
    elif kind == "rgb" and key == "value":
        color(value, what, (0.0, bounds[1]))
    elif kind == "spectrum" and key == "value" and np.ndim(value) == 2:
        if np.shape(_numbers(value, what))[1] != 2:
            raise SceneError(f"{what} is {brief(value)}: use pairs (wavelength, value)")
    elif isinstance(value, Mapping):
        _check_plugin(value, place, bounds, depth + 1)
    elif isinstance(value, tuple | list | np.ndarray) and np.ndim(_array(value, what)):
        if np.ndim(value) == 1:
            color(value, what, (0.0, bounds[1]))
        else:
            image(value, what, bounds)
    elif isinstance(value, numbers.Real | np.ndarray) and not isinstance(value, bool):
        number(value, what, bounds)
    elif not isinstance(value, str | bool | np.bool_):
        todo = "leave it out, or give" if value is None else "use"
        raise SceneError(f"{what} is {brief(value)}: {todo} a number, a colour, an image or a "
                         "dictionary")


def _path(value: Any, what: str) -> str:
    if not isinstance(value, str | os.PathLike) or not os.fspath(value):
        raise SceneError(f"{what} is {brief(value)}: use the path of a file")
    found = os.fspath(value)
    return os.fsdecode(found) if isinstance(found, bytes) else found


def _array(value: Any, what: str) -> np.ndarray:
    try:
        return np.asarray(value)
    except (TypeError, ValueError):
        raise SceneError(f"{what} is {brief(value)}: use numbers in rows of one length") from None


def _float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:  # of an int
        return math.inf


def _numbers(value: Any, what: str) -> np.ndarray:
    """The value as float64, if it is made of real numbers."""
    found = _array(value, what)
    if not (np.issubdtype(found.dtype, np.floating) or np.issubdtype(found.dtype, np.integer)):
        raise SceneError(f"{what} is {brief(value)}: use numbers")
    return found.astype(np.float64)


def _within(found: np.ndarray, what: str, bounds: Bounds) -> np.ndarray:
    """The array, if finite and within bounds; what roundings pushed over them is put back."""
    low, high = bounds
    if not (abs(found) <= LARGEST).all():
        raise SceneError(f"{what} is not finite: replace what is NaN, infinite, or above "
                         f"{LARGEST:g}")
    if not found.size:
        return found
    least, most = float(found.min()), float(found.max())
    if least < low - _ROUNDING or most > high + _ROUNDING:
        odd = least if least < low - _ROUNDING else most
        helper = " (8-bit colours become linear with onespp.scenes.materials.srgb8)"
        hint = helper if most > 1 == high else ""
        use = f"{low:g} to {high:g}{hint}" if high < math.inf else f"{low:g} or more"
        raise SceneError(f"{what} {'is' if found.ndim == 0 else 'holds'} {odd:.6g}: use {use}")
    return np.clip(found, low, high)


class SceneError(ValueError):
    """A scene that cannot be built. The message is one sentence meant for its author."""
