"""A point of a light, in a stratum: what it gives where nothing is in its way, and its weight.

A stratum is a cell of an emitter's sample square, or all of it. The weights are of multiple
importance sampling (Veach 1997, section 9.2.2). Picks are by what lights give, so that a lamp close
by is picked nearly for sure: its density counts as if it was, not as one of E lights. So nearly all
that comes from lamps is in U; what the BSDF's sample runs into, U does not tell. The environment's
counts as one of E: its strata are wide, those that the horizon cuts are seldom picked, and light
with a weight of 1 would be fireflies there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from onespp.render.mitsuba.variant import mi

from .panes import Aim, Panes
from .sun import Sun


@dataclass
class LightPoint:
    """c, the contribution of a point of a light; the point; the BSDF's density toward it; and the
    way there, of `Panes.aimed`, None where it is straight."""

    c: mi.Color3f
    light: mi.DirectionSample3f
    bsdf_pdf: mi.Float
    aim: Aim | None = None

    def weight(self, share: mi.Float) -> mi.Float:
        """Of multiple importance sampling; share: of the light's density that counts."""
        light = self.light
        return dr.select(light.delta, 1, power_heuristic(share * light.pdf, self.bsdf_pdf))


def stratum_word(light: Any, halvings: Any, cell: Any) -> Any:
    """A stratum in a word: a cell, row by row, of a light whose sides are halved so often.

    light: 256 times the index of its emitter; of a sun `SUN_BIT` (`sun.py`) more.
    """
    return light + halvings * 16 + cell


def stratum_place(stratum: mi.UInt32, place: mi.Point2f) -> tuple[mi.Point2f, mi.Float]:
    """A place in a stratum on the sample square of its light, and how many are along a side."""
    halvings, cell = (stratum >> 4) & 7, stratum & 15  # no division: idle lanes have all bits 0
    row, side = cell >> halvings, mi.Float(1 << halvings)
    return (mi.Point2f(cell - (row << halvings), row) + place) / side, side


def light_point(scene: mi.Scene, si: mi.SurfaceInteraction3f, stratum: mi.UInt32,
                place: mi.Point2f, active: mi.Bool, sun: Sun | None,
                panes: Panes | None = None) -> LightPoint:
    """At a place in a stratum, toward `si.wi`; by way of panes, if there are some."""
    emitter = dr.gather(mi.EmitterPtr, scene.emitters_dr(), stratum >> 8, active)
    sample, side = stratum_place(stratum, place)
    light, weight = emitter.sample_direction(si, sample, active)
    if sun is not None:
        light, weight = sun.told_apart(scene, si, stratum, sample, light, weight, active)
    aim = None
    if panes is not None:
        light, weight, aim = panes.aimed(si.p, light, weight, active)
    value, pdf = si.bsdf().eval_pdf(mi.BSDFContext(), si, si.to_local(light.d), active)
    c = dr.select(active & (light.pdf > 0), value * weight, 0) / dr.square(side)
    return LightPoint(c, light, pdf, aim)


def power_heuristic(p: mi.Float, q: mi.Float) -> mi.Float:
    """Power heuristic weight of a sample drawn with density p where q could have drawn it too.

    Source: Veach 1997, section 9.2.2, exponent 2. Infinite or zero densities give 1 or 0.
    """
    w = dr.square(p) / (dr.square(p) + dr.square(q))
    return dr.select(p > 0, dr.select(dr.isfinite(w), w, 1), 0)
