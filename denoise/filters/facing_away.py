"""Pixels at silhouettes of smooth meshes whose shading normal faces away from the camera.

Light would have to come through the mesh to be scattered to the camera there, but by a glossy lobe,
which goes on along the surface. So where there is a diffuse one such a pixel is dark, or black,
among bright ones of its own surface, and alone or in a line: neither its plane nor where it was
before tells how dark. Its result is the mean of the frame's colour over those pixels within
`RADIUS` that face away too and see the same object. (So it is with Mitsuba; other renderers may
bend such normals back.)

NumPy, for few pixels. Our own.
"""

from __future__ import annotations

import numpy as np

RADIUS = 3  # pixels
LARGEST_SHARE = 0.05
"""Share of the pixels from which on normals face away by another rule, as where they point inward:
then they are taken as if they did not."""


def colors_facing_away(color: np.ndarray, ids: np.ndarray, away: np.ndarray) -> np.ndarray:
    """(n, 3) float32: the result at each pixel that faces away, row by row.

    Args:
        color: (h, w, 3), linear; what is not finite does not count. ids: (h, w). away: (h, w)
            bool.
    """
    height, width = away.shape
    # (np.nonzero of an image takes several times as long where little is there)
    y, x = (index[:, None] for index in np.divmod(np.flatnonzero(away), width))
    side = np.arange(2 * RADIUS + 1) - RADIUS
    rows, columns = y + np.repeat(side, len(side)), x + np.tile(side, len(side))
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    rows, columns = np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)
    value = color[rows, columns].astype(np.float64)
    alike = inside & away[rows, columns] & (ids[rows, columns] == ids[y, x])
    alike &= np.isfinite(value).all(-1)
    total = np.where(alike[..., None], value, 0).sum(1)
    return (total / np.maximum(alike.sum(1), 1)[:, None]).astype(np.float32)
