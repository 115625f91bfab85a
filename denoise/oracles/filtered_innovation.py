"""The filtered innovation in float64 NumPy, as plainly as it can be written."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from onespp.render.frame import Frame

from . import filters as oracles
from .filters import Pixels, luminance, pairs, plane_weight_distance, reproject_bilinear

H = {0: 1 / 2, 1: 1 / 4}
MOST = 1.1  # visibility that a pixel has


def lum(image: np.ndarray) -> np.ndarray:
    return luminance(image) if image.shape[-1] == 3 else image[..., 0]


def texture_of(frame: Frame) -> np.ndarray:
    """(h, w, 3) albedo that can be divided by."""
    albedo = np.maximum(frame["albedo"].astype(float), 0.01)
    albedo[(frame["albedo"] < 0.01).all(-1)] = 1
    return albedo


def unshadowed_of(frame: Frame) -> dict[str, np.ndarray]:
    """U of each visibility: of V or, where lights are in groups, of each group, by its number."""
    groups = {name[10:]: frame[name].astype(float) for name in sorted(frame.images)
              if name.startswith("unshadowed") and name != "unshadowed"}
    return groups or {"V": frame["unshadowed"].astype(float)}


def signals_of(frame: Frame) -> dict[str, np.ndarray]:
    """L, G and V, (h, w, c), then y of each group."""
    light = frame["direct"].astype(float) + frame["indirect"] - frame["specular"]
    specular = frame["specular"].astype(float)
    unshadowed = unshadowed_of(frame)
    told, chance = {"V": np.minimum(frame["visibility"].astype(float), MOST)[..., None]}, 1.0
    if "group" in frame:
        y, _, chance = np.moveaxis(frame["group_sample"].astype(float)[..., None], -2, 0)
        told = {g: np.where((frame["group"] == int(g))[..., None], np.minimum(y, MOST), 0)
                for g in sorted(unshadowed)}
        chance = np.where(chance > 0, chance, np.inf)
    for name, v in told.items():
        light = light - v / chance * unshadowed[name]
    mirrored = np.zeros_like(light)
    if "roughness" in frame:  # where nothing is diffuse, all that is left is G
        mirrored = np.where(bare(frame)[..., None], light, 0)
    return {"L": (light - mirrored) / texture_of(frame),
            "G": specular / layer_texture_of(frame) + mirrored, **told}


def bare(frame: Frame) -> np.ndarray:
    return (texture_of(frame) >= 1).all(-1) & (roughness_of(frame) < 1) & ~layers_of(frame)


def roughness_of(frame: Frame) -> np.ndarray:
    return frame["roughness"].astype(float).reshape(frame["id"].shape)


def layers_of(frame: Frame) -> np.ndarray:
    """Where glossy light is that of another layer."""
    if "layer_share" not in frame:
        return np.zeros(frame["id"].shape, bool)
    return (frame["layer_share"] > 0) & (roughness_of(frame) == 0)


def layer_texture_of(frame: Frame) -> np.ndarray:
    """(h, w, 3) what glossy light is divided by."""
    texture = np.ones((*frame["id"].shape, 3))
    seen = layers_of(frame)
    if seen.any():
        seen &= frame["layer_id"] >= 0
        texture[seen] = np.clip(frame["layer_albedo"][seen].astype(float)
                                / frame["layer_share"][seen][:, None], 0.25, 1)
    return texture


def seen_in_gloss(frame: Frame) -> Frame:
    """The frame with the surfaces that glossy light is from."""
    images, seen = dict(frame.images), layers_of(frame)
    del images["unshadowed"]  # what faces away counts for the rest of the light
    for name in ("id", "normal", "depth"):
        images[name] = images[name].copy()
        images[name][seen] = frame[f"layer_{name}"][seen]
    images["albedo"] = np.where(seen[..., None], layer_texture_of(frame), frame["albedo"])
    images["position"] = frame["position"].astype(float)
    eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
    for y, x in np.argwhere(seen):
        on_screen = np.linalg.inv(frame.screen_from_world) @ [x + 0.5, y + 0.5, 1, 1]
        point = on_screen / on_screen[3]
        images["position"][y, x] = eye + (point[:3] - eye) * (
            images["depth"][y, x] / (frame.screen_from_world[3] @ point))
    return Frame(frame.index, images, frame.camera_from_world, frame.screen_from_world,
                 frame.world_from_object)


def turn_of(previous: Frame, frame: Frame) -> np.ndarray:
    """How far mirror directions have turned, in lobes; in world space."""
    ids = np.maximum(frame["id"], 0)
    back = np.array([before @ np.linalg.inv(now) for before, now in zip(
        previous.world_from_object, frame.world_from_object)])[ids]
    x, n = frame["position"].astype(float), frame["normal"].astype(float)
    x_before = np.einsum("hwij,hwj->hwi", back[..., :3, :3], x) + back[..., :3, 3]
    n_before = np.einsum("hwji,hwj->hwi", np.linalg.inv(back[..., :3, :3]), n)

    def mirrored(of: Frame, x: np.ndarray, n: np.ndarray) -> np.ndarray:
        v = x - np.linalg.inv(of.camera_from_world)[:3, 3]
        v = v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-15)
        n = n / np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-15)
        return v - 2 * (v * n).sum(-1, keepdims=True) * n

    d = mirrored(frame, x, n) - mirrored(previous, x_before, n_before)
    width = 2 * np.where(layers_of(frame), 1, roughness_of(frame)) + 0.005  # of diffuse light: all
    return np.minimum(np.linalg.norm(d, axis=-1) / width, 1)


def image_motion(previous: Frame, frame: Frame) -> np.ndarray:
    """How far what a mirror direction shows has moved by itself, in lobes; in world space."""
    motion = np.zeros(frame["id"].shape)
    if "hit_id" not in frame:
        return motion
    eye, alpha = np.linalg.inv(frame.camera_from_world)[:3, 3], roughness_of(frame)
    met = (frame["hit_id"] >= 0) & (frame["hit_distance"] > 0) & (alpha < 1)
    for y, x in np.argwhere(met):
        p, n = (frame[name][y, x].astype(float) for name in ("position", "normal"))
        v = (p - eye) / np.linalg.norm(p - eye)
        d, i = frame["hit_distance"][y, x], int(frame["hit_id"][y, x])
        hit = p + d * (v - 2 * (v @ n) * n)
        back = previous.world_from_object[i] @ np.linalg.inv(frame.world_from_object[i])
        was = (back @ [*hit, 1])[:3]
        motion[y, x] = min(np.linalg.norm(hit - was) / d / (2 * alpha[y, x] + 0.005), 1)
    return motion


def bends_of(frame: Frame, length: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(h, w, 2, 3) by how many lobes a mirror direction turns from pixel to pixel, along a row and
    a column, such that a tap counts by exp(-|.|^2), and (h, w) how bent a surface is."""
    n, ids, alpha = frame["normal"].astype(float), frame["id"], roughness_of(frame)
    alpha = np.where(bare(frame), alpha, 1)
    turn, (height, width) = np.zeros((*ids.shape, 2, 3)), ids.shape
    for y, x in np.argwhere(alpha < 1):
        for axis, (dy, dx) in enumerate(((0, 1), (1, 0))):
            differences = [sign * (n[y + sign * dy, x + sign * dx] - n[y, x]) for sign in (-1, 1)
                           if 0 <= y + sign * dy < height and 0 <= x + sign * dx < width
                           and ids[y + sign * dy, x + sign * dx] == ids[y, x]]
            if differences:
                turn[y, x, axis] = 2 * np.mean(differences, 0)
    turn /= (2 * alpha * (1 + (alpha / 0.15) ** 2) + 0.005)[..., None, None]
    size = (turn ** 2).sum((-1, -2))
    k = length / (length + 3) / (1 + 0.75 * size)
    return turn * np.sqrt(2 * k)[..., None, None], 0.75 * size / (1 + 0.75 * size)


def what_was_there(previous: Frame, frame: Frame, image: np.ndarray) -> np.ndarray:
    """(h, w) image of the frame before, at the pixel in which each surface was; 0 elsewhere."""
    column, row = (np.floor(at) for at in places_before(previous, frame))
    height, width = frame["id"].shape
    inside = ((column >= 0) & (column < width) & (row >= 0) & (row < height)
              & (frame["id"] >= 0))
    row, column = (np.where(inside, at, 0).astype(int) for at in (row, column))
    return np.where(inside, image[row, column], 0)


def places_before(previous: Frame, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Where on the screen each surface was, (column, row) in pixels."""
    ids = np.maximum(frame["id"], 0)
    back = np.array([before @ np.linalg.inv(now) for before, now in zip(
        previous.world_from_object, frame.world_from_object)])[ids]
    x = np.concatenate([frame["position"].astype(float), np.ones((*ids.shape, 1))], -1)
    was = np.einsum("ij,hwjk,hwk->hwi", previous.screen_from_world, back, x)
    depth = np.where(was[..., 3] > 0, was[..., 3], 1)
    return was[..., 0] / depth, was[..., 1] / depth


def color_of(frame: Frame, signals: dict[str, np.ndarray]) -> np.ndarray:
    direct = sum(signals[name] * u for name, u in unshadowed_of(frame).items())
    return (frame["emission"] + direct + texture_of(frame) * signals["L"]
            + layer_texture_of(frame) * signals["G"])


def kind_of(frame: Frame) -> np.ndarray:
    """Background, lamps and the rest: only like pixels mix."""
    black = "albedo" in frame and (frame["albedo"] < 0.01).all(-1)
    return np.where(frame["id"] < 0, 0, np.where(black | faces_away(frame), 1, 2))


def faces_away(frame: Frame) -> np.ndarray:
    """Where a surface that Mitsuba lit has a normal that faces away from the camera, and is not
    glossy alone."""
    if "unshadowed" not in frame:
        return np.zeros(frame["id"].shape, bool)
    eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
    cosine = ((eye - frame["position"]) * frame["normal"]).sum(-1)
    bare = "albedo" in frame and (texture_of(frame) >= 1).all(-1)
    return (frame["id"] >= 0) & (cosine < -1e-3 * frame["depth"]) & ~bare


def geometry(p: Pixels, q: Pixels, dy: int, dx: int, m) -> np.ndarray:
    distance = np.where(p.kind == 2, tolerated(p, q, m), 0)
    w = H[abs(dy)] * H[abs(dx)] * np.exp(-distance) * np.where(p.id == q.id, 1, 0.4)
    return np.where(p.kind == q.kind, w, 0)


def pixels_of(frame: Frame, m, **more: np.ndarray) -> Pixels:
    eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
    return oracles.read(frame, kind=kind_of(frame), id=frame["id"],
                        foot=((frame["position"] - eye) * frame["normal"]).sum(-1),
                        width=np.full(frame["id"].shape, width_of(frame)),
                        rough=roughness_of_leaves(frame, m), **more)


def width_of(frame: Frame) -> float:
    """Of a pixel at depth 1."""
    b = np.linalg.inv((frame.screen_from_world
                       @ np.linalg.inv(frame.camera_from_world))[[0, 1, 3], :3])
    return np.sqrt(np.abs(np.linalg.det(b[:2, :2])))


def roughness_of_leaves(frame: Frame, m) -> np.ndarray:
    """Among pixels of one object, or of all where the pixels two away are rough, too."""
    shape, rough = frame["id"].shape, roughness_around(frame, False)
    share = rough / (rough + m.plane_pixels * width_of(frame))
    around = np.pad(share, 2)
    total = sum(around[y:y + shape[0], x:x + shape[1]] for y in (0, 2, 4) for x in (0, 2, 4))
    among_leaves = np.clip(4 * (total - share) / 8 - 1, 0, 1)
    return np.maximum(roughness_around(frame, True), among_leaves * rough)


def roughness_around(frame: Frame, same_object: bool) -> np.ndarray:
    """Of the lines through a pixel, the least of how far its neighbours are from its plane."""
    shape = frame["id"].shape
    pixels, rough = oracles.read(frame, kind=kind_of(frame), id=frame["id"]), np.full(shape, np.inf)
    for line in ((0, 1), (1, -1), (1, 0), (1, 1)):
        farther = np.zeros(shape)
        for sign in (-1, 1):
            where, p, q = pairs(pixels, shape, sign * line[0], sign * line[1])
            distance = np.full(shape, np.inf)
            if where is not None:
                same = (p.kind == 2) & (q.kind == 2) & ((p.id == q.id) | (not same_object))
                distance[where] = np.where(same, plane_weight_distance(p, q), np.inf)
            farther = np.maximum(farther, distance)
        rough = np.minimum(rough, farther)
    return np.where(np.isfinite(rough), rough, 0)


def share_of(p: Pixels, m) -> np.ndarray:
    """What a plane counts for where it is rough."""
    return 1 / (1 + p.rough / (m.plane_pixels * p.width))


def tolerated(p: Pixels, q: Pixels, m) -> np.ndarray:
    """Distance of q from p's plane in tolerated ones: from a share of it that is left of one that
    faces the camera."""
    share, apart = share_of(p, m), plane_weight_distance(p, q)
    both = np.isfinite(apart) & (p.surface > 0)
    of_p, of_q = np.where(both, p.z, 1), np.where(both, q.z, 1)
    sloped = (p.n * (p.position - q.position)).sum(-1) / of_q
    facing = p.foot * (1 / of_q - 1 / of_p)
    distance = np.where(both, np.abs(share * sloped + (1 - share) * facing), apart)
    return distance * share / (m.plane_pixels * p.width)


def smooth(frame: Frame, image: np.ndarray, counts: np.ndarray, levels: int, m,
           first: int = 0, narrow: np.ndarray | float = 0.0) -> np.ndarray:
    """S: levels over the pixels that count, taps weaker by exp(-narrow r^2)."""
    shape = frame["id"].shape
    for i in range(first, first + levels):
        pixels = pixels_of(frame, m, x=image, counts=counts, narrow=narrow * np.ones(shape))
        total = np.zeros_like(image)
        weights = np.zeros((*shape, 1))
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                where, p, q = pairs(pixels, shape, dy << i, dx << i)
                if where is None:
                    continue
                w = (geometry(p, q, dy, dx, m) * (q.counts if dy or dx else 1))[..., None]
                w = w * np.exp(-p.narrow * (dy * dy + dx * dx) * 4**i)[..., None]
                total[where] += w * q.x
                weights[where] += w
        image = total / weights
    return image


def spread(frame: Frame, energy: np.ndarray, counts: np.ndarray, levels: int, m,
           narrow: np.ndarray) -> np.ndarray:
    """Q: the variance of a smoothing whose pixels have these."""
    shape = frame["id"].shape
    for i in range(levels):
        pixels = pixels_of(frame, m, x=energy, counts=counts, narrow=narrow)
        total, weights = np.zeros(shape), np.zeros(shape)
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                where, p, q = pairs(pixels, shape, dy << i, dx << i)
                if where is None:
                    continue
                w = geometry(p, q, dy, dx, m) * (q.counts if dy or dx else 1)
                w = w * np.exp(-p.narrow * (dy * dy + dx * dx) * 4**i)
                total[where] += w**2 * q.x
                weights[where] += w
        energy = total / weights**2
    return energy


def guided(frame: Frame, image: np.ndarray, variance: np.ndarray, levels: int, sigma: np.ndarray,
           fade: np.ndarray, narrow: np.ndarray, m, counts: np.ndarray | None = None,
           theirs: float = 0.2, noisy: int = 0, bends: np.ndarray | None = None) -> np.ndarray:
    """The last filter; its last level's taps are weaker by `fade`, those of `noisy` levels more by
    the noise that is left, all by exp(-narrow r^2) and by `bends_of`, and a pixel weighs as much as
    it counts. It compares the first three components, or the only one, by the pixel's variance and
    a share, `theirs`, of what a neighbour has more."""
    shape = frame["id"].shape
    counts = np.ones(shape) if counts is None else counts
    bends = np.zeros((*shape, 2, 3)) if bends is None else bends
    for i in range(levels + noisy):
        weaker = fade if i == levels - 1 else np.ones_like(fade)
        if i >= levels:
            mean2 = np.maximum(lum(image[..., :3]) ** 2, 1e-12)
            weaker = np.clip(2.5 * variance / mean2, 1e-6, 1)
        pixels = pixels_of(frame, m, x=image, v=variance, fade=weaker, narrow=narrow, counts=counts,
                           sigma=sigma, bends=bends)
        total, squares, weights = np.zeros_like(image), np.zeros(shape), np.zeros(shape)
        alike = np.zeros(shape)
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                where, p, q = pairs(pixels, shape, dy << i, dx << i)
                if where is None:
                    continue
                w = geometry(p, q, dy, dx, m)
                if dy or dx:
                    noise = p.v + theirs * np.maximum(q.v - p.v, 0)
                    deviations = (lum(q.x[..., :3]) - lum(p.x[..., :3])) / np.sqrt(noise + 1e-12)
                    w = w * p.fade * np.exp(-(deviations / p.sigma) ** 2
                                            - p.narrow * (dy * dy + dx * dx) * 4**i)
                    turned = dx * p.bends[..., 0, :] + dy * p.bends[..., 1, :]
                    w = w * np.exp(-(turned ** 2).sum(-1) * 4**i)
                alike[where] += w
                w = w * q.counts
                total[where] += w[..., None] * q.x
                squares[where] += w * w * q.v
                weights[where] += w
        image, variance = total / weights[..., None], squares / weights**2
        counts = weights / alike
    return image


def sample_variance(frame: Frame, samples: np.ndarray, there: np.ndarray, m) -> np.ndarray:
    """Variance of the samples around that are there, near p's plane; 1/4 of less than two."""
    shape = frame["id"].shape
    pixels = pixels_of(frame, m, x=samples, there=1.0 * there)
    count, first, second = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for dy, dx in np.ndindex(5, 5):
        where, p, q = pairs(pixels, shape, dy - 2, dx - 2)
        if where is None:
            continue
        near = (q.there > 0) & (p.kind == q.kind) & ((p.kind < 2) | (tolerated(p, q, m) < 1))
        count[where] += near
        first[where] += near * q.x
        second[where] += near * q.x**2
    several = count > 1
    n = np.where(several, count, 2)
    return np.where(several, np.maximum(second - first**2 / n, 0) / (n - 1), 0.25)


def spatial_variance(frame: Frame, signal: np.ndarray, m) -> np.ndarray:
    """Mean square of what a 3x3 smoothing takes away, at pixels near p's plane."""
    shape = frame["id"].shape
    pixels = pixels_of(frame, m, x=lum(signal))
    taps = {}
    for dy, dx in np.ndindex(5, 5):
        value, near = np.zeros(shape), np.zeros(shape, bool)
        where, p, q = pairs(pixels, shape, dy - 2, dx - 2)
        if where is not None:
            value[where] = q.x
            near[where] = (p.kind == q.kind) & ((p.kind < 2) | (tolerated(p, q, m) < 1))
        taps[dy, dx] = value, near
    count, total = np.zeros(shape), np.zeros(shape)
    for cy, cx in np.ndindex(3, 3):
        h = {(dy, dx): H[abs(dy - 1)] * H[abs(dx - 1)] * taps[cy + dy, cx + dx][1]
             for dy, dx in np.ndindex(3, 3)}
        norm = np.maximum(sum(h.values()), 1e-6)
        mean = sum(w * taps[cy + dy, cx + dx][0] for (dy, dx), w in h.items()) / norm
        share = 1 - 2 * H[0]**2 / norm + sum(w**2 for w in h.values()) / norm**2
        value, near = taps[cy + 1, cx + 1]
        counts = near & (share > 0.1)
        count += counts
        total += np.where(counts, (value - mean) ** 2 / np.maximum(share, 0.1), 0)
    return total / np.maximum(count, 1)


def look_up(previous: Frame, frame: Frame, image: np.ndarray, m) -> tuple:
    """History, 0 where there is none, and where there is one."""
    history = reproject_bilinear(previous, frame, image, m.min_cosine, m.plane_tolerance)
    found = np.asarray(np.isfinite(history).all(-1))
    return np.where(found[..., None], history, 0), found


def of_lit_neighbours(frame: Frame, visibility: np.ndarray, m) -> np.ndarray:
    """Visibility, where there is no unshadowed light that of the neighbours that have some."""
    lit = (frame["unshadowed"] > 0).any(-1, keepdims=True)
    known = np.where(lit, visibility, 0)
    around = smooth(frame, np.concatenate([known, lit], -1), np.ones(frame["id"].shape), 1, m)
    some = around[..., 1:] > 0
    mean = around[..., :1] / np.where(some, around[..., 1:], 1)
    return np.where(lit | ~some, known, mean)


def shadow_shift(previous: Frame, frame: Frame, told: np.ndarray | None = None) -> np.ndarray:
    """(h, w, 2) pixels by which each pixel's shadow was elsewhere; NaN if it was not, or too far
    away, or was not told of."""
    shift = any_shift(previous, frame, told)
    length = np.abs(shift).sum(-1, keepdims=True)
    return np.where((length > 0.05) & (length < shift.shape[1] / 4), shift, np.nan)


def any_shift(previous: Frame, frame: Frame, told: np.ndarray | None = None) -> np.ndarray:
    """The same for all shadows that are told of, still ones too.

    In world space: the object that the shadow falls on stands still, lights and blockers move.
    """
    shift = np.full((*frame["id"].shape, 2), np.nan)
    told = (frame["id"] >= 0) if told is None else told & (frame["id"] >= 0)

    def seen(surface: Any, object_: Any, point: np.ndarray) -> np.ndarray:
        """Where a point of an object was in the frame before, as the surface saw it."""
        motion = np.eye(4)
        for i, back in ((object_, True), (surface, False)):
            if i >= 0:
                m = previous.world_from_object[i] @ np.linalg.inv(frame.world_from_object[i])
                motion = (m if back else np.linalg.inv(m)) @ motion
        return (motion @ [*point, 1])[:3]

    for y, x in np.argwhere(told & (frame["blocker_distance"] > 0)):
        i, position = frame["id"][y, x], frame["position"][y, x].astype(float)
        n, light = frame["normal"][y, x].astype(float), frame["light"][y, x].astype(float)
        share = frame["blocker_distance"][y, x] / np.linalg.norm(light)
        source = seen(i, int(frame["light_id"][y, x]), position + light)
        blocker = seen(i, int(frame["blocker_id"][y, x]), position + share * light)
        t = n @ (position - source) / (n @ (blocker - source))
        was = frame.screen_from_world @ [*(source + t * (blocker - source)), 1]
        d = was[:2] / was[3] - [x + 0.5, y + 0.5]
        if t > 1 and was[3] > 0:
            shift[y, x] = d
    return shift


def unrest(previous: Frame, frame: Frame, told: np.ndarray, m) -> np.ndarray:
    """How far shadows or surfaces move on the screen, from 0 where they stand still to 1."""
    height, width = frame["id"].shape
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    shift = sum(np.abs(was - at) for was, at in zip(
        places_before(previous, frame), (column, row), strict=True))
    stopped, _ = sharpness(frame, told)
    rests = np.abs(any_shift(previous, frame, told)).sum(-1) <= 0.05
    around = spread_out(frame, 1.0 * np.stack([rests, stopped], -1), m)
    share = np.where(around[..., 1] > 1e-3, np.clip(
        4 - 4 * around[..., 0] / np.maximum(around[..., 1], 1e-3), 0, 1), 1)
    return np.maximum(np.where(shift > 0.05, np.minimum(shift, 1), 0), share)


def spread_out(frame: Frame, image: np.ndarray, m) -> np.ndarray:
    """Means of what shadow rays tell, from a few pixels around."""
    return smooth(frame, image, np.ones(frame["id"].shape), 1, m, first=2)


def shadow_history(previous: Frame, frame: Frame, told: np.ndarray, image: np.ndarray, m) -> tuple:
    """What `look_up` finds where the shadow was, and where it finds it."""
    shift = shadow_shift(previous, frame, told)
    moves = np.isfinite(shift).all(-1, keepdims=True)
    around = spread_out(frame, np.concatenate([moves, np.where(moves, shift, 0)], -1), m)
    near = (around[..., 0] > 1e-3) & (kind_of(frame) == 2)  # a lamp has no shadow
    shift = np.where(near[..., None], around[..., 1:] / np.maximum(around[..., :1], 1e-3), 0)
    moved = on_tangent_planes(frame, shift, near, share_of(pixels_of(frame, m), m))
    history, found = look_up(previous, moved, image, m)
    return history, found & near


def on_tangent_planes(frame: Frame, shift: np.ndarray, there: np.ndarray,
                      share: np.ndarray | float = 1.0) -> Frame:
    """The frame with positions moved by (h, w, 2) pixels on the screen, where there; share: of
    `share_of`."""
    position, share = frame["position"].astype(float), share * np.ones(there.shape)
    eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
    for y, x in np.argwhere(there & (frame["id"] >= 0)):
        column, row = shift[y, x] + [x + 0.5, y + 0.5]
        on_screen = np.linalg.inv(frame.screen_from_world) @ [column, row, 1, 1]
        ray = on_screen[:3] / on_screen[3] - eye
        n = frame["normal"][y, x].astype(float)
        on_plane = ray * (n @ (position[y, x] - eye)) / (n @ ray)
        farther = frame["depth"][y, x] / (frame.screen_from_world[3, :3] @ on_plane)
        position[y, x] = eye + on_plane * farther / (1 + share[y, x] * (farther - 1))
    return Frame(frame.index, {**frame.images, "position": position}, frame.camera_from_world,
                 frame.screen_from_world, frame.world_from_object)


def light_sizes(frame: Frame) -> dict[int, float]:
    """Twice the deviation of the points that shadow rays were sent to, by light."""
    there = frame["id"] >= 0
    points, lights = (frame["position"] + frame["light"])[there], frame["light_id"][there]
    return {int(i): 2 * np.sqrt(points[lights == i].astype(float).var(0).sum())
            if (lights == i).sum() > 3 else np.inf for i in np.unique(lights)}


def narrowness(frame: Frame, told: np.ndarray, m) -> np.ndarray:
    """q / (2 p^2) from the widths of the penumbras around, 0 where nothing is in the way."""
    stopped, q = sharpness(frame, told)
    around = spread_out(frame, np.stack([stopped, q], -1), m)
    share = around[..., 0]
    return np.where(share > 1e-3, around[..., 1] / np.maximum(share, 1e-3), 0) / (2 * m.penumbra**2)


def sharpness(frame: Frame, told: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether each pixel's ray was stopped, and 1 / (w^2 + 1) of its penumbra, 0 elsewhere."""
    stopped = told & (frame["id"] >= 0) & (frame["blocker_distance"] > 0)
    sizes = light_sizes(frame)
    size = np.vectorize(lambda i: sizes.get(int(i), np.inf))(frame["light_id"])
    d = frame["blocker_distance"].astype(float)
    whole = np.maximum(np.linalg.norm(frame["light"].astype(float), axis=-1), 1e-9)
    focal = (frame.screen_from_world @ np.linalg.inv(frame.camera_from_world))[0, 0]
    cosine = np.abs((frame["normal"] * frame["light"]).sum(-1, dtype=float)) / whole
    with np.errstate(invalid="ignore", divide="ignore"):
        width = size * d / ((whole - d) * cosine) * focal / frame["depth"]
    q = np.where(stopped, 1 / (width**2 + 1), 0)
    return stopped, q


def met_near(frame: Frame, channel: str, there: np.ndarray,
             alpha: np.ndarray | float = 1) -> np.ndarray:
    """1 / ((2 alpha x)^2 + 1) of what a pixel's ray met, x pixels away, 0 where it met nothing."""
    focal = (frame.screen_from_world @ np.linalg.inv(frame.camera_from_world))[0, 0]
    there = there & (frame[channel] > 0)
    pixels = alpha * frame[channel].astype(float) * focal / np.where(there, frame["depth"], 1)
    return np.where(there, 1 / (4 * pixels**2 + 1), 0)


def in_slits(frame: Frame, image: np.ndarray, m) -> np.ndarray:
    """Darker, as the frame is, where both of a pixel's rays met something at once."""
    if "light" not in frame or "hit_distance" not in frame or not m.follow_shadows:
        return image
    seen = frame["id"] >= 0
    of_paths = met_near(frame, "hit_distance", seen)
    near = np.minimum(met_near(frame, "blocker_distance", seen), of_paths)
    x, y = luminance(image), luminance(frame["color"].astype(float))
    ratio = np.where(x > 0, np.clip(y / np.where(x > 0, x, 1), 0, 1), 1)
    share = np.maximum(0.75 * np.sqrt(near), of_black_lines(np.where(y > 0, 0, of_paths)))
    return image * (1 - share * (1 - ratio))[..., None]


def of_black_lines(near: np.ndarray) -> np.ndarray:
    """L / (L + 1/20), L the least of a pixel and two opposite ones, where that is greatest."""
    (h, w), around, best = near.shape, np.pad(near, 1), np.zeros(near.shape)
    for dy, dx in ((0, 1), (1, -1), (1, 0), (1, 1)):
        one, other = (around[1 + s * dy:1 + s * dy + h, 1 + s * dx:1 + s * dx + w]
                      for s in (-1, 1))
        best = np.maximum(best, np.minimum(one, other))
    least = np.minimum(best, near)
    return least / (least + 0.05)


def own_colour_facing_away(frame: Frame, image: np.ndarray) -> np.ndarray:
    """With means of the frame's colour where it faces away, over 7x7 pixels."""
    away, out = faces_away(frame), image.copy()
    for y, x in np.argwhere(away):
        part = np.s_[max(y - 3, 0):y + 4, max(x - 3, 0):x + 4]
        alike = away[part] & (frame["id"][part] == frame["id"][y, x])
        out[y, x] = frame["color"][part][alike].astype(float).mean(0)
    return out


def contact(frame: Frame, m, name: str, length: np.ndarray) -> np.ndarray:
    """k / (2 p^2) from how far what shadow rays and paths around met is from the surface."""
    def near(channel: str, there: np.ndarray, alpha: np.ndarray | float = 1) -> np.ndarray:
        c = met_near(frame, channel, there, alpha)
        return spread_out(frame, c[..., None], m)[..., 0] / (2 * m.penumbra**2)

    seen = frame["id"] >= 0
    trust = length / (length + 3)
    if name == "G":
        if "hit_distance" not in frame or "roughness" not in frame:
            return 0 * trust
        alpha = roughness_of(frame)
        return near("hit_distance", seen & (alpha < 1), alpha) * trust
    of_paths = near("hit_distance", seen) if "hit_distance" in frame else 0
    return (near("blocker_distance", seen) + of_paths) * trust


def without_peaks(frame: Frame, image: np.ndarray, least: np.ndarray, most: Any, levels: int,
                  m) -> tuple:
    """Light without what is above `most` times the mean of the same object around and above
    `least`; and, smoothed, the luminance of that, and what was taken."""
    x, shape = np.maximum(lum(image), 0), frame["id"].shape
    pixels = pixels_of(frame, m, x=x)
    count, total = np.zeros(shape), np.zeros(shape)
    for dy, dx in np.ndindex(5, 5):
        where, p, q = pairs(pixels, shape, dy - 2, dx - 2)
        if where is None or (dy, dx) == (2, 2):
            continue
        same = (p.id == q.id) & (p.id >= 0)
        count[where] += same
        total[where] += q.x * same
    least = np.maximum(most * total / np.maximum(count, 1), least)
    share = np.where((least > 0) & (x > least), least / np.maximum(x, 1e-30), 1)
    least = np.minimum(image.min(-1), 0)  # what is negative is no light
    grey = np.where(x > least, -least / np.maximum(x - least, 1e-30), 0)[..., None]
    taken = (1 - share)[..., None] * ((1 - grey) * image + grey * x[..., None])
    around = smooth(frame, np.concatenate([(x * share)[..., None], taken], -1), np.ones(x.shape),
                    levels, m)
    return image - taken, around


def with_their_light(image: np.ndarray, around: np.ndarray) -> np.ndarray:
    """With what was taken, in its own colour, at most five times as much light as is there."""
    left, taken = around[..., 0], around[..., 1:]
    among = np.maximum(left, lum(taken) / 5)
    own = np.maximum(lum(image), 0) / np.where(among > 0, among, 1)
    return image + np.where(among > 0, own, 0)[..., None] * taken


def run(frames: list[Frame], m) -> np.ndarray:
    """The colour of the last frame."""
    signals, changes = [signals_of(frame) for frame in frames], changes_of_light(frames)
    gloss, has_peaks = {}, "G" in signals[0]
    if "layer_share" in frames[0]:
        gloss = filtered([seen_in_gloss(frame) for frame in frames],
                         [{"G": each.pop("G")} for each in signals], changes, m, has_peaks)
    out = filtered(frames, signals, changes, m, has_peaks) | gloss
    if "light" in frames[-1] and m.follow_shadows:
        for name in unshadowed_of(frames[-1]):
            own = frames[-1]["group"] == int(name) if name.isdigit() else True
            _, q = sharpness(frames[-1], own & np.ones(frames[-1]["id"].shape, bool))
            out[name] = out[name] * (1 - 0.75 * q**8)[..., None]
    if "L" in out and "roughness" in frames[-1]:
        out["L"] = np.where(bare(frames[-1])[..., None], 0, out["L"])
    color = own_colour_facing_away(frames[-1], in_slits(frames[-1], color_of(frames[-1], out), m))
    return repaid(color, frames[-1]["id"])


class Lights(NamedTuple):
    """By what lights have changed, of each channel, and what share that leaves, NaN if unknown."""

    ratio: np.ndarray
    left: float

    @property
    def rests(self) -> bool:
        return bool((self.ratio == 1).all() and self.left < 0.05)

    @property
    def renewal(self) -> float:
        x = max(self.left - 0.25, 0.0) if self.left >= 0 else 0.0
        return x**2 / (x**2 + 1)


def changes_of_light(frames: list[Frame]) -> list[Lights]:
    """Of each frame since the one before."""
    unknown = Lights(np.ones(3), np.nan)
    return [unknown, *(lights_between(*both) or unknown for both in pairwise(frames))]


def lights_between(previous: Frame, frame: Frame) -> Lights | None:
    (height, width), places = frame["id"].shape, []
    step = max(1, round((height * width / 512) ** 0.5))
    for y, x in np.ndindex(height, width):
        i = previous["id"][y, x]
        if (y % step != step // 2 or x % step != step // 2 or i < 0 or not np.array_equal(
                previous.world_from_object[i], frame.world_from_object[i])):
            continue
        at = frame.screen_from_world @ [*previous["position"][y, x].astype(float), 1]
        column, row = np.floor(at[:2] / at[3]).astype(int)
        if at[3] <= 0 or not (0 <= row < height and 0 <= column < width):
            continue
        if frame["id"][row, column] == i and abs(frame["depth"][row, column] / at[3] - 1) < 0.02:
            places.append([each[name][where].astype(float) / np.maximum(each["albedo"][where], 0.05)
                           for name in ("unshadowed", "direct")
                           for each, where in ((previous, (y, x)), (frame, (row, column)))])
    if len(places) < 32:
        return None
    old, new, direct_before, direct = np.maximum(np.moveaxis(np.array(places), 1, 0), 0)
    before, now, arrived_before, arrived = (
        luminance(light).sum() for light in (old, new, direct_before, direct))
    gains = [np.clip(b / a, 1 / 1000, 1000) if a > 0 else 1.0
             for a, b in ((before, now), (arrived_before, arrived))]
    if max(gains) > 4 / 3 * min(gains) or not np.maximum(old, new).max() > 0:
        return None

    def left(ratio: Any) -> float:
        a, b = luminance(old * ratio), luminance(new)
        return min(np.abs(a - b).sum() / max(b.sum(), 1e-300), 1e6)

    each = new / np.maximum(old, 1e-6 * np.maximum(old, new).max())
    ratio = np.ones(3)
    for c in range(3):
        weights = np.maximum(old, new)[:, c]
        order = np.argsort(each[:, c])
        half = np.cumsum(weights[order]) >= weights.sum() / 2
        ratio[c] = np.clip(each[order[np.argmax(half)], c], 1e-3, 1e3) if weights.any() else 1
    if (left(1) < 0.01 or (np.abs(ratio - 1) < 0.01).all()
            or left(ratio) > min(0.4 * left(1), 0.25)):
        return Lights(np.ones(3), left(1))
    return Lights(ratio, left(ratio))


def filtered(frames: list[Frame], given: list[dict[str, np.ndarray]],
             changes: list[Lights], m, has_peaks: bool) -> dict[str, np.ndarray]:
    """Signals of the last frame."""
    sharp_levels = m.sharp_innovation_levels, m.sharp_output_levels
    settings = {
        "L": (m.light_alpha, m.innovation_levels, m.output_levels, m.light_sigma, m.light_change),
        "G": (m.light_alpha, *sharp_levels, m.light_sigma, m.glossy_change)}
    visible = m.visibility_alpha, *sharp_levels, m.visibility_sigma, m.visibility_change
    kept: dict[str, tuple[np.ndarray, ...]] = {}  # h, s^2 and N
    energy = np.zeros(0)
    lengths: dict[str, np.ndarray] = {}  # by what has one, see `length_of`
    previous, out = None, {}
    own = m
    image_before = np.zeros(frames[0]["id"].shape)
    for frame, signals, lights in zip(frames, given, changes, strict=True):
        m, share = own, 0.0
        if previous is not None and m.follow_shadows and "light" in frame and len(given[0]) > 1:
            share = share_of_moving_lights(previous, frame)
            m = under_moving_lights(own, share)
        light_threshold = m.noise_threshold
        if previous is not None and lights.rests and share == 0:
            light_threshold = np.where(at_rest(previous, frame), 4, 1) * m.noise_threshold
            if objects_at_rest(previous, frame).all():
                m = replace(m, min_gain=m.min_gain / 2)
        signals = dict(signals)
        if "V" in signals:
            signals["V"] = of_lit_neighbours(frame, signals["V"], m)
        found = np.zeros(frame["id"].shape, bool)
        ns = {length_of(frame, name): np.ones(found.shape) for name in signals}
        if previous is not None:
            for key, length in lengths.items():
                old, found = look_up(previous, frame, length[..., None], m)
                ns[key] = np.where(found, np.minimum(old[..., 0] + 1, m.max_history_length), 1)
        parts, out = {}, {}
        for name, d in signals.items():
            _, smoothing, *_, p = settings.get(name, visible)
            sparse, groups = name.isdigit(), [n for n in signals if n.isdigit()]
            told = frame["group"] == int(name) if sparse else np.ones(found.shape, bool)
            omega = told * frame["group_sample"][..., 1].astype(float) if sparse else 1.0 * told
            follows = m.follow_shadows and "light" in frame and (
                sparse or (name == "V" and "group" not in frame))
            lone = np.minimum(d / np.maximum(omega, 0.1)[..., None], MOST)
            spatial = (sample_variance(frame, lone[..., 0], omega > 0, m) if sparse
                       else spatial_variance(frame, d, m))
            energy = np.zeros(found.shape)
            e, s2, h, samples = np.zeros_like(d), np.zeros(found.shape), 0 * d, 0 * omega
            here = np.where(found, omega, 0) if sparse else omega
            if previous is not None:
                both = np.concatenate([kept[name][0], *(k[..., None] for k in kept[name][1:])], -1)
                both, _ = look_up(previous, frame, both, m)
                h, s2, samples = both[..., :-2], both[..., -2], both[..., -1]
                if name in "LG":
                    h, s2 = h * lights.ratio, s2 * luminance(lights.ratio) ** 2
                e = np.where(found[..., None], d - omega[..., None] * h, 0)
            if name == "G" and "L" in signals and has_peaks and "roughness" in frame:
                twice = np.where(found, np.minimum(lum(d), lum(d - e)), 0)
                twice = np.where(roughness_of(frame) < 0.2, twice, 1e36)
                whole = with_their_light(
                    *without_peaks(frame, d, 3 * twice, 4, m.innovation_levels, m))
                e = np.where(found[..., None], e + whole - d, 0)
                d = signals[name] = whole
                spatial = spatial_variance(frame, d, m)
            if previous is not None:
                energy = smooth(frame, lum(e)[..., None] ** 2, found, 2, m)[..., 0]
            narrow = narrowness(frame, told, m) if follows else np.zeros(found.shape)
            if follows and len(groups) > 1:
                narrow = np.maximum(narrow, 0.3 * narrowness(frame, frame["group"] >= 0, m))
            q = spread(frame, lum(e) ** 2, found, smoothing, m, narrow)
            wide = smooth(frame, e, found, smoothing, m, narrow=narrow)
            if previous is not None and follows:
                both = np.concatenate([kept[name][0], kept[name][1][..., None]], -1)
                both, moves = shadow_history(previous, frame, told, both, m)
                moves &= found
                there = both[..., :-1]
                other = np.where(moves[..., None], d - omega[..., None] * there, e)
                levels_ = min(max(5, m.sharp_innovation_levels), m.innovation_levels)
                excess = (smooth(frame, other**2 - e**2, found, 1, m, first=2) if sparse else
                          smooth(frame, other**2 - e**2, found, levels_, m))
                excess = excess + 1e-6 if sparse else excess
                better = excess[..., 0] < 0
                wide = np.where(excess < 0, smooth(frame, other, found, smoothing, m,
                                                   narrow=narrow), wide)
                e = np.where(excess < 0, other, e)
                if sparse:  # chosen before the smoothing
                    wide = smooth(frame, e, found, smoothing, m, narrow=narrow)
                    q = spread(frame, lum(e) ** 2, found, smoothing, m, narrow)
                s2 = np.where(better & moves, both[..., -1], s2)
                h = np.where((better & moves)[..., None], there, h)
                energy = np.maximum(energy + np.minimum(excess[..., 0], 0), 0)
            turn, change = np.zeros(found.shape), wide
            image = np.zeros(found.shape)
            moving = np.ones(found.shape) if follows else None
            if follows and previous is not None:
                moving = unrest(previous, frame, told, m)
            if name == "G" and "roughness" in frame and previous is not None:
                turn = np.where(found, turn_of(previous, frame), 0)
                if "L" in signals and "light" in frame and m.follow_shadows:
                    left_ = what_was_there(previous, frame, image_before)
                    image_before = spread_out(frame, image_motion(previous, frame)[..., None],
                                              m)[..., 0]
                    image = np.minimum(4 * np.maximum(image_before, left_), 1)
            if sparse:
                norm = norm_of(frame, here, found, smoothing, m, narrow)[..., None]
                change = np.clip(h + norm * wide, -0.5, MOST) - h
            k = light_threshold if name == "L" else m.noise_threshold
            left = length_left(name, wide, q, energy, change, h, p, k, moving)
            if name in "LG":
                left = np.minimum(left, 1 / max(lights.renewal, 1e-6))
            if not sparse:
                key = length_of(frame, name)
                ns[key] = np.maximum(np.minimum(ns[key], np.where(found, left, 1)), 1)
            parts[name] = (e, h, wide, q, energy, s2, samples, omega, here, lone, change, left,
                           spatial, narrow, turn, moving, image)
        for name, d in signals.items():
            (e, h, wide, q, energy, s2, samples, omega, here, lone, change, left, spatial,
             narrow, turn, moving, image) = parts[name]
            alpha, _, levels, sigma, _ = settings.get(name, visible)
            sparse = name.isdigit()
            levels = max(levels - 1, 1) if sparse else levels
            n = np.ones(0) if sparse else ns[length_of(frame, name)]
            known = np.minimum(samples, left)
            a = (np.maximum(1 / (known + omega + 0.5 * np.minimum(left, 1)), alpha) if sparse
                 else np.maximum(np.maximum(1 / n, alpha), np.maximum(turn, image / 2)))
            follow = np.maximum(m.glossy_gain * (2 + np.minimum(30 * turn, 1)) / 3
                                if "roughness" in frame else m.glossy_gain, alpha)
            follow = follow + image * (1 - follow)
            if name != "G":
                k = light_threshold if name == "L" else m.noise_threshold
                certain = 1 - k * q / np.maximum(lum(wide) ** 2, 1e-20)
                expected = (m.expected_change * lum(h + wide)) ** 2
                slow = m.min_gain * expected / np.maximum(expected + q, 1e-20)
                sharp = m.sharp_min_gain * (1 if moving is None else 0.4 + 0.6 * moving)
                follow = np.maximum(certain, slow if name == "L" else sharp)
                a = a if name == "L" else np.maximum(a, m.change_alpha * certain)
            if sparse:
                follow = np.maximum(follow, 1 - known)
                noise = most = coin((h + change)[..., 0])
                rest = e - here[..., None] * change
                history = h + follow[..., None] * change + np.minimum(a, 1)[..., None] * rest
                history = np.where(found[..., None], history, np.where(omega[..., None] > 0,
                                                                       lone, 0.5))
                samples = known + omega
                a = np.where(found, np.minimum(a * omega, 1), omega > 0)
            else:
                noise, most = np.maximum(energy - s2, energy / 4), energy
                follow = np.maximum(follow, a)
                history = d - (1 - a)[..., None] * e + (follow - a)[..., None] * wide
            noise = np.where((left < 2) | (turn > 0.5), np.minimum(spatial, most), noise)
            s2 = (1 - a) ** 2 * s2 + a**2 * np.where(found, noise, spatial)
            if sparse:
                s2 = np.where(samples <= 1e-5, 0.25, s2)
            fade = np.clip(1 - ((samples if sparse else n) - 1) / m.fade_frames, 0, 1)
            if name not in "LG":
                narrow = narrow * (1 + np.maximum((samples if sparse else n) - 1, 0) / 8)
            sigmas = sigma + np.zeros(found.shape)
            if name == "G" and "roughness" in frame:
                least = min(m.mirror_sigma / sigma, 1)
                sigmas = sigma * np.clip(roughness_of(frame) / 0.1, least, 1)
            if (name in "LG" and "light" in frame and "layer_share" not in frame
                    and m.follow_shadows and len(signals) > 1):
                narrow = contact(frame, m, name, ns[length_of(frame, "L")])
            before, around = history, None
            bends, bent = None, 0.0
            if name == "G" and "L" in signals and "roughness" in frame:
                bends, bent = bends_of(frame, ns[length_of(frame, "L")])
            if name in "LG" and has_peaks:
                wide = m.innovation_levels if "L" in signals else m.sharp_innovation_levels
                twice = np.where(found, np.minimum(lum(d), lum(d - e)), 0)
                most = 2.5 if name == "L" else 1.5 + 10 * bent
                before, around = without_peaks(frame, history, 0.75 * twice, most, wide, m)
            fade = np.ones(found.shape) if name == "G" else fade
            out[name] = guided(frame, before, s2, levels, sigmas, fade, narrow, m,
                               np.clip(samples, 1e-5, 1) if sparse else None,
                               {"L": 0.2, "G": 1.0}.get(name, 0),
                               int(name == "L" and has_peaks and m.output_levels
                                   < m.innovation_levels), bends)
            if around is not None:
                out[name] = with_their_light(out[name], around)
            if sparse:
                history = np.where(samples[..., None] > 1e-5, history, out[name])
            kept[name] = history, s2, np.minimum(samples, 64)
        lengths, previous = ns, frame
    return out


def objects_at_rest(previous: Frame, frame: Frame) -> np.ndarray:
    return np.array([np.array_equal(*both) for both in zip(previous.world_from_object,
                                                           frame.world_from_object)])


def at_rest(previous: Frame, frame: Frame) -> np.ndarray:
    """Where the object has not moved."""
    return (frame["id"] >= 0) & objects_at_rest(previous, frame)[frame["id"]]


def share_of_moving_lights(previous: Frame, frame: Frame) -> float:
    """Twice the share of the rays that went to lights that have moved, at most 1."""
    asked = np.abs(frame["light"]).sum(-1) > 0
    ids = frame["light_id"]
    known = asked & (ids >= 0) & (ids < len(frame.world_from_object))
    moved = ~objects_at_rest(previous, frame)[ids[known].astype(int)]
    return min(2 * moved.sum() / max(asked.sum(), 1), 1)


def under_moving_lights(m, share: float):
    """The method as it is where so many rays went to lights that have moved."""
    return replace(
        m, min_gain=m.min_gain + share * (1 - m.min_gain), noise_threshold=m.noise_threshold
        * (1 - share / 2), expected_change=m.expected_change / max(1 - share, 1e-4),
        sharp_min_gain=m.sharp_min_gain + share * max(0.9 - m.sharp_min_gain, 0))


def length_of(frame: Frame, name: str) -> str:
    """What a signal's history has its length in common with: sharp signals of one light."""
    return name if "group" in frame or name == "L" else "sharp"


def coin(visibility: np.ndarray) -> np.ndarray:
    """The variance of a sample of a visibility."""
    mean = np.clip(visibility, 0, 1)
    return np.maximum(mean * (1 - mean), 0.01)


def length_left(name: str, wide: np.ndarray, q: np.ndarray, energy: np.ndarray,
                change: np.ndarray, h: np.ndarray, p: float, k: Any,
                moving: np.ndarray | None = None) -> np.ndarray:
    """n, or N, that a change of light leaves at most."""
    threshold = k * (1 if name in "LG" else 0.5 if moving is None else 4 - 3.5 * moving)
    luminance2 = size = lum(wide) ** 2
    if name.isdigit():
        certain = 1 - threshold * q / np.maximum(size, 1e-20)
        return coin((h + change)[..., 0]) / np.maximum(
            p * (np.maximum(certain, 0) * change[..., 0]) ** 2, 1e-20)
    if name != "V":
        color = np.maximum(wide[..., 0] ** 2, wide[..., 2] ** 2 / 4)
        size = np.maximum(size, color / 4 if name == "L" else color)
    alike = np.minimum(luminance2, energy) / np.maximum(np.maximum(luminance2, energy), 1e-20)
    q = energy / 48 if name == "G" else q
    certain = 1 - threshold * q * (1 - alike**4) / np.maximum(size, 1e-20)
    size = size * np.maximum(certain, 0) ** 2
    size = np.minimum(size, energy**2 / np.maximum(size, 1e-20))
    noise = np.maximum(energy - size, energy / 16)
    return np.where(size > 1e-20, noise / np.maximum(p * size, 1e-20), 1e6)


def norm_of(frame: Frame, omega: np.ndarray, counts: np.ndarray, levels: int, m,
            narrow: np.ndarray | float = 0.0) -> np.ndarray:
    """1 / S[omega], 0 where hardly a ray came by."""
    weight = smooth(frame, omega[..., None], counts, levels, m, narrow=narrow)[..., 0]
    return np.where(weight > 1e-5, 1 / np.maximum(weight, 1e-5), 0)


def repaid(image: np.ndarray, id_: np.ndarray) -> np.ndarray:
    """Nothing below 0: what is, is taken from the pixels of the object around, then from it all."""
    image, (h, w) = image.copy(), id_.shape
    for i in range(7):
        new, wealth = image.copy(), np.maximum(image, 0)
        for y, x, c in np.argwhere(image < 0):
            around = [(y + dy, x + dx) for dy, dx in ((-1 << i, 0), (0, -1 << i), (0, 1 << i),
                                                      (1 << i, 0))
                      if 0 <= y + dy < h and 0 <= x + dx < w and id_[y + dy, x + dx] == id_[y, x]]
            asked = sum(wealth[place][c] for place in around)
            rate = min(-image[y, x, c] / asked, 1 / 8) if asked else 0
            new[y, x, c] += rate * asked
            for place in around:
                new[place][c] -= rate * wealth[place][c]
        image = np.where(np.abs(new) < 1e-12, 0, new)
    for i in np.unique(id_):
        some = image[id_ == i]
        debt, wealth = np.maximum(-some, 0).sum(0), np.maximum(some, 0).sum(0)
        image[id_ == i] = np.maximum(some, 0) * np.maximum(1 - debt / np.maximum(wealth, 1e-30), 0)
    return image
