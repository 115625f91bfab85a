"""A Mitsuba 3 XML file as a tree of plugins, by Mitsuba's own parser.

The parser reads includes, defaults and `$parameters`, brings files of older versions up to date and
resolves references; none of its plugins is built. A `Node` is one element in plain Python, and
knows where it stands, so that whoever cannot use it can say so.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from onespp.render.mitsuba.plugins import plain
from onespp.render.mitsuba.variant import mi
from onespp.scenes.description import SceneError
from onespp.scenes.validity import LARGEST

_PLACE = re.compile(r"^(?P<file>.*) \(line (?P<line>\d+), col (?P<column>\d+)\)$", re.DOTALL)
_FAILED = re.compile(r"Error while loading (?P<place>[^\n]*? \(line \d+, col \d+\)): ")
_MALFORMED = re.compile(r"Parsing of XML file .*? failed: (?P<what>.*?)"
                        r"( \(line (?P<line>\d+), col (?P<column>\d+)\))?$", re.DOTALL)
_UNDEFINED = re.compile(r"undefined parameter: \$?(?P<name>\w+)")
_UNUSED = re.compile(r"Found unused parameters:\s*- \$(?P<name>\w+)=")
_DEEPEST = 32


@dataclass(frozen=True, eq=False)
class Node:
    """One plugin of the file.

    Attributes:
        kind: "shape", "bsdf", "texture", "emitter", "sensor", "film", "integrator", ...
        plugin: as "roughplastic". id: as the file names it, or "".
        where: "scene file 'x.xml', line 3, column 5".
        values: in the file's order: numbers, texts, colours as (r, g, b), points as (3,) arrays,
            transforms as (4, 4) arrays, spectra as dictionaries of Mitsuba's, and nodes.
    """

    kind: str
    plugin: str
    id: str
    where: str
    values: Mapping[str, Any] = field(default_factory=dict)

    def error(self, what: str) -> SceneError:
        """What is wrong here, in one sentence."""
        return SceneError(f"{self.where}: {what}")

    def parts(self, *kinds: str) -> list[Node]:
        """The nodes in this one, of some kinds, or all."""
        return [value for value in self.values.values()
                if isinstance(value, Node) and (not kinds or value.kind in kinds)]

    def all_parts(self, kind: str) -> list[Node]:
        """The nodes of a kind in this one, in those, and so on, each once."""
        found: dict[Node, None] = {}
        left = self.parts(kind)[::-1]
        while left:
            node = left.pop()
            if node not in found:
                found[node] = None
                left += node.parts(kind)[::-1]
        return list(found)

    def number(self, name: str, default: float) -> float:
        """A number of the file's."""
        value = self.values.get(name, default)
        if (isinstance(value, bool) or not isinstance(value, int | float)
                or not abs(value) <= LARGEST):
            raise self.error(f"'{name}' of this {self.plugin} is {value!r}: use a number of up to "
                             f"{LARGEST:g}")
        return float(value)

    def matrix(self, name: str = "to_world") -> np.ndarray:
        """A transform of the file's, (4, 4) float64."""
        value = self.values.get(name)
        if value is None:
            return np.eye(4)
        if np.shape(value) != (4, 4) or not (abs(value) <= LARGEST).all():
            raise self.error(f"'{name}' of this {self.plugin} is no finite transform: correct it")
        if not np.array_equal(value[3], (0, 0, 0, 1)):
            raise self.error(f"'{name}' of this {self.plugin} is a projection: use an affine "
                             "transform")
        return value

    def triple(self, name: str, kind: str = "vector",
               default: tuple[float, float, float] | None = None) -> np.ndarray:
        """A point or another vector of the file's, (3,) float64."""
        value = np.asarray(self.values.get(name, default), float)
        if value.shape != (3,) or not (abs(value) <= LARGEST).all():
            raise self.error(f"'{name}' of this {self.plugin} is no {kind}: use x, y and z")
        return value

    def check_names(self, *names: str) -> None:
        """SceneError if it has another property, as by a slip of the pen."""
        for name, value in self.values.items():
            if name not in names and not isinstance(value, Node):
                raise self.error(f"a {self.plugin} has no property '{name}' here: there are "
                                 f"{', '.join(names)}")

    def path(self, name: str = "filename") -> Path:
        """A file that it names, which is there."""
        value = self.values.get(name)
        if not isinstance(value, str) or not value:
            raise self.error(f"this {self.plugin} names no file: give it a '{name}'")
        if not Path(value).is_file():
            raise self.error(f"this {self.plugin} names '{value}', and there is no such file: "
                             "correct the path, relative ones start from the scene file's folder")
        return Path(value)


def read_document(path: Path, parameters: Mapping[str, str]) -> tuple[Node, tuple[Path, ...]]:
    """The root of a file, a node of kind "scene"; and the file with all those that it names.

    Args:
        parameters: values for the file's `$name`.

    Raises:
        SceneError: no such file, or not one that Mitsuba can parse.
    """
    shown = f"scene file '{path}'"
    if not path.is_file():
        raise SceneError(f"there is no {shown}: "
                         f"{'it is a folder' if path.is_dir() else 'there is no such file'}")
    with _searching(path.absolute().parent):
        config = mi.parser.ParserConfig(mi.variant())
        try:
            state = mi.parser.parse_file(config, str(path), **parameters)
            mi.parser.transform_upgrade(config, state)
            mi.parser.transform_resolve(config, state)
        except (RuntimeError, TypeError) as error:
            raise _refused(str(error), shown) from None
        reader = _Reader(state)
        return reader.root(), tuple(dict.fromkeys((path, *sorted(reader.files))))


@contextmanager
def _searching(folder: Path) -> Iterator[None]:
    """Mitsuba looks for files in a folder first, as long as this lasts."""
    before = mi.file_resolver()
    resolver = mi.FileResolver(before)
    resolver.prepend(str(folder))
    mi.set_file_resolver(resolver)
    try:
        yield
    finally:
        mi.set_file_resolver(before)


class _Reader:
    """Nodes of a parsed file; what is referred to twice is one node."""

    def __init__(self, state: Any) -> None:
        self._state = state
        self._made: dict[int, Node] = {}
        self.files: set[Path] = set()

    def root(self) -> Node:
        root = self._node(0, ())
        if root.kind != "scene":
            raise root.error(f"the file holds a {root.kind}: give it a <scene>")
        return root

    def _node(self, index: int, inside: tuple[int, ...]) -> Node:
        if index in self._made:
            return self._made[index]
        node = self._state.nodes[index]
        place = mi.parser.file_location(self._state, node)
        where = _where(place)
        if stands := _PLACE.match(place):  # in an included file, perhaps
            self.files.add(Path(stands["file"]))
        if index in inside or len(inside) > _DEEPEST:
            raise SceneError(f"{where}: it is nested in itself, or more than {_DEEPEST} deep: use "
                             "a simpler one")
        properties = node.props
        values = {key: self._value(properties, key, where, (*inside, index))
                  for key, _ in properties.items()}
        kind = str(node.type).rpartition(".")[2].lower()
        self._made[index] = Node(kind, properties.plugin_name(), properties.id(), where, values)
        return self._made[index]

    def _value(self, properties: Any, key: str, where: str, inside: tuple[int, ...]) -> Any:
        value, types = properties[key], mi.Properties.Type
        kind = properties.type(key)
        if kind == types.ResolvedReference:
            return self._node(value.index(), inside)
        if kind == types.Color:
            return tuple(float(part) for part in value)
        if kind == types.Vector:
            return np.array([float(part) for part in value])
        if kind == types.Transform:
            return np.array(value.matrix, np.float64)
        if kind == types.Spectrum:
            return _spectrum(value)
        if kind == types.String and key == "filename":
            named = str(mi.file_resolver().resolve(value))
            self.files.add(Path(named))
            return named
        if isinstance(value, bool | int | float | str):
            return value
        raise SceneError(f"{where}: the value of '{key}' is of a kind that is not supported: use "
                         "numbers, texts, colours, transforms or spectra")


def _spectrum(value: Any) -> dict[str, Any]:
    """A dictionary of Mitsuba's."""
    if value.is_uniform():
        return {"type": "spectrum", "value": float(value.values[0])}
    pairs = zip(value.wavelengths, value.values)
    return {"type": "spectrum", "value": [(float(a), float(b)) for a, b in pairs]}


def _where(place: str) -> str:
    match = _PLACE.match(place)
    if match is None:
        return f"scene file '{place}'"
    return f"scene file '{match['file']}', line {match['line']}, column {match['column']}"


def _refused(error: str, shown: str) -> SceneError:
    """What the parser says, in our words where they are known."""
    if malformed := _MALFORMED.search(error):
        line = f", line {malformed['line']}, column {malformed['column']}"
        return SceneError(f"{shown}{line if malformed['line'] else ''}: it is no XML that can be "
                          f"read ({_small(malformed['what'])}): correct it")
    if unused := _UNUSED.search(error):
        return SceneError(f"{shown}: it has no parameter ${unused['name']}: leave out -D "
                          f"{unused['name']}=...")
    failed = list(_FAILED.finditer(error))  # of files in files: the innermost
    where = _where(failed[-1]["place"]) if failed else shown
    what = error[failed[-1].end():] if failed else error
    if "maximum include recursion" in what:
        return SceneError(f"{where}: files include each other without end: take one <include> out")
    if undefined := _UNDEFINED.search(what):
        name = undefined["name"]
        return SceneError(f"{where}: the parameter ${name} has no value: give it one, as -D "
                          f"{name}=VALUE, or a <default> in the file")
    return SceneError(f"{where}: {_small(plain(what))}")


def _small(text: str) -> str:
    return text[:1].lower() + text[1:]
