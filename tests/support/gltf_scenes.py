"""glTF files written by code, each with the same scene as a dictionary of Mitsuba's.

Each function writes a file into a folder and returns its path, the frame to look at, and what
Mitsuba makes of that moment, from its own rectangles, cubes and lights: nothing of it comes from
the file. Pictures are 48x32, vertical fields of view.
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from onespp.scenes.transforms import Matrix, rotate, scale, translate

from .xml_scenes import write_png

WIDTH, HEIGHT, FOV = 48, 32, 45.0
QUAD = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
QUAD_UV = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
GREY, LAMP = 0.6, (9.0, 8.0, 7.0)
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_CODES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125,
          "float32": 5126}
EYE = translate((0.3, 1.2, 4)) @ rotate((1, 0, 0), -12)


class Writer:
    """JSON of a glTF file and its one buffer."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [],
            "meshes": [], "accessors": [], "bufferViews": [], "materials": [],
            "cameras": [{"type": "perspective", "perspective": {
                "yfov": np.radians(FOV), "aspectRatio": WIDTH / HEIGHT, "znear": 0.1}}]}

    def put(self, kind: str, value: dict[str, Any]) -> int:
        """The index of another item of a list."""
        self.json.setdefault(kind, []).append(value)
        return len(self.json[kind]) - 1

    def view(self, data: bytes, **more: Any) -> int:
        self.data += b"\0" * (-len(self.data) % 4)
        index = self.put("bufferViews", {"buffer": 0, "byteOffset": len(self.data),
                                         "byteLength": len(data), **more})
        self.data += data
        return index

    def array(self, values: Any, dtype: str = "float32", **more: Any) -> int:
        """An accessor."""
        array = np.asarray(values, dtype)
        return self.put("accessors", {
            "bufferView": self.view(array.tobytes()), "componentType": _CODES[dtype],
            "count": len(array), "type": _TYPES[array[0].size], **more})

    def mesh(self, positions: int, material: int | None = None, **more: Any) -> int:
        attributes = {"POSITION": positions, **more.pop("attributes", {})}
        primitive = {"attributes": attributes, **more}
        return self.put("meshes", {"primitives": [
            primitive if material is None else {**primitive, "material": material}]})

    def node(self, root: bool = True, **value: Any) -> int:
        index = self.put("nodes", value)
        if root:
            self.json["scenes"][0]["nodes"].append(index)
        return index

    def placed(self, matrix: Matrix, **value: Any) -> int:
        return self.node(matrix=matrix.T.ravel().tolist(), **value)

    def grey(self, **more: Any) -> int:
        """A matt material."""
        return self.put("materials", {"pbrMetallicRoughness": {
            "baseColorFactor": [GREY, GREY, GREY, 1], "metallicFactor": 0}, **more})

    def channel(self, node: int, path: str, times: Any, values: Any, form: str) -> None:
        animation = self.json.setdefault("animations", [{"channels": [], "samplers": []}])[0]
        animation["samplers"].append({"input": self.array(times), "output": self.array(values),
                                      "interpolation": form})
        animation["channels"].append({"sampler": len(animation["samplers"]) - 1,
                                      "target": {"node": node, "path": path}})

    def glb(self, path: Path) -> Path:
        self.json["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + b"\0" * (-len(self.data) % 4)
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data))
                         + struct.pack("<I4s", len(text), b"JSON") + text
                         + struct.pack("<I4s", len(data), b"BIN\0") + data)
        return path

    def gltf(self, path: Path, beside: str = "") -> Path:
        """Its buffer in the file, or in one beside it."""
        uri = beside or ("data:application/octet-stream;base64,"
                         + base64.b64encode(self.data).decode())
        if beside:
            (path.parent / beside).write_bytes(self.data)
        self.json["buffers"] = [{"byteLength": len(self.data), "uri": uri}]
        path.write_text(json.dumps(self.json))
        return path


Made = tuple[Path, int, dict[str, Any]]


def moving(folder: Path) -> Made:
    """A .glb whose box, its parent and the camera move, each by another interpolation."""
    w = Writer()
    quad = w.array(QUAD)
    floor = w.mesh(quad, w.grey(), mode=5, indices=w.array([0, 1, 3, 2], "uint8"))  # a strip
    lamp = w.mesh(quad, w.grey(emissiveFactor=[1, 8 / 9, 7 / 9], extensions={
        "KHR_materials_emissive_strength": {"emissiveStrength": LAMP[0]}}), mode=6)  # a fan
    box = w.mesh(w.array(_BOX[0]), w.grey(), indices=w.array(_BOX[1].ravel(), "uint16"),
                 attributes={"NORMAL": w.array(_BOX[2])})
    w.placed(_FLOOR, mesh=floor, name="floor")
    w.placed(_LAMP, mesh=lamp, name="lamp")
    child = w.node(root=False, mesh=box, name="box", scale=[0.4, 0.4, 0.4])
    parent = w.node(children=[child], name="turntable")
    camera = w.node(camera=0, name="eye")
    # At frame 12: rotation half of 90 degrees, height the spline's middle, the second step.
    half = np.sqrt(0.5)
    w.channel(child, "rotation", [0, 1], [(0, 0, 0, 1), (0, half, 0, half)], "LINEAR")
    w.channel(child, "scale", [0, 0.25, 1], [(0.1,) * 3, (0.4, 0.6, 0.4), (0.1,) * 3], "STEP")
    w.channel(parent, "translation", [0, 1], [
        (0, 0, 0), (0, 0, 0), (0, 2.4, 0), (-4, 0, 0), (1, 0.5, 0), (0, 0, 0)], "CUBICSPLINE")
    w.channel(camera, "translation", [0, 1], [EYE[:3, 3] - (1, 0, 0), EYE[:3, 3] + (1, 0, 0)],
              "LINEAR")
    w.channel(camera, "rotation", [0], [_quaternion(EYE)], "STEP")
    # Hermite at 1/2: half of both values, an eighth of the slopes' difference.
    at = translate((0.5 + 4 / 8, 0.25 + 2.4 / 8, 0))
    return w.glb(folder / "moving.glb"), 12, _scene(EYE, {
        "floor": _shape("rectangle", _FLOOR), "lamp": _shape("rectangle", _LAMP, LAMP),
        "box": _shape("cube", at @ rotate((0, 1, 0), 45) @ scale((0.4, 0.6, 0.4)))})


def pictured(folder: Path) -> Made:
    """A .gltf with files beside: textures of all kinds, holes, a veil, a pane, a picture's lamp."""
    w, rng = Writer(), np.random.default_rng(3)
    colors, data = (rng.uniform(0.1, 0.9, (6, 8, 3)) for _ in range(2))
    data[..., 2] = data[..., 2] > 0.7
    bumps = np.clip(0.5 + rng.normal(0, 0.08, (6, 8, 3)), 0, 1)
    bumps[..., 2] = 1
    glow = rng.uniform(0, 1, (4, 4, 3))
    leaf = np.ones((4, 4, 4))
    leaf[..., 3] = rng.uniform(0, 1, (4, 4))
    pictures = {name: np.round(pixels * 255) / 255 for name, pixels in (
        ("colors", colors), ("data", data), ("bumps", bumps), ("glow", glow), ("leaf", leaf))}
    texture: dict[str, int] = {}
    for name, pixels in pictures.items():
        write_png(folder / f"{name} a.png", pixels)
        source = w.put("images", {"uri": f"{name}%20a.png"})
        texture[name] = w.put("textures", {"source": source, "sampler": w.put("samplers", {
            "wrapS": 33648, "wrapT": 33648} if name == "data" else {})})
    turn = {"KHR_texture_transform": {"offset": [0.25, 0.5], "rotation": 0.5, "scale": [2, 3]}}
    rich = w.put("materials", {"pbrMetallicRoughness": {
        "baseColorTexture": {"index": texture["colors"], "extensions": turn},
        "baseColorFactor": [1, 0.8, 0.6, 1], "metallicRoughnessTexture": {"index": texture["data"]},
        "roughnessFactor": 0.8}, "normalTexture": {"index": texture["bumps"], "scale": 0.7}})
    holes = w.grey(alphaMode="MASK", alphaCutoff=0.4)
    w.json["materials"][holes]["pbrMetallicRoughness"]["baseColorTexture"] = {
        "index": texture["leaf"]}
    veil = w.grey(alphaMode="BLEND", doubleSided=True)
    w.json["materials"][veil]["pbrMetallicRoughness"]["baseColorFactor"] = [0.8, 0.2, 0.2, 0.4]
    pane = w.put("materials", {
        "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.3},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.8}}})
    shining = w.put("materials", {
        "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": texture["glow"]}, "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 80}}})
    indices = w.array([0, 1, 2, 0, 2, 3], "uint16")
    quad = {"attributes": {"TEXCOORD_0": w.array(QUAD_UV)}, "indices": indices}
    for name, material, place in (("floor", rich, _FLOOR), ("lamp", shining, _LAMP),
                                  ("leaf", holes, _LEAF), ("veil", veil, _VEIL),
                                  ("pane", pane, _PANE)):
        w.placed(place, name=name, mesh=w.mesh(w.array(QUAD), material, **{
            **quad, "attributes": dict(quad["attributes"])}))
    w.placed(EYE, camera=0)
    p = {name: _linear(pixels[..., :3]) for name, pixels in pictures.items()}
    n = (2 * pictures["bumps"] - 1) * (0.7, 0.7, 1)
    n /= np.linalg.norm(n, axis=2, keepdims=True)
    c, s = np.cos(0.5), np.sin(0.5)
    to_uv = np.eye(4)
    to_uv[:2] = (2 * c, 3 * s, 0, 0.25), (-2 * s, 3 * c, 0, 0.5)
    base = _bitmap(p["colors"] * (1, 0.8, 0.6), to_uv=_transform(to_uv))
    surface = {"type": "twosided", "bsdf": {
        # v is up on the floor: the picture is mirrored there.
        "type": "normalmap", "normalmap": _bitmap(n * (1, -1, 1) / 2 + 0.5), "bsdf": {
            "type": "principled", "base_color": base, "metallic": _bitmap(
                pictures["data"][..., 2:], wrap_mode="mirror"),
            "roughness": _bitmap(pictures["data"][..., 1:2] * 0.8, wrap_mode="mirror")}}}
    return w.gltf(folder / "pictured.gltf", "pictured data.bin"), 0, _scene(EYE, {
        "floor": _shape("rectangle", _FLOOR, bsdf=surface),
        "lamp": _shape("rectangle", _LAMP, _bitmap(80 * p["glow"]), _principled(metallic=1.0)),
        "leaf": _shape("rectangle", _LEAF, bsdf={"type": "mask", "opacity": _bitmap(
            (pictures["leaf"][..., 3:] >= 0.4).astype(float), filter_type="nearest"),
            "bsdf": _principled(GREY)}),
        "veil": _shape("rectangle", _VEIL, bsdf={"type": "mask", "opacity": 0.4, "bsdf":
                                                 _principled((0.8, 0.2, 0.2))}),
        "pane": _shape("rectangle", _PANE, bsdf={
            "type": "principledthin", "base_color": _rgb((1, 1, 1)), "roughness": 0.3,
            "spec_trans": 0.8, "eta": 1.5, "diff_trans": 0.0})})


def lit(folder: Path) -> Made:
    """One file: the three lights, two nodes of one mesh of whole numbers, a sparse accessor."""
    w = Writer()
    w.json["extensionsUsed"] = w.json["extensionsRequired"] = [
        "KHR_lights_punctual", "KHR_mesh_quantization"]
    w.json["extensions"] = {"KHR_lights_punctual": {"lights": [
        {"type": "point", "intensity": 5, "color": [1, 0.8, 0.6]},
        {"type": "spot", "intensity": 30, "color": [0.4, 0.7, 1],
         "spot": {"innerConeAngle": np.radians(15), "outerConeAngle": np.radians(25)}},
        {"type": "directional", "intensity": 0.7}]}}
    box = w.mesh(w.array(np.pad(_BOX[0] * 127, ((0, 0), (0, 1))), "int8", normalized=True,
                         type="VEC3"), w.grey(), attributes={
        "NORMAL": w.array(np.pad(_BOX[2] * 127, ((0, 0), (0, 1))), "int8", normalized=True,
                          type="VEC3")}, indices=w.array(_BOX[1].ravel(), "uint32"))
    for accessor in w.json["accessors"][:2]:
        w.json["bufferViews"][accessor["bufferView"]]["byteStride"] = 4
    flat = w.put("accessors", {  # zeros but for what the sparse part says, of a view in a view
        "componentType": 5126, "count": 4, "type": "VEC3", "sparse": {
            "count": 4, "indices": {"bufferView": w.view(bytes([9, 0, 1, 2, 3])), "byteOffset": 1,
                                    "componentType": 5121},
            "values": {"bufferView": w.view(QUAD.tobytes())}}})
    w.placed(_FLOOR, name="floor", mesh=w.mesh(flat, w.grey(), indices=w.array(
        [0, 1, 2, 0, 2, 3], "uint8")))
    for place in _BOXES:
        w.placed(place, mesh=box, name="box")
    for i, place in enumerate(_LIGHTS):
        w.placed(place, extensions={"KHR_lights_punctual": {"light": i}})
    w.placed(EYE, camera=0)
    toward = [place @ scale((-1, 1, -1)) for place in _LIGHTS]  # Mitsuba's lights look along +z
    return w.gltf(folder / "lit.gltf"), 0, _scene(EYE, {
        "floor": _shape("rectangle", _FLOOR),
        **{f"box{i}": _shape("cube", place) for i, place in enumerate(_BOXES)},
        "point": {"type": "point", "intensity": _rgb((5, 4, 3)), "to_world": _transform(toward[0])},
        "spot": {"type": "spot", "intensity": _rgb((12, 21, 30)), "cutoff_angle": 25,
                 "beam_width": 15, "to_world": _transform(toward[1])},
        "sun": {"type": "directional", "irradiance": _rgb((0.7,) * 3),
                "to_world": _transform(toward[2])}})


def painted(folder: Path) -> Made:
    """Colours of vertices of all types: alone, with factors, with a picture, as holes and veils.

    Over a quad they are affine in u and v, so that pictures of the same are known.
    """
    w, rng = Writer(), np.random.default_rng(4)
    colors = np.round(rng.uniform(0.1, 0.9, (6, 8, 3)) * 255) / 255
    write_png(folder / "colors b.png", colors)
    w.put("textures", {"source": w.put("images", {"uri": "colors%20b.png"})})

    def affine(alpha: tuple[float, float, float] | None = None) -> tuple[np.ndarray, np.ndarray]:
        """(4, 3 or 4) at the corners and (64, 64, ...) as a picture."""
        at = rng.uniform(0.3, 0.7, 3), rng.uniform(-0.25, 0.25, 3), rng.uniform(-0.25, 0.25, 3)
        c, across, down = at if alpha is None else (np.append(a, b) for a, b in zip(at, alpha))
        middle = (np.arange(64) + 0.5) / 64
        return (c + QUAD_UV[:, :1] * across + QUAD_UV[:, 1:] * down,
                c + middle[None, :, None] * across + middle[:, None, None] * down)

    def quad(name: str, place: Matrix, material: int, corners: Any, dtype: str = "float32") -> None:
        most = 1 if dtype == "float32" else np.iinfo(dtype).max
        attributes = {"TEXCOORD_0": w.array(QUAD_UV)}
        if corners is not None:
            attributes["COLOR_0"] = w.array(np.round(corners * most) if most > 1 else corners,
                                            dtype, normalized=most > 1)
        w.placed(place, name=name, mesh=w.mesh(w.array(QUAD), material, attributes=attributes,
                                               indices=w.array([0, 1, 2, 0, 2, 3], "uint16")))

    tinted, papered, holes, veil = (w.grey(alphaMode=mode) for mode in (
        "OPAQUE", "OPAQUE", "MASK", "BLEND"))
    factors = [(1, 0.8, 0.6), (1, 0.9, 0.8), (GREY,) * 3, (1, 1, 1)]
    for material, factor in zip((tinted, papered, holes, veil), factors):
        w.json["materials"][material]["pbrMetallicRoughness"]["baseColorFactor"] = [*factor, 1]
    w.json["materials"][papered]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    w.json["materials"][holes]["alphaCutoff"] = 0.375
    floor, pane, leaf, veiled = affine(), affine(), affine((0, 1, 0)), affine((0.2, 0.3, 0.4))
    quad("floor", _FLOOR, papered, floor[0])
    quad("pane", _PANE, tinted, pane[0], "uint16")
    quad("plain", _PLAIN, tinted, None)
    quad("leaf", _LEAF, holes, leaf[0])
    quad("veil", _VEIL, veil, veiled[0], "uint8")
    quad("lamp", _LAMP, w.grey(emissiveFactor=[1, 1, 1], extensions={
        "KHR_materials_emissive_strength": {"emissiveStrength": LAMP[0]}}), None)
    w.placed(EYE, camera=0)

    def surface(base: np.ndarray) -> dict[str, Any]:
        return {"type": "twosided", "bsdf": {"type": "principled", "base_color": _bitmap(
            base, wrap_mode="clamp"), "roughness": 1.0, "metallic": 0.0}}

    # Fine enough that the picture, interpolated between its texels, is the product of both.
    u, v = ((np.arange(n) + 0.5) / n * k - 0.5 for n, k in ((512, 8), (384, 6)))
    p = _between(_linear(colors), v, u)
    fine = np.stack([floor[0][0, i] + (np.arange(512) + 0.5)[None] / 512 * (
        floor[0][1] - floor[0][0])[i] + (np.arange(384) + 0.5)[:, None] / 384 * (
        floor[0][3] - floor[0][0])[i] for i in range(3)], -1)
    return w.gltf(folder / "painted.gltf"), 0, _scene(EYE, {
        "floor": _shape("rectangle", _FLOOR, bsdf=surface(p * fine * factors[1])),
        "pane": _shape("rectangle", _PANE, bsdf=surface(pane[1] * factors[0])),
        "plain": _shape("rectangle", _PLAIN, bsdf=_principled(factors[0])),
        "leaf": _shape("rectangle", _LEAF, bsdf={"type": "mask", "opacity": _bitmap(
            (leaf[1][..., 3:] >= 0.375).astype(float), filter_type="nearest"),
            "bsdf": surface(GREY * leaf[1][..., :3])}),
        "veil": _shape("rectangle", _VEIL, bsdf={"type": "mask", "opacity": _bitmap(
            veiled[1][..., 3:], wrap_mode="clamp"), "bsdf": surface(veiled[1][..., :3])}),
        "lamp": _shape("rectangle", _LAMP, (LAMP[0],) * 3)})


SCENES: dict[str, Callable[[Path], Made]] = {"moving": moving, "pictured": pictured, "lit": lit}

_FLOOR = rotate((1, 0, 0), -90) @ scale(3)
_LAMP = translate((0, 3, 0)) @ rotate((1, 0, 0), 90) @ scale((0.8, 0.6, 1))
_LEAF = translate((-0.8, 0.7, 0.2)) @ rotate((0, 1, 0), 30) @ scale(0.6)
_VEIL = translate((0.9, 0.8, 0.5)) @ rotate((0, 1, 0), -20) @ scale(0.5)
_PANE = translate((0, 0.8, -0.8)) @ scale(0.7)
_PLAIN = translate((1.6, 0.5, -0.9)) @ rotate((0, 1, 0), -30) @ scale(0.5)
_BOXES = (translate((-0.7, 0.4, 0)) @ scale(0.4),
          translate((0.8, 0.5, -0.5)) @ rotate((0, 1, 0), 25) @ scale((-0.3, 0.5, 0.3)))
_LIGHTS = (translate((-1, 2, 1.5)), translate((1.5, 3, 0.5)) @ rotate((1, 0, 0), -80),
           rotate((0, 1, 0), 40) @ rotate((1, 0, 0), -50))


def _cube() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions (24, 3) of the cube [-1, 1]^3, faces (12, 3), normals (24, 3)."""
    positions, faces, normals = [], [], []
    for axis in range(3):
        for side in (-1, 1):
            n, s = np.zeros(3), np.zeros(3)
            n[axis], s[(axis + 1) % 3] = side, 1
            t = np.cross(n, s)
            start = len(positions)
            positions += [n + a * s + b * t for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            normals += [n] * 4
            faces += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    return np.array(positions), np.array(faces), np.array(normals)


_BOX = _cube()


def _quaternion(matrix: Matrix) -> tuple[float, float, float, float]:
    """(x, y, z, w) of a rotation about x."""
    half = np.arctan2(matrix[2, 1], matrix[1, 1]) / 2
    return float(np.sin(half)), 0.0, 0.0, float(np.cos(half))


def _linear(srgb: np.ndarray) -> np.ndarray:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _between(pixels: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """A picture that repeats, at (rows x columns) places between its texels, whose middles are
    whole numbers."""
    for axis, at in enumerate((rows, columns)):
        low, size = np.floor(at).astype(int), pixels.shape[axis]
        share = (at - low).reshape([-1 if i == axis else 1 for i in range(3)])
        pixels = ((1 - share) * np.take(pixels, low % size, axis)
                  + share * np.take(pixels, (low + 1) % size, axis))
    return pixels


def _rgb(color: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": list(map(float, color))}


def _bitmap(pixels: np.ndarray, **more: Any) -> dict[str, Any]:
    from onespp.render.mitsuba.variant import mi
    return {"type": "bitmap", "bitmap": mi.Bitmap(pixels.astype(np.float32)), "raw": True, **more}


def _transform(matrix: Matrix) -> Any:
    from onespp.render.mitsuba.variant import mi
    return mi.ScalarTransform4f(matrix.tolist())


def _principled(color: Any = 1.0, metallic: float = 0.0) -> dict[str, Any]:
    color = (color,) * 3 if np.ndim(color) == 0 else color
    return {"type": "twosided", "bsdf": {"type": "principled", "base_color": _rgb(color),
                                         "roughness": 1.0, "metallic": metallic}}


def _shape(kind: str, place: Matrix, radiance: Any = None, bsdf: Any = None) -> dict[str, Any]:
    made = {"type": kind, "to_world": _transform(place), "bsdf": bsdf or _principled(GREY)}
    if radiance is not None:
        made["emitter"] = {"type": "area", "radiance": radiance if isinstance(radiance, dict)
                           else _rgb(radiance)}
    return made


def _scene(eye: Matrix, parts: dict[str, Any]) -> dict[str, Any]:
    return {"type": "scene", "integrator": {"type": "path", "max_depth": 8}, "sensor": {
        "type": "perspective", "fov": FOV, "fov_axis": "y",
        "to_world": _transform(eye @ scale((-1, 1, -1))),
        "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}}},
        **parts}
