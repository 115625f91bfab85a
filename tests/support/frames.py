"""Frames with known geometry, computed in float64: a tilted wall (object 0), a board in front of
it that may move (object 1), and nothing to the right of the wall."""

from __future__ import annotations

import numpy as np

from onespp.render.channels import CHANNELS
from onespp.render.frame import Frame

WALL_NORMAL = np.array([0.3, 0.1, -1.0]) / np.linalg.norm([0.3, 0.1, -1.0])


def translation(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def turn(angle: float) -> np.ndarray:
    """Rotation about y, radians."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]])


def make_frame(height: int, width: int, *, index: int = 0, camera: np.ndarray | None = None,
               board: np.ndarray | None = None, origin: tuple[float, float, float] = (0, 0, 0),
               wall_end: float = 3.0, color: np.ndarray | None = None) -> Frame:
    """A frame of wall and board.

    Args:
        camera: world_from_camera relative to `origin` (x right, y down, z forward).
        board: its world_from_object relative to `origin`; it is the square |x|, |y| < 1.2 at z = 6.
        origin: where all of it is, world units.
        color: (h, w, 3); by default a texture that sticks to the objects.
    """
    camera = np.eye(4) if camera is None else camera
    board = np.eye(4) if board is None else board
    f = 1.2 * width
    y, x = np.mgrid[:height, :width] + 0.5
    direction = np.stack([(x - width / 2) / f, (y - height / 2) / f, np.ones_like(x)], -1)
    ray = direction @ camera[:3, :3].T
    eye = camera[:3, 3]
    depth, id_ = np.full((height, width), np.inf), np.full((height, width), -1)
    normal, texture = np.zeros((height, width, 3)), np.zeros((height, width, 3))
    for i, (n, point) in enumerate([(WALL_NORMAL, np.array([0, 0, 10.0])),
                                    (np.array([0, 0, -1.0]), np.array([0, 0, 6.0]))]):
        world_from_object = np.eye(4) if i == 0 else board
        n = world_from_object[:3, :3] @ n
        point = (world_from_object @ [*point, 1])[:3]
        t = n @ (point - eye) / (ray @ n)
        object_from_world = np.linalg.inv(world_from_object)
        local = (eye + t[..., None] * ray) @ object_from_world[:3, :3].T + object_from_world[:3, 3]
        covers = local[..., 0] < wall_end if i == 0 else (np.abs(local[..., :2]) < 1.2).all(-1)
        hit = (t > 0) & (t < depth) & covers
        depth[hit], id_[hit], normal[hit] = t[hit], i, n
        texture[hit] = 0.5 + 0.4 * np.sin(local[hit] * [1.7, 1.3, 0.9] + [0.3, i, 2.0])
    hit = id_ >= 0
    depth = np.where(hit, depth, 0)
    world_from_origin = translation(*origin)
    position = np.where(hit[..., None], eye + depth[..., None] * ray, eye) + np.asarray(origin)
    screen_from_camera = np.array([[f, 0, width / 2, 0], [0, f, height / 2, 0],
                                   [0, 0, 0, 1], [0, 0, 1, 0.0]])
    camera_from_world = np.linalg.inv(world_from_origin @ camera)
    images = {"color": texture if color is None else color, "normal": normal,
              "position": position, "depth": depth,
              "albedo": np.where(hit[..., None], [0.5] * 3, 0),
              "replay": np.full((height, width, 2), -1.0),
              "replay_before": np.full((height, width, 2), -1.0)}
    return Frame(index, {**{k: v.astype(np.float32) for k, v in images.items()},
                         "id": id_.astype(np.int32)},
                 camera_from_world, screen_from_camera @ camera_from_world,
                 np.stack([world_from_origin, world_from_origin @ board]))


def noisy(frame: Frame, seed: int = 0, sigma: float = 0.3) -> Frame:
    """The frame with gamma-distributed noise on its colour."""
    noise = np.random.default_rng(seed).gamma(1 / sigma**2, sigma**2, frame["color"].shape)
    return with_images(frame, color=frame["color"] * noise)


def with_images(frame: Frame, **images: np.ndarray) -> Frame:
    """The frame with some images replaced."""
    typed = {k: np.asarray(v, np.int32 if CHANNELS[k].is_id else np.float32)
             for k, v in images.items()}
    return Frame(frame.index, {**frame.images, **typed}, frame.camera_from_world,
                 frame.screen_from_world, frame.world_from_object)
