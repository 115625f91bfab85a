"""Whether frames from elsewhere keep to our conventions: their images and matrices tested on each
other.

Symbols: P position, z camera-space depth, N normal of a pixel with centre u = (x + 0.5, y + 0.5);
S screen_from_world, C camera_from_world, M world_from_object (`frame.py` fixes their spaces). Of a
frame that keeps to them, to within rounding,

    S P = w (u, w) with w = z,   (C P)_z = z,   |N| = 1,   N is normal to the surface that P spans,

and a moved object's P goes by M' M^-1 to where the frame before has it; where the ID is that of an
object, there are P, z and N. What fails is compared
with what other conventions would give, so that the message can name the one that was found.

Tests are of medians and shares of pixels, for samples may be anywhere in their pixels and edges
mixed, and never stricter than float32 (or half) allows: far from the origin it allows little.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from onespp.render.errors import InputError
from onespp.render.frame import Frame

FEWEST = 16  # pixels that say something
_MOST = 20_000
_PIXELS = 1.0          # a sample lies anywhere in its pixel
_ROUNDING = 16.0       # units in the last place: products of float32 matrices lose some
_RELATIVE = 1e-3       # of a depth
_SHARE = 0.8           # of the pixels that must fit
_DEGREES, _LOST = 3.0, 45.0
_FOOTPRINTS = 64       # of a step from pixel to pixel to the rounding of positions


@dataclass(frozen=True)
class _Sample:
    """Some of a frame's pixels that show a surface, float64: n of them."""

    u: np.ndarray          # (n, 2)
    position: np.ndarray   # (n, 4), fourth 1
    depth: np.ndarray      # (n,)
    normal: np.ndarray     # (n, 3)
    epsilon: float         # relative rounding of positions


@np.errstate(all="ignore")  # matrices may hold anything
def check_frame(frame: Frame) -> None:
    """InputError, the end of a sentence on the frame, where it has another convention than ours.

    A frame with fewer than `FEWEST` pixels that show a surface passes.
    """
    _check_rows(frame)
    _check_filled(frame)
    sample = _sample(frame)
    if sample is None:
        return
    _check_normals_length(sample)
    _check_projection(frame, sample)
    _check_depth(frame, sample)
    _check_normals(frame, sample)


@np.errstate(all="ignore")
def check_motion(before: Frame, now: Frame) -> None:
    """The same for how objects move between two frames."""
    for i, (m0, m1) in enumerate(zip(before.world_from_object, now.world_from_object)):
        i0, i1 = _inverse(m0), _inverse(m1)
        if np.array_equal(m0, m1) or i0 is None or i1 is None:
            continue
        right, wrong = (_found_again(before, now, i, motion) for motion in (m0 @ i1, i0 @ m1))
        if wrong > _SHARE and right < 0.7 * wrong:
            raise InputError(f"has object {i} where the inverse of its matrix says: write "
                             "world_from_object, not object_from_world")


def _inverse(matrix: np.ndarray) -> np.ndarray | None:
    try:
        return np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return None


def _check_rows(frame: Frame) -> None:
    """An affine matrix for column vectors ends in 0 0 0 1."""
    matrices = [*frame.world_from_object, frame.camera_from_world]
    if any(np.array_equal(m[:, 3], (0, 0, 0, 1)) and m[3, :3].any() for m in matrices):
        raise InputError("has transposed matrices, with the translation in the last row: write "
                         "them row by row for column vectors")


def _check_filled(frame: Frame) -> None:
    """Where the ID says that there is an object, the other images say something of it."""
    shown = frame["id"] >= 0
    if (pixels := int(shown.sum())) < FEWEST:
        return
    for name, says in (("position", np.isfinite(frame["position"]).all(-1)),
                       ("depth", np.isfinite(frame["depth"]) & (frame["depth"] != 0)),
                       ("normal", np.isfinite(frame["normal"]).all(-1)
                        & (np.abs(frame["normal"]).sum(-1) > 0.1))):
        if (filled := int((shown & says).sum())) < (1 - _SHARE) * pixels:
            raise InputError(f"shows objects in {pixels} pixels by their ID, and has a {name} in "
                             f"{filled} of these alone, elsewhere 0 or what is not finite: write "
                             f"the {name} of every pixel that shows an object")


def _sample(frame: Frame) -> _Sample | None:
    position = frame["position"]
    seen = ((frame["id"] >= 0) & np.isfinite(position).all(-1) & np.isfinite(frame["depth"])
            & (frame["depth"] != 0) & np.isfinite(frame["normal"]).all(-1)
            & (np.abs(frame["normal"]).sum(-1) > 0.1))
    at = np.flatnonzero(seen)
    if at.size < FEWEST:
        return None
    at = at[np.linspace(0, at.size - 1, min(at.size, _MOST)).astype(np.int64)]
    u = np.stack([at % frame.width, at // frame.width], -1) + 0.5
    points = position.reshape(-1, 3)[at].astype(np.float64)
    return _Sample(u, np.concatenate([points, np.ones((at.size, 1))], -1),
                   frame["depth"].ravel()[at].astype(np.float64),
                   frame["normal"].reshape(-1, 3)[at].astype(np.float64), _epsilon(position))


def _epsilon(image: np.ndarray) -> float:
    """Relative rounding of an image's values, by whether half precision holds them."""
    half = np.array_equal(image.astype(np.float16).astype(np.float32), image, equal_nan=True)
    return float(np.finfo(np.float16).eps if half else np.finfo(np.float32).eps) / 2


# Projection


def _pixels(s: _Sample, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) where a matrix projects the positions, and (n,) how far rounding may move that."""
    p = s.position @ matrix.T
    slack = _ROUNDING * s.epsilon * (np.abs(s.position) @ np.abs(matrix).T)
    u = p[:, :2] / p[:, 3:]
    moved = (slack[:, :2] + np.abs(u) * slack[:, 3:]) / np.abs(p[:, 3:])
    return u, moved.sum(-1)


def _fits(s: _Sample, u: np.ndarray, slack: np.ndarray) -> bool:
    off = np.abs(u - s.u).max(-1) - slack
    return bool(np.median(np.where(np.isfinite(off), off, np.inf)) <= _PIXELS)


def _check_projection(frame: Frame, s: _Sample) -> None:
    u, slack = _pixels(s, frame.screen_from_world)
    if _fits(s, u, slack):
        return
    for words, other, slack in _other_projections(frame, s):
        if _fits(s, other, slack):
            raise InputError("has " + ", and ".join(words))
    off = np.nanmedian(np.abs(u - s.u).max(-1))
    raise InputError(f"has positions that do not project to their pixels by screen_from_world "
                     f"(they miss by {off:.0f} pixels, the median): check positions and matrices, "
                     "for column vectors, x right and y down in pixels")


def _other_projections(frame: Frame, s: _Sample) -> Iterator[tuple[list[str], np.ndarray,
                                                                   np.ndarray]]:
    """What to say of a convention, and `_pixels` by it; simple ones first."""
    size = np.array([frame.width, frame.height], np.float64)
    screen, camera = frame.screen_from_world, frame.camera_from_world
    world = _inverse(camera)
    matrices = (
        (screen, None),
        (screen.T, "transposed matrices: write them row by row for column vectors"),
        (screen if world is None else screen @ world,
         "positions in camera space: write them in world space"),
        (screen @ camera, "a screen matrix that starts from camera space: multiply it by "
                          "camera_from_world"),
        (screen.T @ camera.T, "transposed matrices, and a screen matrix that starts from camera "
                              "space: write screen_from_world row by row for column vectors"))
    ranges = ((None, 0.0, 1.0), ("a screen of -1 to 1: scale it to pixels", 1.0, size / 2),
              ("a screen of 0 to 1: scale it to pixels", 0.0, size))
    flips = (((False, False), None),
             ((False, True), "rows that run upwards: write images from the top row down, and a "
                             "screen whose y points down"),
             ((True, False), "columns that run leftwards: mirror the images, or the x of "
                             "screen_from_world"),
             ((True, True), "images turned by 180 degrees: turn them, or x and y of "
                            "screen_from_world"))
    for (matrix, a), (b, shift, scale), (flip, c) in product(matrices, ranges, flips):
        u, slack = _pixels(s, matrix)
        u = (u + shift) * scale
        words = [word for word in (a, b, c) if word]
        if b and shift and flip == (False, False):  # such screens have y up
            words.append("rows that run upwards: write images from the top row down")
        if b and shift and flip == (False, True):
            words.remove(str(c))
        yield words, np.where(flip, size - u, u), slack * np.max(scale)


# Depth


def _check_depth(frame: Frame, s: _Sample) -> None:
    z, slack = _row(s, frame.camera_from_world[2])
    w, w_slack = _row(s, frame.screen_from_world[3])
    if _agree(s.depth, z, slack):
        if _agree(s.depth, w, w_slack):
            return
        raise InputError("has a screen matrix whose fourth row is not the depth: scale "
                         "screen_from_world until it is")
    raise InputError(f"has {_other_depth(frame, s, z, slack)}: write camera-space z, forward")


def _row(s: _Sample, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A row of a matrix times the positions, and how far rounding may move that."""
    return s.position @ row, _ROUNDING * s.epsilon * (np.abs(s.position) @ np.abs(row))


def _agree(depth: np.ndarray, other: np.ndarray, slack: np.ndarray | float) -> bool:
    close = np.abs(depth - other) <= _RELATIVE * np.abs(other) + slack
    return bool(np.mean(close) >= _SHARE)


def _other_depth(frame: Frame, s: _Sample, z: np.ndarray, slack: np.ndarray) -> str:
    """What the depth is instead."""
    world = _inverse(frame.camera_from_world)
    if world is not None:
        distance = np.linalg.norm(s.position[:, :3] - world[:3, 3], axis=-1)
        if _agree(s.depth, distance, slack):
            return "as its depth the distance along the ray"
    if _agree(s.depth, -z, slack):
        return ("a camera_from_world that looks along -z" if np.median(s.depth) > 0 else
                "a depth below 0")
    if np.median(z) < 0 and _agree(s.depth, z, slack):
        return "a depth below 0, of a camera that looks along -z"
    scale = float(np.median(s.depth / np.where(z == 0, np.inf, z)))
    if _agree(s.depth, scale * z, abs(scale) * slack):
        return f"as its depth {scale:.3g} times the depth that positions have"
    for what, x in (("the depth moved and scaled", z), ("what a depth buffer holds", 1 / z)):
        if np.isfinite(x).all() and np.ptp(x) > 0 and abs(
                np.corrcoef(x, s.depth)[0, 1]) > 1 - 1e-6:
            return f"as its depth {what}"
    return "a depth that is not that of its positions"


# Normals


def _check_normals_length(s: _Sample) -> None:
    length = float(np.median(np.linalg.norm(s.normal, axis=-1)))
    if abs(length - 1) <= 0.05:
        return
    unpacked = np.linalg.norm(2 * s.normal - 1, axis=-1)
    if (s.normal >= 0).all() and abs(float(np.median(unpacked)) - 1) <= 0.05:
        raise InputError("has normals packed to [0, 1]: write them as 2 n - 1")
    raise InputError(f"has normals of length {length:.2f} (the median): write unit vectors")


def _check_normals(frame: Frame, s: _Sample) -> None:
    normal, geometric = _geometric_normals(frame, s.epsilon)
    if len(normal) < FEWEST:
        return
    # Either side of a surface will do, as long as it is one and the same.
    off = _degrees(np.abs(np.sum(normal * geometric, -1)))
    if off <= _DEGREES:
        return
    rotation = frame.camera_from_world[:3, :3]
    rotation = rotation / np.maximum(np.linalg.norm(rotation, axis=1, keepdims=True), 1e-30)
    in_camera = min(_degrees(np.sum((normal * signs) @ rotation * geometric, -1))
                    for signs in product((1.0, -1.0), repeat=3))
    if in_camera < off / 3:
        raise InputError("has normals in camera space: write them in world space")
    if off > _LOST:
        raise InputError(f"has normals that are {off:.0f} degrees (the median) off the surface "
                         "that its positions span: write unit normals in world space")


def _degrees(cosine: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(np.median(cosine), -1, 1))))


def _geometric_normals(frame: Frame, epsilon: float) -> tuple[np.ndarray, np.ndarray]:
    """Of pixels inside a surface: (n, 3) normals given, and those of the plane through their
    neighbours' positions, facing the camera."""
    p, ids = frame["position"].astype(np.float64), frame["id"]
    world = _inverse(frame.camera_from_world)
    if min(ids.shape) < 3 or world is None:
        return np.empty((0, 3)), np.empty((0, 3))
    center, middle = p[1:-1, 1:-1], ids[1:-1, 1:-1]
    across = p[1:-1, 2:] - p[1:-1, :-2], p[1:-1, 2:] + p[1:-1, :-2] - 2 * center
    down = p[2:, 1:-1] - p[:-2, 1:-1], p[2:, 1:-1] + p[:-2, 1:-1] - 2 * center
    inside = middle >= 0
    for other in (ids[1:-1, 2:], ids[1:-1, :-2], ids[2:, 1:-1], ids[:-2, 1:-1]):
        inside &= other == middle
    rounding = _FOOTPRINTS * 2 * epsilon * np.abs(center).max(-1)
    for step, bend in (across, down):
        length = np.linalg.norm(step, axis=-1)
        inside &= (length > rounding) & (np.linalg.norm(bend, axis=-1) < 0.2 * length)
    normal = frame["normal"][1:-1, 1:-1][inside].astype(np.float64)
    plane = np.cross(across[0][inside], down[0][inside])
    length = np.linalg.norm(plane, axis=-1, keepdims=True)
    given = np.linalg.norm(normal, axis=-1, keepdims=True)
    known = np.isfinite(plane).all(-1) & (length > 0)[:, 0] & (given > 0.1)[:, 0]
    normal, plane = (normal / np.maximum(given, 1e-30))[known], (plane / np.maximum(
        length, 1e-300))[known]
    away = np.sum(plane * (world[:3, 3] - center[inside][known]), -1, keepdims=True) < 0
    return normal, np.where(away, -plane, plane)


# Motion


def _found_again(before: Frame, now: Frame, i: int, motion: np.ndarray) -> float:
    """Share of an object's pixels whose surface the frame before has where `motion` says; 0 of too
    few pixels."""
    at = np.flatnonzero(now["id"].ravel() == i)
    p = now["position"].reshape(-1, 3)[at].astype(np.float64)
    p = p[np.isfinite(p).all(-1)]
    was = np.concatenate([p, np.ones((len(p), 1))], -1) @ motion.T
    screen = was @ before.screen_from_world.T
    x, y = np.floor(screen[:, :2] / screen[:, 3:]).T
    inside = (screen[:, 3] > 0) & (x >= 0) & (x < before.width) & (y >= 0) & (y < before.height)
    if len(p) < FEWEST:
        return 0.0
    tap = y[inside].astype(np.int64) * before.width + x[inside].astype(np.int64)
    there = before["position"].reshape(-1, 3)[tap].astype(np.float64)
    near = np.linalg.norm(there - was[inside, :3], axis=-1) < 0.01 * screen[inside, 3]
    return float(np.sum(near & (before["id"].ravel()[tap] == i)) / len(p))
