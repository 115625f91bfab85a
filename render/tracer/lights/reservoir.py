"""A reservoir of one: a pick in proportion to weights that are seen one after another.

Source: Chao 1982, "A general purpose unequal probability sampling plan", for a sample of one.
"""

from __future__ import annotations

import drjit as dr

from onespp.render.mitsuba.variant import mi


def offered(left: mi.Float, weight: mi.Float, total: mi.Float) -> tuple[mi.Bool, mi.Float]:
    """Whether what is offered takes the place of what was picked, and a random number for the next.

    Args:
        left: a uniform random number in [0, 1). weight: of what is offered. total: of all so far,
            this one included.
    """
    share = dr.select(total > 0, weight / total, 0)
    taken = left < share
    # What is left of the random number is uniform again.
    left = dr.select(taken, left / share, (left - share) / dr.maximum(1 - share, 1e-9))
    return taken, dr.clip(left, 0, 1 - 2.0**-24)
