"""A glTF 2.0 file, `.gltf` or `.glb`: its JSON, its buffers, and what of it is not used.

A `.glb` is a header (magic, version 2, length) and chunks (length, type, data), of which the first
is JSON and the second, if there is one, the first buffer. A buffer may also be a file beside, or
base64 in the JSON.

A reader of our own: pygltflib is a raw document with 9 dependencies that leaves accessors, nodes
and animation to its user, trimesh loses animation, cameras and lights, and assimp-py has none
either. What is needed of the format is JSON and arrays.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
import urllib.parse
from pathlib import Path
from typing import Any

from onespp.scenes.description import SceneError
from onespp.scenes.validity import brief

from .item import Item

_JSON, _BINARY = 0x4E4F534A, 0x004E4942
SUPPORTED = (
    "KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior",
    "KHR_materials_transmission", "KHR_materials_volume", "KHR_mesh_quantization",
    "KHR_texture_transform")
_INSTEAD = {
    "KHR_draco_mesh_compression": "export without compression of meshes",
    "EXT_meshopt_compression": "export without compression of meshes",
    "KHR_texture_basisu": "export with PNG or JPEG textures",
    "EXT_texture_webp": "export with PNG or JPEG textures"}


class Document:
    """A file that was read.

    Attributes:
        root: the whole JSON. unused: what of the file is not used, in words -> where first.
        files: what was read so far: the file itself, buffers and images beside it.
    """

    def __init__(self, path: Path) -> None:
        """Raises SceneError: no such file, no glTF 2.0, or one that needs what is unknown here."""
        self._path, self._file = path, f"scene file '{path}'"
        if not path.is_file():
            raise SceneError(f"there is no {self._file}: "
                             f"{'it is a folder' if path.is_dir() else 'there is no such file'}")
        self._buffers: dict[int, bytes] = {}
        self.unused: dict[str, str] = {}
        self.files: dict[Path, None] = {}
        text, self._chunk = self._split(self._bytes(path, Item({}, "", self._file)))
        self.root = self._parsed(text)
        self._check()

    def _bytes(self, path: Path, item: Item) -> bytes:
        self.files[path] = None
        try:
            return path.read_bytes()
        except (OSError, ValueError) as error:
            raise item.error(f"'{brief(str(path))[1:-1]}' cannot be read "
                             f"({getattr(error, 'strerror', None) or 'it is no file name'}): "
                             "correct it") from None

    def _split(self, data: bytes) -> tuple[bytes, bytes | None]:
        """JSON, and the binary chunk of a `.glb`."""
        if data[:4] != b"glTF":
            return data, None
        cut = SceneError(f"{self._file}: it is cut off or damaged: export it again")
        if len(data) < 20:
            raise cut
        version, length = struct.unpack_from("<II", data, 4)
        if version != 2:
            raise SceneError(f"{self._file}: it is glTF {version}: export it as glTF 2.0")
        if length > len(data):
            raise cut
        chunks: dict[int, bytes] = {}
        at = 12
        while at + 8 <= length:
            size, kind = struct.unpack_from("<II", data, at)
            if at + 8 + size > length:
                raise cut
            chunks.setdefault(kind, data[at + 8:at + 8 + size])
            at += 8 + size
        if _JSON not in chunks:
            raise cut
        return chunks[_JSON], chunks.get(_BINARY)

    def _parsed(self, text: bytes) -> Item:
        try:
            value = json.loads(text.decode("utf-8-sig"), parse_constant=_refuse)
        except (ValueError, RecursionError) as error:
            place = f" (line {error.lineno}, column {error.colno})" if isinstance(
                error, json.JSONDecodeError) else ""
            raise SceneError(f"{self._file}: it is no glTF that can be read{place}: export it "
                             "again") from None
        if not isinstance(value, dict):
            raise SceneError(f"{self._file}: it is JSON, but no glTF: export it again")
        return Item(value, "", self._file)

    def _check(self) -> None:
        asset = self.root.part("asset")
        version = asset.text("version")
        if not version.startswith("2."):
            raise asset.error(f"the version is {brief(version)}: export it as glTF 2.0")
        for item, name in self.root.texts("extensionsRequired"):
            if name not in SUPPORTED:
                raise item.error(f"{brief(name)} cannot be read here: "
                                 f"{_INSTEAD.get(name, 'export without it')}")
        for item, name in self.root.texts("extensionsUsed"):
            if name not in SUPPORTED:
                self.leave(item, f"the extension {brief(name)}")

    def leave(self, item: Item, what: str) -> None:
        """Note that something of the file is not used."""
        self.unused.setdefault(what, item.path)

    @property
    def name(self) -> str:
        return self._path.name

    def refer(self, item: Item, name: str, to: str, among: Item | None = None) -> Item:
        """The object that an index, `name` of an item, is of in the file's list `to`.

        among: what holds the list, if not the root.
        """
        return self.numbered(item, item.whole(name), name, to, among)

    def numbered(self, item: Item, index: int, name: str, to: str,
                 among: Item | None = None) -> Item:
        parts = (self.root if among is None else among).parts(to)
        if index >= len(parts):
            raise item.error(f"its {name} is {index}, and there are {len(parts)} {to}: export the "
                             "file again")
        return parts[index]

    def view(self, view: Item) -> memoryview:
        """The bytes of an item of `bufferViews`."""
        if view.extension("EXT_meshopt_compression").value:
            self.leave(view, "the compressed form of buffers")
        buffer = self.refer(view, "buffer", "buffers")
        data = self._buffer(buffer, view.whole("buffer"))
        start, size = view.whole("byteOffset", 0), view.whole("byteLength")
        if start + size > len(data):
            raise view.error(f"it ends at byte {start + size} of a buffer of {len(data)}: export "
                             "the file again")
        return memoryview(data)[start:start + size]

    def _buffer(self, buffer: Item, index: int) -> bytes:
        if index not in self._buffers:
            size = buffer.whole("byteLength")
            if "uri" in buffer:
                data = self.content(buffer)
            elif index == 0 and self._chunk is not None:
                data = self._chunk
            else:
                raise buffer.error("it has no data: export the file again")
            if len(data) < size:
                raise buffer.error(f"it should have {size} bytes and has {len(data)}: the file "
                                   "is cut off, export it again")
            self._buffers[index] = data[:size]
        return self._buffers[index]

    def content(self, item: Item) -> bytes:
        """What an item's `uri` names: a file beside, or the data that it is itself."""
        uri = item.text("uri")
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            try:
                return (base64.b64decode(body, validate=True) if head.endswith(";base64")
                        else urllib.parse.unquote_to_bytes(body))
            except (binascii.Error, ValueError):
                raise item.error("its data are no base64: export the file again") from None
        if urllib.parse.urlsplit(uri[:8]).scheme or not uri:
            raise item.error(f"its uri is {brief(uri)}: use the path of a file beside this one")
        path = self._path.parent / urllib.parse.unquote(uri)
        try:
            there = path.is_file()
        except (OSError, ValueError):
            there = False
        if not there:
            raise item.error(f"it names {brief(uri)}, and there is no such file: relative paths "
                             "start from the scene file's folder")
        return self._bytes(path, item)


def _refuse(constant: str) -> Any:
    raise ValueError(f"{constant} is no JSON")
