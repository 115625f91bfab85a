"""Accessors: what is in the buffers, as arrays.

An accessor is `count` elements of 1 to 4 components at a stride in a view of a buffer, or zeros
where it has no view, of which a sparse one replaces some. Normalised whole numbers become c / most,
of signed ones max(c / most, -1) (glTF 2.0, section 3.11).
"""

from __future__ import annotations

import numpy as np

from onespp.scenes.validity import brief

from .document import Document
from .item import Item

_COMPONENTS = {5120: np.dtype("i1"), 5121: np.dtype("u1"), 5122: np.dtype("<i2"),
               5123: np.dtype("<u2"), 5125: np.dtype("<u4"), 5126: np.dtype("<f4")}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_MOST = 1 << 28  # of numbers in one


class Accessors:
    """Reads each once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._made: dict[str, np.ndarray] = {}

    def floats(self, item: Item, name: str, kind: str, whole: bool = False) -> np.ndarray:
        """(n,) or (n, k) float64 of the accessor that `name` of an item refers to.

        Args:
            kind: "SCALAR", "VEC3" or the like; of several, "VEC3 VEC4".
            whole: plain whole numbers will do, which by rule have to be normalised.
        """
        accessor, values = self._read(item, name, kind)
        if values.dtype.kind == "f":
            return values.astype(np.float64)
        if not accessor.flag("normalized"):
            if not whole:
                raise accessor.error("it holds whole numbers that are not normalised, where "
                                     f"{name} needs fractions: export it as float")
            return values.astype(np.float64)
        most = np.iinfo(values.dtype).max
        return np.maximum(values / most, -1.0)

    def indices(self, item: Item, name: str) -> np.ndarray:
        """(n,) int64."""
        accessor, values = self._read(item, name, "SCALAR")
        if values.dtype.kind != "u":
            raise accessor.error(f"its components are of type {values.dtype.name}: indices are "
                                 "unsigned")
        return values.astype(np.int64)

    def _read(self, item: Item, name: str, kind: str) -> tuple[Item, np.ndarray]:
        accessor = self._document.refer(item, name, "accessors")
        if accessor.text("type") not in kind.split():
            raise accessor.error(f"its type is {brief(accessor.text('type'))}: {name} is "
                                 f"{' or '.join(kind.split())}")
        if accessor.path not in self._made:
            self._made[accessor.path] = self._array(accessor)
        return accessor, self._made[accessor.path]

    def _array(self, accessor: Item) -> np.ndarray:
        width, count = _WIDTHS[accessor.text("type")], accessor.whole("count", least=1)
        if count * width > _MOST:
            raise accessor.error(f"it has {count} elements: use at most {_MOST // width}")
        dtype = _dtype(accessor)
        if "bufferView" in accessor:
            values = self._packed(accessor, accessor, count, width, dtype)
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            values = self._replaced(accessor.part("sparse"), values)
        return values[:, 0] if width == 1 else values

    def _packed(self, holder: Item, place: Item, count: int, width: int,
                dtype: np.dtype) -> np.ndarray:
        """(count, width) of the buffer view that an item names; place: has its byteOffset."""
        view = self._document.refer(holder, "bufferView", "bufferViews")
        data, start = self._document.view(view), place.whole("byteOffset", 0)
        size = width * dtype.itemsize
        stride = view.whole("byteStride", 0, most=252) or size
        if stride < size or start + stride * (count - 1) + size > len(data):
            raise holder.error(f"its {count} elements do not fit into {view.path}, which has "
                               f"{len(data)} bytes: export the file again")
        return np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize))

    def _replaced(self, sparse: Item, values: np.ndarray) -> np.ndarray:
        """Values of which some are others."""
        count = sparse.whole("count", least=1, most=len(values))
        places, new = sparse.part("indices"), sparse.part("values")
        kind = _dtype(places)
        if kind.kind != "u":
            raise places.error(f"its components are of type {kind.name}: indices are unsigned")
        at = self._packed(places, places, count, 1, kind)[:, 0]
        if at.max() >= len(values):
            raise places.error(f"it names element {at.max()} of {len(values)}: export the file "
                               "again")
        made = values.copy()
        made[at] = self._packed(new, new, count, values.shape[1], values.dtype)
        return made


def _dtype(item: Item) -> np.dtype:
    kind = item.whole("componentType")
    if kind not in _COMPONENTS:
        raise item.error(f"its componentType is {kind}: there are "
                         f"{', '.join(map(str, _COMPONENTS))}")
    return _COMPONENTS[kind]
