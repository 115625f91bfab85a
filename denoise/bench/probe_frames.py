"""Frames to measure kernels with: known geometry and noise, no renderer and no files.

A tilted wall (object 0) that ends before the image does, a square in front of it that moves to the
right (object 1), a camera that moves too, and light with gamma-distributed noise.
"""

from __future__ import annotations

import numpy as np

from onespp.render.frame import Frame

_WALL = np.array([0.3, 0.1, -1.0]) / np.linalg.norm([0.3, 0.1, -1.0])
_SQUARE = np.array([0.0, 0.0, -1.0])
_NOISE = 0.5  # deviation over mean


def probe(height: int, width: int, index: int, textured: bool = True) -> Frame:
    """Frame `index` of the animation; with albedo if `textured`."""
    focal = 0.8 * width
    eye = np.array([0.02 * index, 0.0, 0.0])
    moved = np.eye(4)
    moved[0, 3] = 0.1 * index
    y, x = np.mgrid[:height, :width] + 0.5
    ray = np.stack([(x - width / 2) / focal, (y - height / 2) / focal, np.ones_like(x)], -1)
    id_, depth = np.full((height, width), -1, np.int32), np.full((height, width), np.inf)
    normal, local = np.zeros_like(ray), np.zeros_like(ray)
    for i, (n, point) in enumerate([(_WALL, [0, 0, 10]), (_SQUARE, [moved[0, 3], 0, 6])]):
        z = (np.asarray(point) - eye) @ n / (ray @ n)
        there = eye + z[..., None] * ray - point
        covers = there[..., 0] < 5 if i == 0 else (np.abs(there[..., :2]) < 1.5).all(-1)
        hit = covers & (z > 0) & (z < depth)
        id_[hit], depth[hit], normal[hit], local[hit] = i, z[hit], n, there[hit]
    depth[id_ < 0] = 0
    light = 0.5 + 0.3 * np.sin(local * [1.7, 1.3, 0.9] + id_[..., None])
    noise = np.random.default_rng(index).gamma(1 / _NOISE**2, _NOISE**2, light.shape)
    albedo = 0.5 + 0.3 * np.sin(5 * local[..., [1, 0, 1]])
    color = light * noise * (albedo if textured else 1)
    images = {"color": color, "normal": normal, "depth": depth,
              "position": eye + depth[..., None] * ray}
    if textured:
        images["albedo"] = albedo
    camera_from_world = np.eye(4)
    camera_from_world[:3, 3] = -eye
    screen_from_camera = np.array([[focal, 0, width / 2, 0], [0, focal, height / 2, 0],
                                   [0, 0, 0, 1], [0, 0, 1, 0]])
    return Frame(index, {"id": id_, **{k: v.astype(np.float32) for k, v in images.items()}},
                 camera_from_world, screen_from_camera @ camera_from_world,
                 np.stack([np.eye(4), moved]))
