"""A blue-noise mask: neighbouring pixels hold numbers that are far apart.

Source: Ulichney 1993, "The void-and-cluster method for dither array generation".
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

SIDE = 64
SIGMA = 1.5  # pixels, Ulichney's choice
_FIRST = 10  # one pixel in so many starts the ranking


@lru_cache(maxsize=1)
def mask(side: int = SIDE) -> np.ndarray:
    """(side, side) ranks, each of 0 ... side^2 - 1 once; tiles. The same in every process."""
    coordinate = np.arange(side)
    distance = np.minimum(coordinate, side - coordinate) ** 2
    spread = np.exp(-(distance[:, None] + distance) / (2 * SIGMA**2))
    # Twice the kernel in both directions, so that any toroidal shift of it is a view.
    tiled = np.tile(spread, (2, 2))

    def around(at: int) -> np.ndarray:
        y, x = divmod(at, side)
        return tiled[side - y:2 * side - y, side - x:2 * side - x].ravel()

    taken, energy = np.zeros(side * side, bool), np.zeros(side * side)

    def put(at: int, sign: int) -> None:
        taken[at] = sign > 0
        energy[:] += sign * around(at)

    def tightest_cluster() -> int:
        return int(np.argmax(np.where(taken, energy, -np.inf)))

    def largest_void() -> int:
        return int(np.argmin(np.where(taken, np.inf, energy)))

    first = max(1, side * side // _FIRST)
    for at in np.random.default_rng(0).permutation(side * side)[:first]:
        put(at, 1)
    while True:  # even out: the most crowded pixel moves to the emptiest place
        cluster = tightest_cluster()
        put(cluster, -1)
        void = largest_void()
        put(void, 1)
        if void == cluster:
            break
    ranks, start = np.empty(side * side, np.int64), (taken.copy(), energy.copy())
    for rank in range(first)[::-1]:
        ranks[cluster := tightest_cluster()] = rank
        put(cluster, -1)
    taken[:], energy[:] = start
    for rank in range(first, side * side):
        ranks[void := largest_void()] = rank
        put(void, 1)
    return ranks.reshape(side, side)
