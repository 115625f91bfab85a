"""Multiple importance sampling: the weight of a sample that two techniques could have drawn."""

from __future__ import annotations

import drjit as dr

from onespp.render.mitsuba.variant import mi


def power_heuristic(p: mi.Float, q: mi.Float) -> mi.Float:
    """Power heuristic weight of a sample drawn with density p where q could have drawn it too.

    Source: Veach 1997, section 9.2.2, exponent 2. Infinite or zero densities give 1 or 0.
    """
    w = dr.square(p) / (dr.square(p) + dr.square(q))
    return dr.select(p > 0, dr.select(dr.isfinite(w), w, 1), 0)
