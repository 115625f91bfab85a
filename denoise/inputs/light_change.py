"""How the lights have changed since the frame before, which unshadowed light tells without noise.

Symbols: U unshadowed light over albedo, at places of objects at rest that two frames see; ' the
former of the two; l luminance.

    ratio = median of U / U', of each colour channel; a place counts by the greater of the two
    left = sum |l(U) - l(ratio U')| / sum l(U)
    renewal = x^2 / (x^2 + 1),   x = max(left - 1/4, 0)

Where all lights have changed alike, as where there is one, `left` is nearly 0, and all that they
send, by way of surfaces and mirrors too, has changed by `ratio`: histories go with it. It is 1
where it leaves more than two fifths of the change, or more than 1/4, and where it is within 1 % of
that, as far as places are found again to a pixel. Unshadowed light tells of lights behind walls,
too: nothing is known where direct light D, with its shadows and its noise, has changed by another
ratio of sums than U has, by more than a third.

`renewal` is the least weight of a frame where history is off by x of the light, that is by what a
smoothed innovation cannot keep up with, and a sample's noise is as much as its mean.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from onespp.denoise.geometry.cameras import camera_points, every
from onespp.denoise.geometry.motion import at_rest
from onespp.denoise.jit.color import LUMINANCE
from onespp.render.frame import Frame

_PLACES = 512              # that are looked at
_FEWEST = 32               # that say something
_SMALLEST_ALBEDO = 0.05
_NEAR = 0.02               # share of the depth by which a place may be missed
_SAME = 0.01               # ratio - 1 that is none
_UNEXPLAINED = 0.4         # share of the change that a ratio may leave
_DIFFERENT = 4 / 3         # times a gain, which is another one
_RESTS = 0.05              # `left` of lights that have not changed
_FOLLOWED = 0.25           # `left` that a smoothed innovation keeps up with
_MOST_LEFT = 1e6
_LARGEST_RATIO = 1000.0


class LightSample(NamedTuple):
    """Places that a frame sees: (n, 3) in world space, (n,) their objects, and (2, n, 3) U and D,
    both over albedo."""

    point: np.ndarray
    id: np.ndarray
    light: np.ndarray


class LightChange(NamedTuple):
    """`ratio` of red, green and blue, and `left`, None where it is not known; see above."""

    ratio: tuple[float, float, float] = (1.0, 1.0, 1.0)
    left: float | None = None

    @property
    def rests(self) -> bool:
        """Whether lights are known to be as they were."""
        return self.ratio == (1.0, 1.0, 1.0) and self.left is not None and self.left < _RESTS

    @property
    def renewal(self) -> float:
        """Least weight of the frame; see above."""
        x = max((self.left or 0.0) - _FOLLOWED, 0.0)
        return x * x / (x * x + 1)


def sample_light(frame: Frame) -> LightSample:
    """What is kept of a frame with unshadowed and direct light for `change_of_lights`."""
    some = every(frame, _PLACES)
    id_, points = frame["id"][some, some], camera_points(frame, some)
    seen = (id_ >= 0) & (id_ < len(frame.world_from_object)) & np.isfinite(points).all(-1)
    world = np.linalg.inv(frame.camera_from_world)
    row, column = np.nonzero(seen)
    first, step = some.start, some.step
    return LightSample(points[seen] @ world[:3, :3].T + world[:3, 3], id_[seen].astype(int),
                       _light(frame, first + step * row, first + step * column))


def change_of_lights(before: LightSample | None, previous: Frame, frame: Frame) -> LightChange:
    """The change since the frame before.

    Args:
        before: of the frame before, None without one. previous: its matrices.
        frame: with unshadowed and direct light.
    """
    if before is None or len(before.id) < _FEWEST:
        return LightChange()
    rests = at_rest(previous, frame)
    screen = before.point @ frame.screen_from_world[:, :3].T + frame.screen_from_world[:, 3]
    with np.errstate(all="ignore"):
        depth = screen[:, 3]
        column, row = np.floor(screen[:, 0] / depth), np.floor(screen[:, 1] / depth)
        seen = ((depth > 0) & (column >= 0) & (column < frame.width) & (row >= 0)
                & (row < frame.height) & (before.id < len(rests)))
    seen[seen] = rests[before.id[seen]]
    row, column, depth = row[seen].astype(int), column[seen].astype(int), depth[seen]
    same = ((frame["id"][row, column] == before.id[seen])
            & (np.abs(frame["depth"][row, column] - depth) < _NEAR * depth))
    old, new = before.light[:, seen][:, same], _light(frame, row[same], column[same])
    known = (np.isfinite(old) & np.isfinite(new)).all((0, 2))
    if known.sum() < _FEWEST:
        return LightChange()
    (old, direct_before), (new, direct) = old[:, known], new[:, known]
    if _apart(_gain(old, new), _gain(direct_before, direct)):
        return LightChange()
    return _change(old, new)


def _light(frame: Frame, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """(2, n, 3) U and D of pixels, over albedo."""
    light = np.stack([frame[name][row, column] for name in ("unshadowed", "direct")])
    light = np.maximum(light.astype(np.float64), 0)
    if "albedo" not in frame:
        return light
    return light / np.maximum(frame["albedo"][row, column], _SMALLEST_ALBEDO)


def _change(old: np.ndarray, new: np.ndarray) -> LightChange:
    """Of (n, 3) U' and U."""
    weight, without = np.maximum(old, new), _left(old, new)
    if not weight.max() > 0:
        return LightChange()
    if without < _SAME:
        return LightChange(left=without)
    each = new / np.maximum(old, 1e-6 * weight.max())
    ratio = np.clip([_median(*both) for both in zip(each.T, weight.T, strict=True)],
                    1 / _LARGEST_RATIO, _LARGEST_RATIO)
    left = _left(old * ratio, new)
    if (np.abs(ratio - 1) < _SAME).all() or left > min(_UNEXPLAINED * without, _FOLLOWED):
        return LightChange(left=without)
    red, green, blue = ratio.tolist()
    return LightChange((red, green, blue), left)


def _gain(old: np.ndarray, new: np.ndarray) -> float:
    a, b = (float((light @ LUMINANCE).sum()) for light in (old, new))
    return b / a if a > 0 else 1.0


def _apart(one: float, other: float) -> bool:
    """Whether gains differ by more than a third; anything is little beyond `_LARGEST_RATIO`."""
    one, other = (min(max(gain, 1 / _LARGEST_RATIO), _LARGEST_RATIO) for gain in (one, other))
    return max(one, other) > _DIFFERENT * min(one, other)


def _left(old: np.ndarray, new: np.ndarray) -> float:
    now = new @ LUMINANCE
    change = np.abs(old @ LUMINANCE - now).sum()
    return min(float(change / max(now.sum(), 1e-300)), _MOST_LEFT)


def _median(values: np.ndarray, weights: np.ndarray) -> float:
    """Weighted; 1 without weights."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(total, total[-1] / 2)]]) if total[-1] > 0 else 1.0
