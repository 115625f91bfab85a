"""Camera moves: looking along a path, orbit, dolly. Each is a motion for `Camera`.

Between keys and outside them they follow `scenes/animation.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from .animation import Animation, Ease, Keys, compose, keys_of_length, track
from .description import Motion, SceneError
from .transforms import Matrix, Vector, look_at, rotate, translate


def looking(origin: Keys | Vector, target: Keys | Vector, ease: Ease = "spline",
            loop: bool = False, up: Vector = (0, 1, 0)) -> Animation:
    """A camera on a path of origins, aimed at a path of targets; a plain (x, y, z) stays put."""
    origin_at, target_at = (
        track(keys_of_length(keys if isinstance(keys, Mapping) else {0: keys}, 3, name), ease,
              loop and isinstance(keys, Mapping))
        for keys, name in ((origin, "camera origin"), (target, "camera target")))
    return Animation(lambda frame: _aim(origin_at(frame), target_at(frame), up))


def orbit(target: Vector, radius: float, azimuth: Keys, elevation: float = 20,
          ease: Ease = "smooth") -> Animation:
    """A camera that circles `target` and looks at it.

    azimuth: keyframes in degrees about +y, 0 on the target's +z side; elevation: degrees,
    above -90 and below 90.
    """
    angle = track(keys_of_length(azimuth, 0, "azimuth"), ease)
    if not (radius > 0 and -90 < elevation < 90):
        raise SceneError(f"an orbit has radius {radius} and elevation {elevation}: "
                         "use a positive radius and -90 to 90 degrees")
    tilt = math.radians(elevation)
    arm = radius * np.array([0, math.sin(tilt), math.cos(tilt)])

    def matrix_at(frame: float) -> Matrix:
        offset = rotate((0, 1, 0), float(angle(frame)))[:3, :3] @ arm
        return _aim(np.asarray(target, float) + offset, target)

    return Animation(matrix_at)


def dolly(world_from_camera: Matrix | Motion, travel: Keys, direction: Vector = (0, 0, 1),
          ease: Ease = "smooth") -> Animation:
    """A camera moved along a direction of its own: by default forward, by keyed distances.

    direction: camera space (x right, y down, z forward); travel: in lengths of `direction`.
    """
    distance = track(keys_of_length(travel, 0, "travel"), ease)
    return compose(world_from_camera,
                   lambda frame: translate(distance(frame) * np.asarray(direction, float)))


def _aim(origin: Vector, target: Vector, up: Vector = (0, 1, 0)) -> Matrix:
    try:
        return look_at(origin, target, up)
    except ValueError as error:
        raise SceneError(f"the camera cannot be aimed: {error}") from error
