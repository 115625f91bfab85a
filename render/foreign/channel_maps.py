"""Which channels of a file are what: by a renderer's names, or as the user says.

A source is the name of an image in the file, without the letter of its component: the image
`ViewLayer.Normal` is in `ViewLayer.Normal.X`, `.Y` and `.Z`. The image "" is in `R`, `G` and `B`.

Blender: passes of a view layer, with `Noisy Image` (the pass "Denoising Data") for `Combined`, of
which the noise may have been removed already. Depth is camera-space z; `Vector` is pixels to the
frame before, y up.

Mitsuba: what the integrator `aov` writes, whose names are the user's: the letters T (distance),
I (IDs) and U, V tell some, the rest is looked at: vectors of length one are normals, others
positions; a second image of R, G and B is the albedo, unless it is radiance: what an integrator
makes has an A, and that of the first one is in the file twice.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from onespp.render.errors import InputError

LETTERS = {  # component count -> letters that components may have
    1: ("", "Z", "V", "T", "I", "Y", "X", "R", "A"),
    2: ("XY", "RG", "UV", "xy"),
    3: ("RGB", "XYZ", "rgb", "xyz"),
}
COMPONENTS = {"color": 3, "albedo": 3, "normal": 3, "position": 3, "depth": 1, "distance": 1,
              "id": 1, "motion": 2}
"""What a file may hold, and of how many components."""

NONE = "none"
LAYOUTS = ("auto", "games202", "blender", "mitsuba")
_BLENDER = {"color": ("Noisy Image", "Combined"), "albedo": ("Denoising Albedo",),
            "normal": ("Normal", "Denoising Normal"), "position": ("Position",),
            "depth": ("Depth", "Z"), "id": ("IndexOB",), "motion": ("Vector",)}
_ROOTS = ("<root>", "root", "rgba", "beauty")  # layers, or parts of a file, of radiance
_SAME_LENGTH = 0.02  # of 1, of the median normal


@dataclass(frozen=True)
class ChannelMap:
    """name of `COMPONENTS` -> the file's channels, in the order of components.

    up: motion has y up.
    """

    channels: Mapping[str, tuple[str, ...]]
    up: bool = False


def channel_map(images: Mapping[str, np.ndarray], layout: str,
                given: Mapping[str, str]) -> ChannelMap:
    """What is what in a file with these images.

    Args:
        layout: one of `LAYOUTS` but games202. given: name of `COMPONENTS` -> source, which goes
            before what the layout says; `NONE` for what is not to be taken.

    Raises:
        InputError: a source is not there, there is no radiance, or it is not clear what is what.
    """
    for name in given:
        if name not in COMPONENTS:
            raise InputError(f"--channel {name}=... names no channel of an import: they are "
                             f"{', '.join(COMPONENTS)}")
    blender = layout == "blender" or (layout == "auto" and any(
        ".Combined" in name for name in images))
    found = _blender(images, given) if blender else _mitsuba(images, given)
    for name, source in given.items():
        found.pop(name, None)
        if source != NONE:
            found[name] = _components(name, source, images)
    if "color" not in found:
        raise InputError("has no radiance that is known by its name: say which channels it is, "
                         f"as --channel color=NAME (there are {_listed(images)})")
    if "depth" in found:
        found.pop("distance", None)
    return ChannelMap(found, up=blender)


def stacked(images: Mapping[str, np.ndarray], channels: tuple[str, ...]) -> np.ndarray:
    """(h, w) or (h, w, c) float32."""
    planes = [images[name].astype(np.float32) for name in channels]
    return planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)


def _components(name: str, source: str, images: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """The channels of a source."""
    for letters in LETTERS[COMPONENTS[name]]:
        channels = _names(source, letters)
        if all(channel in images for channel in channels):
            return channels
    raise InputError(f"has no {COMPONENTS[name]} channels of '{source}' for {name}: there are "
                     f"{_listed(images)}")


def _names(source: str, letters: str) -> tuple[str, ...]:
    """A source's channels by the letters of its components."""
    dot = "." if source else ""
    return tuple(f"{source}{dot}{letter}" for letter in letters) or (source,)


def _blender(images: Mapping[str, np.ndarray],
             given: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    layers = list(dict.fromkeys(name.rpartition(".Combined")[0] for name in images
                                if ".Combined" in name))
    layers = [s for s in layers if given.get("color", "").startswith(f"{s}.")] or layers
    if len(layers) > 1:
        raise InputError(f"has the view layers {', '.join(layers[:8])}: write one, or say which, "
                         f"as --channel color={layers[0]}.Combined")
    found = {}
    for layer in layers:
        for name, passes in _BLENDER.items():
            for word in passes:
                try:
                    found.setdefault(name, _components(name, f"{layer}.{word}", images))
                except InputError:  # this pass was not written
                    continue
    return found


def _mitsuba(images: Mapping[str, np.ndarray],
             given: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    sources: dict[str, str] = {}
    for name in images:
        source, _, letter = name.rpartition(".")
        sources[source] = sources.get(source, "") + letter
    found: dict[str, tuple[str, ...]] = {}
    colors = [s for s, letters in sources.items() if set("RGB") <= set(letters)]
    root = min(colors, key=lambda s: (bool(s), s.lower() not in _ROOTS, colors.index(s)),
               default=None)
    for source, letters in sources.items():
        name = _kind(source, letters, images, root)
        if name is None or name in given or source in given.values():
            continue
        if name in found:
            other = found[name][0].rpartition(".")[0]
            raise InputError(f"has two images that may be the {name}, '{other}' and '{source}': "
                             f"say which, as --channel {name}={source}, or none")
        found[name] = _components(name, source, images)
    return found


def _kind(source: str, letters: str, images: Mapping[str, np.ndarray],
          root: str | None) -> str | None:
    """What an image is by its letters and values, None for nothing of ours."""
    if set("RGB") <= set(letters):
        if root is None or source == root:
            return "color"
        copied = all(np.array_equal(images[a], images[b], equal_nan=True)
                     for a, b in zip(_names(source, "RGB"), _names(root, "RGB")))
        return None if copied or "A" in letters else "albedo"
    if set("XYZ") <= set(letters):
        vectors = stacked(images, _names(source, "XYZ"))
        lengths = np.linalg.norm(vectors, axis=-1)
        there = np.isfinite(lengths) & (lengths > 0)
        unit = there.any() and abs(float(np.median(lengths[there])) - 1) < _SAME_LENGTH
        return "normal" if unit else "position"
    return {"T": "distance", "I": "id"}.get(letters)


def _listed(images: Iterable[str]) -> str:
    names = [repr(name) for name in images]
    return ", ".join(names[:24]) + (f" and {len(names) - 24} more" if len(names) > 24 else "")
