"""A camera that fits what a frame shows, for frames of other renderers that come without matrices.

Symbols: z camera-space depth; q = 1/z, q_x and q_y its changes a pixel; (x, y) a pixel's centre
from the middle of the screen; f the focal length, pixels; n a given normal, in whatever space; R
the rotation from there to camera space (x right, y down, z forward).

A plane has q linear on the screen, and the normal of the one around a pixel is, facing the camera,

    m(f) = -(f q_x, f q_y, q - x q_x - y q_y) / |...|.

For each f the rotation that turns n into m(f) best is known (Kabsch 1976), and the f that leaves
the least is taken. Of one plane, say, any f leaves as little: then it is the one nearest to
`USUAL_ANGLE`. A pinhole of another f shows an affine image of the scene in which planes stay
planes, so that filters and tests work there too.

Departure from least squares: what a pixel leaves, o = 1 - cos of an angle, counts as o c / (o + c)
(Geman and McClure 1987), since silhouettes and normal maps fit nothing.
"""

from __future__ import annotations

import numpy as np

USUAL_ANGLE = 45.0    # degrees across the screen
ANGLES = (15.0, 110.0)
OUTLIER = 0.01        # c; an angle of 8 degrees
_SAMPLES = 1024       # pixels that are looked at
_FEWEST = 16
_BENT = 0.01          # second difference of q over q beyond which there is an edge
_UNUSUAL = 1e-5       # 1 - cos that an angle e times the usual one must save


def camera_of_guides(depth: np.ndarray | None, normal: np.ndarray | None,
                     size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """camera_from_world and screen_from_world, (4, 4) float64; world is the normals' space, and
    its origin the camera.

    Args:
        depth: (h, w) camera-space z. normal: (h, w, 3), unit length, facing the camera. Of
            either None: R = 1, and `USUAL_ANGLE`.
        size: (h, w).

    Example:
        >>> depth, normal = np.full((8, 8), 2.0), np.tile([0.0, -1.0, 0.0], (8, 8, 1))
        >>> camera, _ = camera_of_guides(depth, normal, (8, 8))
        >>> (camera @ [0, -1, 0, 0]).round(6).tolist()
        [0.0, 0.0, -1.0, 0.0]
    """
    h, w = size
    f, rotation = _focal(USUAL_ANGLE, w), np.eye(3)
    if depth is not None and normal is not None and min(size) > 2:
        rotation, f = _fitted(*_planes(depth, normal), w)
    camera = np.eye(4)
    camera[:3, :3] = rotation
    screen = np.array([[f, 0, w / 2, 0], [0, f, h / 2, 0], [0, 0, 0, 1], [0, 0, 1, 0.0]])
    return camera, screen @ camera


def _focal(angle: float, width: int) -> float:
    return width / 2 / np.tan(np.radians(angle) / 2)


def _planes(depth: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of pixels inside a surface: (n, 3) q_x, q_y, q - x q_x - y q_y, and (n, 3) normals."""
    h, w = depth.shape
    step = max(1, round((h * w / _SAMPLES) ** 0.5))
    y, x = (c.ravel() for c in np.mgrid[1:h - 1:step, 1:w - 1:step])
    with np.errstate(all="ignore"):  # what is not finite is left out
        q, left, right, up, down = (1 / depth[y + dy, x + dx].astype(np.float64) for dy, dx in (
            (0, 0), (0, -1), (0, 1), (-1, 0), (1, 0)))
        bent = np.maximum(np.abs(left + right - 2 * q), np.abs(up + down - 2 * q)) / q
        q_x, q_y = (right - left) / 2, (down - up) / 2
        planes = np.stack([q_x, q_y, q - (x + 0.5 - w / 2) * q_x - (y + 0.5 - h / 2) * q_y], -1)
        normals = normal[y, x].astype(np.float64)
        length = np.linalg.norm(normals, axis=-1)
        good = ((bent < _BENT) & (q > 0) & np.isfinite(planes).all(-1) & (length > 0.1)
                & np.isfinite(length))
    return planes[good], normals[good] / length[good, None]


def _fitted(planes: np.ndarray, normals: np.ndarray, width: int) -> tuple[np.ndarray, float]:
    """R and f."""
    if len(planes) < _FEWEST:
        return np.eye(3), _focal(USUAL_ANGLE, width)

    def fit(angle: float) -> tuple[float, float, np.ndarray]:
        """What it leaves, and a little for an unusual angle, for where nothing else decides."""
        rotation, left = _rotation(planes, normals, _focal(angle, width))
        return left + _UNUSUAL * abs(np.log(angle / USUAL_ANGLE)), angle, rotation

    best, angles = fit(USUAL_ANGLE), np.linspace(*ANGLES, 12)
    for _ in range(3):
        best = min(best, *map(fit, angles), key=lambda found: found[0])
        step = angles[1] - angles[0]
        angles = np.clip(np.linspace(best[1] - step, best[1] + step, 7), *ANGLES)
    return best[2], _focal(best[1], width)


def _rotation(planes: np.ndarray, normals: np.ndarray, f: float) -> tuple[np.ndarray, float]:
    """The best R for an f, and what it leaves."""
    m = planes * [-f, -f, -1]
    m /= np.linalg.norm(m, axis=-1, keepdims=True)
    weight, rotation, left = np.ones(len(m)), np.eye(3), np.inf
    for _ in range(4):
        u, _, v = np.linalg.svd((weight[:, None] * m).T @ normals)
        rotation = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v
        off = 1 - np.sum(m * (normals @ rotation.T), axis=-1)
        weight = np.square(OUTLIER / (OUTLIER + off))
        left = float(np.mean(off * OUTLIER / (OUTLIER + off)))
    return rotation, left
