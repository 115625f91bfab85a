"""Plain materials, lights and images as Mitsuba's objects; its refusals as sentences.

`scenes/validity.py` has seen every value. What is left is what Mitsuba alone knows: which plugins
there are, what their properties are called, what a file holds. Each object is loaded by itself, so
that a mistake is known by its shape, and a material is evaluated once (traced, not compiled), since
some textures fail only then.

Three dictionaries end the process with a segmentation fault instead of an error, whatever their
other values: see `_survivable`.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np

from onespp.scenes import validity
from onespp.scenes.description import SceneError
from onespp.scenes.validity import Place

from . import pictured_lamps, textures
from .variant import mi

_SPECIAL = ("rgb", "spectrum")  # textures that are no plugins but forms of a value
_SMALLEST_MAP = (2, 2)


def bsdf(material: Mapping[str, Any], what: str) -> Any:
    """The BSDF of a material's dictionary.

    Raises:
        SceneError: Mitsuba has no such plugin or property, a file is missing, ...
    """
    if _kind(material["type"]) != mi.ObjectType.BSDF:
        raise SceneError(_no_such(material["type"], mi.ObjectType.BSDF, what))
    loaded = _load(plugin(material, Place(what)), what)
    try:
        with _tried(what):
            si, up = _surface(), mi.Vector3f(0, 0, 1)
            loaded.eval_pdf_sample(mi.BSDFContext(), si, up, mi.Float(0.5), mi.Point2f(0.5), True)
            loaded.eval_diffuse_reflectance(si)
    except SceneError:
        del loaded  # kept by the error's traceback, it would be part of later scenes' kernels
        raise
    return loaded


def area_light(radiance: Any, what: str, by_area: bool = False) -> Any:
    """An area emitter of a colour, an image or a texture's dictionary.

    by_area: its points are drawn by area (`pictured_lamps`), not by the radiance of an image.
    """
    made = plugin(radiance, Place(what), validity.RADIANCE)
    if by_area:
        made = {"type": pictured_lamps.BY_AREA, "picture": made}
    loaded = _load({"type": "area", "radiance": made}, what)
    try:
        with _tried(what):
            loaded.eval(_surface())
    except SceneError:
        del loaded
        raise
    return loaded


def environment(radiance: Any, what: str) -> Any:
    """Light from all around: of a colour, an (h, w, 3) image, or a dictionary of Mitsuba's."""
    if isinstance(radiance, tuple):
        return _load({"type": "constant", "radiance": _rgb(radiance)}, what)
    if not isinstance(radiance, Mapping):
        radiance = {"type": "envmap", "bitmap": radiance}
    if radiance["type"] != "envmap":
        return _load(_emitter(radiance, Place(what)), what)
    made = _emitter({key: value for key, value in radiance.items()
                     if key not in ("filename", "bitmap")}, Place(what))
    return _load({**made, "bitmap": mi.Bitmap(_map(radiance, what).astype(np.float32))}, what)


def _map(radiance: Mapping[str, Any], what: str) -> np.ndarray:
    """The image of an environment map, (h, w, 3), as large as Mitsuba's smallest or larger."""
    if "filename" in radiance:
        pixels = _read(radiance["filename"], what, validity.RADIANCE)
        if pixels.shape[2:] != (3,):
            pixels = np.repeat(pixels.reshape(*pixels.shape[:2], 1), 3, axis=2)
    else:
        pixels = np.asarray(radiance["bitmap"])
    rows, columns = (-(-least // size) for least, size in zip(_SMALLEST_MAP, pixels.shape))
    return np.repeat(np.repeat(pixels, rows, 0), columns, 1)


def light(emitter: Mapping[str, Any], place: np.ndarray, unit: float, what: str) -> Any:
    """A light that is no shape, at a place in a stage of that unit.

    Light from a point falls with the square of the distance, in stage units: its intensity is per
    square of one.
    """
    made = _emitter(emitter, Place(what)) | {"to_world": mi.ScalarTransform4f(place.tolist())}
    loaded = _load(made, what)
    if emitter["type"] == "directional" or unit == 1:
        return loaded
    parameters = mi.traverse(loaded)
    key = next((key for key, _ in parameters if key.startswith("intensity.")), None)
    if key is None:
        raise SceneError(f"{what} has a texture as its intensity: use a colour, (r, g, b)")
    parameters[key] = parameters[key] / unit**2
    parameters.update()
    return loaded


def _emitter(value: Mapping[str, Any], place: Place) -> dict[str, Any]:
    made: dict[str, Any] = {}
    for key, part in value.items():
        if key == "to_world":
            made[key] = mi.ScalarTransform4f(np.asarray(part, float).tolist())
        elif key in validity.VECTORS:
            made[key] = list(map(float, part))
        else:
            made[key] = plugin(part, place.inside(key), validity.RADIANCE)
    return made


def plugin(value: Any, place: Place, bounds: validity.Bounds = validity.ANY) -> Any:
    """A value as Mitsuba takes it: triples become colours, images bitmaps.

    bounds: of the values of image files.
    """
    if isinstance(value, Mapping):
        return _dictionary(value, place, bounds)
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.ndarray | tuple | list) and np.ndim(value):
        if np.ndim(value) == 1:
            return _rgb(value)
        return _dictionary({"type": "bitmap", "bitmap": value, "raw": True}, place, bounds)
    if isinstance(value, np.generic | np.ndarray):
        return value.item()
    return float(value) if isinstance(value, int) and abs(value) > 1 << 30 else value


def _rgb(color: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": list(map(float, color))}


def _dictionary(value: Mapping[str, Any], place: Place,
                bounds: validity.Bounds) -> dict[str, Any]:
    kind, what = value["type"], str(place)
    if kind == "rgb" and "value" in value:
        return _rgb(value["value"])
    if kind not in _SPECIAL and _kind(kind) not in (mi.ObjectType.BSDF, mi.ObjectType.Texture):
        raise SceneError(_no_such(kind, mi.ObjectType.Texture, what))
    _survivable(value, what)
    made: dict[str, Any] = {}
    bright: dict[str, Any] = {}  # of a lamp's file, whose pixels would be warned of as no colours
    for key, part in value.items():
        at = place.inside(key)
        if key == "bitmap":
            made[key] = mi.Bitmap(np.asarray(part, np.float32))
        elif key in validity.PLACEMENTS:  # of a texture, a 4x4 matrix
            made["to_uv"] = mi.ScalarTransform4f(np.asarray(part, float).tolist())
        elif key == "filename":
            made[key] = str(part)
            if kind == "bitmap":
                pixels = _read(part, str(at), bounds)
                if bounds is validity.RADIANCE and pixels.max() > 1:
                    bright = {"bitmap": mi.Bitmap(pixels.astype(np.float32)), "raw": True}
            elif not Path(part).is_file():
                raise SceneError(f"{at} names '{part}', and there is no such file: correct the "
                                 "path, relative ones start from the scene file's folder")
        elif kind == "spectrum" and key == "value" and np.ndim(part) == 2:
            made[key] = [tuple(map(float, pair)) for pair in part]
        elif key != "id":  # an ID of the user's might be one of ours
            made[key] = plugin(part, at, validity.bounds_of(key, bounds))
    if bright:
        del made["filename"]
    return made | bright


def _survivable(value: Mapping[str, Any], what: str) -> None:
    """Refuse what ends Mitsuba's process, and what has nothing to read its values from."""
    kind = value["type"]
    if kind == "bitmap" and ("bitmap" in value) == ("filename" in value):
        raise SceneError(f"{what} is a bitmap without an image, or with two: give it either a "
                         "\"bitmap\" or a \"filename\"")
    if kind == "blendbsdf":
        inner = [part for part in value.values() if isinstance(part, Mapping)
                 and _kind(part["type"]) == mi.ObjectType.BSDF]
        if len(inner) != 2 or "weight" not in value:
            raise SceneError(f"{what} is a blendbsdf of {len(inner)} materials: give it two, and "
                             "a weight")
    if missing := [name for name in textures.NEEDED.get(kind, ()) if name not in value]:
        raise SceneError(f"{what} is a {kind} without a \"{missing[0]}\": give it one")
    if kind == "volume":
        raise SceneError(f"{what} is a volume texture, and shapes here carry no such data: use an "
                         "image, or onespp.scenes.materials.palette")


def _read(filename: Any, what: str, bounds: validity.Bounds) -> np.ndarray:
    """The linear values of an image file, (h, w, 1) or (h, w, 3)."""
    if not Path(filename).is_file():
        raise SceneError(f"{what} names '{filename}', and there is no such file: correct the path, "
                         "relative ones start from the scene file's folder")
    try:
        bitmap = mi.Bitmap(str(filename))
        layout = mi.Bitmap.PixelFormat
        form = layout.Y if bitmap.pixel_format() in (layout.Y, layout.YA) else layout.RGB
        values = np.array(bitmap.convert(form, mi.Struct.Type.Float32, srgb_gamma=False))
    except RuntimeError as error:
        raise SceneError(f"{what} is the file '{filename}', which is no image that can be read "
                         f"({plain(error)}): save it again as PNG, JPEG or EXR") from None
    return validity.image(values, f"{what}, '{filename}',", bounds)


def _kind(name: str) -> Any:
    if name in textures.KINDS:
        return mi.ObjectType.Texture
    return mi.PluginManager.instance().plugin_type(name)


def _load(dictionary: dict[str, Any], what: str) -> Any:
    try:
        return mi.load_dict(dictionary, parallel=False, optimize=False)
    except RuntimeError as error:
        unknown = re.search(r'unreferenced propert.*? plugin of type "(\w+)":\s*- .*? "(.*?)"',
                            str(error), re.DOTALL)
        if unknown is None:
            raise SceneError(f"{what} is not one that Mitsuba takes: {plain(error)}") from None
        kind, name = unknown.groups()
        raise SceneError(f"{what} has a property '{name}', which a '{kind}' does not have: "
                         f"{_instead(kind, name)}") from None


@contextmanager
def _tried(what: str) -> Iterator[None]:
    """For calls that trace an object to see whether it can be."""
    try:
        with dr.suspend_grad():
            yield
    except RuntimeError as error:
        raise SceneError(f"{what} is not one that Mitsuba can evaluate: {plain(error)}") from None


def _surface() -> Any:
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(0, 0, 1)
    return si


def plain(error: Exception | str) -> str:
    """What Mitsuba says, without where in its own code, on one line."""
    said = " ".join(str(error).split())
    said = re.sub(r"^\[parser\.cpp:\d+\] (At|While loading) dictionary node \"[^\"]*\": ", "", said)
    said = re.sub(r"\[[\w.]+?(:\d+)?\] ?", "", said)
    said = re.sub(r"Texture::\w+\(\): not implemented!|nanobind\S+: tried to call a pure virtual "
                  r"function", "textures of data of vertices, such as a mesh_attribute, cannot be "
                  "there", said)
    said = "".join(letter if letter.isprintable() else "?" for letter in said)  # of damaged files
    return said.rstrip(".! ")[:400]


def _no_such(name: str, kind: Any, what: str) -> str:
    sort = "material" if kind == mi.ObjectType.BSDF else "material or texture"
    known = _BSDFS if sort == "material" else (*_BSDFS, *_TEXTURES)
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean '{close[0]}'?" if close else f"there are {', '.join(known)}"
    return f"{what} has the type '{name}', which is no {sort} of Mitsuba's: {hint}"


def _instead(kind: str, name: str) -> str:
    """The property that may have been meant: among those that an object of the kind shows."""
    try:
        shown = {key.split(".")[0] for key, _ in mi.traverse(mi.load_dict({"type": kind}))}
    except (RuntimeError, ValueError):  # it can't be without a property
        shown = set()
    close = difflib.get_close_matches(name, sorted(shown | _PROPERTIES), n=1)
    return f"did you mean '{close[0]}'?" if close else "leave it out"


# For hints alone.
_BSDFS = ("blendbsdf", "bumpmap", "conductor", "dielectric", "diffuse", "hair", "mask", "measured",
          "normalmap", "null", "plastic", "principled", "principledthin", "roughconductor",
          "roughdielectric", "roughplastic", "thindielectric", "twosided")
_TEXTURES = ("bitmap", "checkerboard", "mesh_attribute", "rgb", "spectrum", "uniform")
_PROPERTIES = {"reflectance", "diffuse_reflectance", "specular_reflectance", "base_color", "alpha",
               "specular_transmittance", "int_ior", "ext_ior", "distribution", "material",
               "nonlinear", "roughness", "metallic", "opacity", "raw", "wrap_mode", "filter_type",
               "sample_visible"}
