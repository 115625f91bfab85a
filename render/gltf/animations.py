"""What a file's animations do to nodes: keyed translations, rotations and scales.

Symbols: t a frame between two keys at t_k and t_(k+1), h = t_(k+1) - t_k, u = (t - t_k) / h in
[0, 1]; v_k a key's value, a_k and b_k the slopes into and out of it.

    STEP         v_k
    LINEAR       v_k + u (v_(k+1) - v_k); of rotations the shorter great arc (slerp)
    CUBICSPLINE  (2u^3 - 3u^2 + 1) v_k + h (u^3 - 2u^2 + u) b_k + (3u^2 - 2u^3) v_(k+1)
                 + h (u^3 - u^2) a_(k+1); of rotations then made unit length

Before its first and after its last key a value is that key's. All animations play at once, from
frame 0 on; where two move the same property of a node, the first does. (glTF 2.0, appendix C.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from onespp.scenes import quaternions
from onespp.scenes.validity import brief

from .accessors import Accessors
from .document import Document
from .item import Item

_KINDS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}
_FORMS = ("LINEAR", "STEP", "CUBICSPLINE")


@dataclass(frozen=True)
class Track:
    """A property over time.

    Attributes:
        times: (n,) frames, increasing. form: one of the three. turns: whether it is a rotation.
        values: (n, k), rotations as unit quaternions (w, x, y, z); of CUBICSPLINE (n, 3, k): slope
            into a key, value, slope out of it, per frame.
    """

    times: np.ndarray
    values: np.ndarray
    form: str
    turns: bool

    @property
    def is_still(self) -> bool:
        """Whether it is one value for ever."""
        if self.form == "CUBICSPLINE":
            inner = self.values[:, 1]
            slopes = self.values[:, (0, 2)]
            return bool((inner == inner[0]).all() and (len(inner) == 1 or not slopes.any()))
        return bool((self.values == self.values[0]).all())

    def at(self, frame: float) -> np.ndarray:
        """(k,)"""
        value = self._between(min(max(frame, self.times[0]), self.times[-1]))
        return value / np.linalg.norm(value) if self.turns else value

    def _between(self, t: float) -> np.ndarray:
        k = min(int(np.searchsorted(self.times, t, "right")) - 1, len(self.times) - 1)
        cubic = self.form == "CUBICSPLINE"
        values = self.values[:, 1] if cubic else self.values
        if k == len(self.times) - 1 or self.form == "STEP":
            return values[k]
        h = self.times[k + 1] - self.times[k]
        u = (t - self.times[k]) / h
        if cubic:
            out, into = self.values[k, 2], self.values[k + 1, 0]
            return ((2 * u**3 - 3 * u**2 + 1) * values[k] + h * (u**3 - 2 * u**2 + u) * out
                    + (3 * u**2 - 2 * u**3) * values[k + 1] + h * (u**3 - u**2) * into)
        if self.turns:
            way = quaternions.log(quaternions.multiply(
                quaternions.conjugate(values[k]), values[k + 1]))
            return quaternions.multiply(values[k], quaternions.exp(u * way))
        return values[k] + u * (values[k + 1] - values[k])


def tracks(document: Document, accessors: Accessors, fps: float) -> dict[tuple[int, str], Track]:
    """(node, property) -> how it changes, of all that do."""
    found: dict[tuple[int, str], Track] = {}
    for animation in document.root.parts("animations"):
        for channel in animation.parts("channels"):
            target = channel.part("target")
            path = target.text("path")
            if path == "weights":
                raise target.error("it changes the form of a mesh, and meshes are rigid here: "
                                   "export without shape keys (morph targets)")
            if path not in _KINDS or "node" not in target:
                document.leave(target, f"an animation of {brief(path)}")
                continue
            document.refer(target, "node", "nodes")
            key = (target.whole("node"), path)
            if key in found:
                document.leave(channel, "a second animation of the same node")
                continue
            sampler = document.refer(channel, "sampler", "samplers", animation)
            track = _track(accessors, sampler, path, fps)
            found[key] = track
    return found


def _track(accessors: Accessors, sampler: Item, path: str, fps: float) -> Track:
    form = sampler.text("interpolation", "LINEAR")
    if form not in _FORMS:
        raise sampler.error(f"its interpolation is {brief(form)}: there are {', '.join(_FORMS)}")
    times = accessors.floats(sampler, "input", "SCALAR") * fps
    if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
        raise sampler.error("its times do not increase: export the animation again")
    values = accessors.floats(sampler, "output", _KINDS[path])
    keys = 3 if form == "CUBICSPLINE" else 1
    if len(values) != keys * len(times):
        raise sampler.error(f"it has {len(values)} values for {len(times)} times: {form} needs "
                            f"{keys * len(times)}")
    if not np.isfinite(values).all():
        raise sampler.error("a value is not finite: export the animation again")
    if path == "rotation":
        values = values[:, [3, 0, 1, 2]]
    if form == "CUBICSPLINE":
        values = values.reshape(len(times), 3, -1) * np.array([1 / fps, 1, 1 / fps])[:, None]
    if path == "rotation":
        inner = values[:, 1] if form == "CUBICSPLINE" else values
        lengths = np.linalg.norm(inner, axis=1, keepdims=True)
        if not (lengths > 0).all():
            raise sampler.error("a rotation has no length: export the animation again")
        inner /= lengths
    return Track(times, values, form, path == "rotation")
