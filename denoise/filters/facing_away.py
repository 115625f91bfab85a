"""Pixels at silhouettes of smooth meshes whose shading normal faces away from the camera.

Light would have to come through the mesh to be scattered to the camera there, so such a pixel is
dark, or black, among bright ones of its own surface, and alone or in a line: neither its plane nor
where it was before tells how dark. Its result is the mean of the frame's colour over those pixels
within `RADIUS` that face away too and see the same object. (So it is with Mitsuba; other renderers
may bend such normals back.)

NumPy, for few pixels. Our own.
"""

from __future__ import annotations

import numpy as np

RADIUS = 3  # pixels


def colors_facing_away(color: np.ndarray, ids: np.ndarray, away: np.ndarray) -> np.ndarray:
    """(n, 3) float32: the result at each pixel that faces away, row by row.

    Args:
        color: (h, w, 3), linear; what is not finite does not count. ids: (h, w). away: (h, w)
            bool.
    """
    rows, columns = np.nonzero(away)
    height, width = away.shape
    total, count = np.zeros((len(rows), 3)), np.zeros(len(rows))
    side = range(-RADIUS, RADIUS + 1)
    for dy in side:
        for dx in side:
            y, x = rows + dy, columns + dx
            inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
            y, x = np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)
            value = color[y, x]
            alike = (inside & away[y, x] & (ids[y, x] == ids[rows, columns])
                     & np.isfinite(value).all(-1))
            total += np.where(alike[:, None], value, 0)
            count += alike
    return (total / np.maximum(count, 1)[:, None]).astype(np.float32)
