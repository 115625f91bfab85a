"""Pixels by what makes them hard to denoise, worked out from matrices, guides and the reference.

Each pixel is in the first of these classes that it fits (`CAUSES`, and `about` below), and in one
class of history length: for how many frames in a row its surface has been seen, this one included.

The order is from what leaves a method the least to go on. Without a history nothing else matters.
Reflections come before motion, light and edges, for what is seen in a glossy surface moves, changes
and has edges of its own, which the surface's matrix and guides do not tell: their error has that
cause, wherever the surface is. A frame without the channel `roughness` has no glossy pixels.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from onespp.denoise.geometry.correspondence import MIN_COSINE, NOWHERE, carry, has_surface
from onespp.denoise.metrics.luminance import luminance
from onespp.render.files.sequence import Reference
from onespp.render.frame import Frame

CAUSES = MappingProxyType({
    "background": "there is no surface",
    "disoccluded": "the surface was not seen in the frame before",
    "glossy": "reflections are seen in the surface: a glossy lobe with a GGX alpha of at most 0.25",
    "moving": "the object's matrix has changed",
    "light": "the reference has changed along the motion, in a 5x5 window, by more than 5 % and "
             "4 standard deviations of its noise: moving shadows, lights and dull reflections",
    "edge": "another object, or a normal more than 26 degrees off, in the 3x3 window",
    "static": "none of the above",
})
BACKGROUND = 0
HISTORIES = MappingProxyType({"1": 1, "2-3": 2, "4-7": 4, "8-15": 8, "16+": 16})
"""Class -> its shortest history, frames."""

MOST_ROUGH = 0.25
LIGHT_WINDOW, LIGHT_CHANGE, LIGHT_SIGMAS = 2, 0.05, 4.0
_SMALLEST_ALBEDO = 0.01


def causes(previous: Frame, current: Frame, source: np.ndarray, lit: np.ndarray) -> np.ndarray:
    """(h, w) index into `CAUSES`.

    Args:
        source: `correspondence.previous_pixel`. lit: `changed_light`.
    """
    surface = has_surface(current)
    tests = (~surface, source == NOWHERE, glossy(current), moving(previous, current), lit,
             near_edge(current), np.ones_like(surface))
    return np.argmax(np.stack(tests), axis=0)


def lengthen(history: np.ndarray | None, source: np.ndarray) -> np.ndarray:
    """(h, w) length of history in frames, from that of the frame before."""
    if history is None:
        return np.ones(source.shape, np.int64)
    return np.where(source == NOWHERE, 1, carry(history, source) + 1)


def history_class(history: np.ndarray) -> np.ndarray:
    """(h, w) index into `HISTORIES`."""
    return np.searchsorted(list(HISTORIES.values()), history, side="right") - 1


def changed_light(previous: Frame, current: Frame, before: Reference, now: Reference,
                  source: np.ndarray) -> np.ndarray:
    """(h, w) mask: the light on the surface has changed since the frame before.

    Compares luminance, divided by that of the albedo where frames have one (a texture falls on
    pixel centres differently in each frame), as means over the pixels with a history in the
    window. Nothing has changed where a reference's variance is not known.
    """
    (l0, v0), (l1, v1) = _light(previous, before), _light(current, now)
    known = (source != NOWHERE) & np.isfinite(l1 + v1)
    old, old_variance = carry(l0, source), carry(v0, source)
    known &= np.isfinite(old + old_variance)
    count = np.maximum(_window_sum(known), 1)
    change = np.abs(_window_sum(np.where(known, l1 - old, 0))) / count
    level = _window_sum(np.where(known, np.maximum(l1, old), 0)) / count
    sigma = np.sqrt(_window_sum(np.where(known, v1 + old_variance, 0))) / count
    return known & (change > LIGHT_CHANGE * level) & (change > LIGHT_SIGMAS * sigma)


def glossy(frame: Frame) -> np.ndarray:
    """(h, w) mask: the surface shows reflections; none where frames lack `roughness`."""
    if "roughness" not in frame:
        return np.zeros((frame.height, frame.width), bool)
    return frame["roughness"] <= MOST_ROUGH


def near_edge(frame: Frame) -> np.ndarray:
    """(h, w) mask: an edge of an object or a crease within one pixel, diagonals included."""
    id_, normal = frame["id"], frame["normal"]
    edge = np.zeros(id_.shape, bool)
    h, w = id_.shape
    for dy, dx in ((0, 1), (1, -1), (1, 0), (1, 1)):
        a = np.s_[:h - dy, max(-dx, 0):w - max(dx, 0)]
        b = np.s_[dy:, max(dx, 0):w - max(-dx, 0)]
        cosine = np.einsum("hwc,hwc->hw", normal[a], normal[b])
        differ = (id_[a] != id_[b]) | ((id_[a] >= 0) & (cosine < MIN_COSINE))
        edge[a] |= differ
        edge[b] |= differ
    return edge


def moving(previous: Frame, current: Frame) -> np.ndarray:
    """(h, w) mask: the object's matrix has changed."""
    count = len(current.world_from_object)
    changed = np.array([not np.array_equal(current.world_from_object[i], m)
                        for i, m in enumerate(previous.world_from_object[:count])])
    return (current["id"] >= 0) & changed[np.clip(current["id"], 0, len(changed) - 1)]


def _light(frame: Frame, reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) float64 luminance without texture, and its variance."""
    albedo = 1.0
    if "albedo" in frame:
        albedo = np.maximum(luminance(frame["albedo"].astype(np.float64)), _SMALLEST_ALBEDO)
    deviation = luminance(np.sqrt(np.maximum(reference.variance, 0).astype(np.float64)))
    # Colours of one path rise and fall together: their deviations add.
    return luminance(reference.color.astype(np.float64)) / albedo, (deviation / albedo) ** 2


def _window_sum(image: np.ndarray) -> np.ndarray:
    """Sums over (2 LIGHT_WINDOW + 1)^2 pixels, those inside the image."""
    total = image.astype(np.float64)
    for axis in (0, 1):
        margins = [(0, 0), (0, 0)]
        margins[axis] = (LIGHT_WINDOW + 1, LIGHT_WINDOW)
        running = np.cumsum(np.pad(total, margins), axis=axis)
        size = 2 * LIGHT_WINDOW + 1
        total = (running[size:] - running[:-size] if axis == 0
                 else running[:, size:] - running[:, :-size])
    return total
