"""Frames to measure kernels with: known geometry and noise, no renderer and no files.

A tilted wall (object 0) that ends before the image does, a square in front of it that moves to the
right (object 1), a camera that moves too, and light with gamma-distributed noise. A lamp that the
camera does not see (object 2), and whose brightness varies, gets one shadow ray a pixel; the
square's shadow falls on the wall.

    color = direct + indirect,  direct = visibility unshadowed
"""

from __future__ import annotations

import numpy as np

from onespp.denoise.metrics.luminance import luminance
from onespp.render.frame import Frame

_WALL = np.array([0.3, 0.1, -1.0]) / np.linalg.norm([0.3, 0.1, -1.0])
_SQUARE = np.array([0.0, 0.0, -1.0])
_NOISE = 0.5  # standard deviation over mean
_SIDE, _DEPTH = 3.0, 6.0  # of the square, scene units
_LAMP, _LAMP_ID, _LAMP_SIZE = np.array([1.5, -2.0, 2.0]), 2, 0.15  # centre, standard deviation
_DIRECT, _GLOSSY = 0.6, 0.2  # share of direct light in all, of specular in indirect light
_ROUGHNESS = 0.3
_HIT_DISTANCE = 2.5  # from wall to square, and from square to wall: what their paths say
_STRATUM = 3  # pixels, side: one of them is shaded again


def probe(height: int, width: int, index: int, textured: bool = True) -> Frame:
    """Frame `index` of the animation.

    With `textured` it has albedo and all that a method of ours reads: emission (black), direct,
    indirect and specular light, roughness, what reflections show, unshadowed light and visibility,
    shadow rays, samples shaded again.
    """
    focal = 0.8 * width
    eye = np.array([0.02 * index, 0.0, 0.0])
    moved = np.eye(4)
    moved[0, 3] = _square_x(index)
    y, x = np.mgrid[:height, :width] + 0.5
    ray = np.stack([(x - width / 2) / focal, (y - height / 2) / focal, np.ones_like(x)], -1)
    id_, depth = np.full((height, width), -1, np.int32), np.full((height, width), np.inf)
    normal, local = np.zeros_like(ray), np.zeros_like(ray)
    for i, (n, point) in enumerate([(_WALL, [0, 0, 10]), (_SQUARE, [moved[0, 3], 0, _DEPTH])]):
        z = (np.asarray(point) - eye) @ n / (ray @ n)
        there = eye + z[..., None] * ray - point
        covers = there[..., 0] < 5 if i == 0 else (np.abs(there[..., :2]) < _SIDE / 2).all(-1)
        hit = covers & (z > 0) & (z < depth)
        id_[hit], depth[hit], normal[hit], local[hit] = i, z[hit], n, there[hit]
    depth[id_ < 0] = 0
    light = 0.5 + 0.3 * np.sin(local * [1.7, 1.3, 0.9] + id_[..., None])
    albedo = 0.5 + 0.3 * np.sin(5 * local[..., [1, 0, 1]]) if textured else 1.0
    position = eye + depth[..., None] * ray
    rng = np.random.default_rng(index)
    toward, sample = _shadow_rays(position, id_, rng), _noise(rng, (height, width))
    fraction = _blocked_at(position, toward, id_, index)
    visibility = np.where(fraction > 0, 0, sample)
    shaded = light * albedo  # with the lamp at brightness 1
    unshadowed = _brightness(index) * _DIRECT * shaded
    bounced = (1 - _DIRECT) * shaded * _noise(rng, light.shape)
    indirect = _brightness(index) * bounced
    direct = visibility[..., None] * unshadowed
    images = {"color": direct + indirect, "normal": normal, "depth": depth, "position": position}
    ids = {"id": id_}
    if textured:
        images |= {
            "albedo": albedo, "emission": np.zeros_like(light), "direct": direct,
            "indirect": indirect, "specular": _GLOSSY * indirect,
            "roughness": np.where(id_ < 0, 1, _ROUGHNESS), "unshadowed": unshadowed,
            "visibility": visibility, "light": toward,
            "blocker_distance": fraction * np.linalg.norm(toward, axis=-1),
            "hit_distance": np.where(id_ < 0, 0, _HIT_DISTANCE)}
        ids |= {"hit_id": np.where(id_ < 0, -1, 1 - id_),
                "light_id": np.where(id_ < 0, -1, _LAMP_ID),
                "blocker_id": np.where(fraction > 0, 1, -1)}
        was_lit = _blocked_at(position, toward, id_, index - 1) == 0
        sampled = _one_a_stratum(height, width, rng)
        arriving, bounced = sample * luminance(_DIRECT * shaded), luminance(bounced)
        for name, i, lit in (("replay", index, fraction == 0),
                             ("replay_before", index - 1, was_lit)):
            both = _brightness(i) * np.stack([lit * arriving, bounced], -1)
            images[name] = np.where(sampled[..., None], both, -1)
    camera_from_world = np.eye(4)
    camera_from_world[:3, 3] = -eye
    screen_from_camera = np.array([[focal, 0, width / 2, 0], [0, focal, height / 2, 0],
                                   [0, 0, 0, 1], [0, 0, 1, 0]])
    typed = ({k: v.astype(np.float32) for k, v in images.items()}
             | {k: v.astype(np.int32) for k, v in ids.items()})
    return Frame(index, typed,
                 camera_from_world, screen_from_camera @ camera_from_world,
                 np.stack([np.eye(4), moved, np.eye(4)]))


def _square_x(index: int) -> float:
    return 0.1 * index


def _brightness(index: int) -> float:
    """Of the lamp."""
    return 1 + 0.1 * np.sin(index)


def _noise(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Factors of mean 1."""
    return rng.gamma(1 / _NOISE**2, _NOISE**2, shape)


def _shadow_rays(position: np.ndarray, id_: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(h, w, 3) from each surface to a point of the lamp; 0 where there is no surface."""
    points = _LAMP + _LAMP_SIZE * rng.standard_normal(position.shape)
    return np.where(id_[..., None] >= 0, points - position, 0)


def _blocked_at(position: np.ndarray, toward: np.ndarray, id_: np.ndarray,
                index: int) -> np.ndarray:
    """(h, w) share of the wall's shadow ray at which the square of a frame stops it; 0: it does
    not."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (_DEPTH - position[..., 2]) / toward[..., 2]
        there = (position + share[..., None] * toward)[..., :2] - [_square_x(index), 0]
    stops = (id_ == 0) & (share > 0) & (share < 1) & (np.abs(there) < _SIDE / 2).all(-1)
    return np.where(stops, share, 0)


def _one_a_stratum(h: int, w: int, rng: np.random.Generator) -> np.ndarray:
    """(h, w) mask of the pixels whose sample of the frame before is shaded again."""
    y, x = np.mgrid[:h, :w]
    rows, columns = -(-h // _STRATUM), -(-w // _STRATUM)
    chosen = rng.integers(_STRATUM**2, size=(rows, columns))[y // _STRATUM, x // _STRATUM]
    return (y % _STRATUM) * _STRATUM + x % _STRATUM == chosen
