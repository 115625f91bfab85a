"""Light that a drawn direction runs into, weighed against light sampling where it was drawn.

Weights of multiple importance sampling are of a vertex and a direction. What a path does on its way
without being turned by chance changes neither: on through a mask, a pane (`panes.py`) or a slab of
glass (`slabs.py`) it has left the same vertex in the same direction; by a flat mirror
(`mirrors.py`) it has left that vertex's image; by a ball (`balls/`) and through glass light
sampling has a density of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr

from onespp.render.mitsuba.variant import mi

from .balls.balls import Balls
from .mirrors import Mirrors
from .panes import Gone, Panes, density_through
from .strata import power_heuristic


@dataclass
class Origin:
    """The last vertex that turned a path by chance, as its direction has left it.

    p: the vertex, or its image in a mirror. pdf: the BSDF's density of the direction. from_delta:
    whether no other direction was possible, so that light sampling could not have found it. sought:
    whether light was looked for in mirrors and balls from there, and the path has met nothing
    since; None where there are none. share: by how much densities of light sampling count; None
    where they always do in full. by: a ball that the path has met since; None where there are none.
    gone: what it has gone through since; None where there is nothing that it could. shown: what
    mirror it was in, if there are any beside that.
    """

    p: mi.Point3f
    pdf: mi.Float
    from_delta: mi.Bool
    sought: mi.Bool | None
    share: mi.Float | None
    by: Met | None
    gone: Gone | None
    shown: Shown | None

    @staticmethod
    def camera(mirrors: Mirrors | None, balls: Balls | None, panes: Panes | None,
               compares: bool = False) -> Origin:
        """Of a camera's ray; compares: whether vertices compare points of lights by balls."""
        several = mirrors is not None and panes is None and mirrors.count > 1
        none = panes is not None or (mirrors is None and balls is None)
        return Origin(mi.Point3f(0), mi.Float(1), mi.Bool(True),
                      None if none else mi.Bool(False), mi.Float(1) if several else None,
                      None if balls is None else Met.none(compares),
                      None if panes is None else Gone.none(),
                      None if panes is None or mirrors is None else Shown.none())

    def begun(self, begins: mi.Bool) -> Origin:
        """That of the camera where a path begins."""
        return Origin(self.p, dr.select(begins, 1, self.pdf), self.from_delta | begins,
                      None if self.sought is None else self.sought & ~begins, self.share,
                      None if self.by is None else dr.select(
                          begins, Met.none(self.by.is_first is not None), self.by),
                      None if self.gone is None else dr.select(begins, Gone.none(), self.gone),
                      None if self.shown is None else dr.select(begins, Shown.none(), self.shown))

    def came_by_ball(self, depth: mi.UInt32) -> mi.Bool:
        """Whether a path has come from its first vertex by a ball to the one of this depth."""
        assert self.by is not None
        return (self.by.ball != 0) & (depth == dr.select(self.by.refracted, mi.UInt32(3), 2))

    def after(self, si: mi.SurfaceInteraction3f, sample: mi.BSDFSample3f, panes: Panes | None,
              mirrors: Mirrors | None, balls: Balls | None, seeks: mi.Bool, active: mi.Bool,
              is_first: mi.Bool | None = None) -> tuple[Origin, mi.Bool]:
        """Behind a surface, and whether that was no scattering event.

        Args:
            panes: what light goes through; mirrors, balls: None where that is not.
            seeks: whether light was looked for in mirrors and balls from here. is_first: of
                `Met`, here.
        """
        is_delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        p, is_same, sought, share, by = self.p, mi.Bool(False), None, None, None
        gone, shown, reflects = None, None, mi.Bool(False)
        if panes is not None:
            assert self.gone is not None
            gone, is_same = self.gone.after(si, sample, panes, active)
            if self.shown is not None:
                assert mirrors is not None
                shown, reflects, is_same = self.shown.after(si, sample, mirrors, self.gone, is_same,
                                                            active)
                p = mirrors.image(shown.mirror - 1, self.p, reflects)
                p = dr.select(reflects, p, self.p)
                shown = dr.select(is_same, shown, Shown(mi.UInt32(0), mi.Bool(False),
                                                        seeks & ~is_delta))
            gone = dr.select(is_same, gone, Gone.none())
        elif self.sought is not None:
            sought = seeks & ~is_delta
            if mirrors is not None:
                row = mirrors.row(si.shape, active)
                is_same = is_delta & self.sought & (row != 0)
                p = mirrors.image(row - 1, self.p, is_same)
            if self.share is not None:
                assert mirrors is not None
                share = dr.select(is_same, mi.Float(1 / mirrors.count), 1)
            if balls is not None:
                assert self.by is not None
                by = self.by.after(si, sample, balls, self.sought & active, active)
                is_same |= by.ball != 0
                if by.is_first is not None:
                    assert is_first is not None
                    by.is_first = dr.select(is_same, by.is_first, is_first)
        return Origin(dr.select(is_same, p, si.p), dr.select(is_same, self.pdf, sample.pdf),
                      dr.select(is_same, self.from_delta, is_delta), sought, share, by,
                      gone, shown), is_same & ~reflects


@dataclass
class Met:
    """A ball that a path has met since it left its origin.

    ball: which, from 1; 0: none, or it has met something since. sine: of the angle at which it did.
    refracted: whether it went in. inside: whether it is there. is_first: whether the
    origin is the first vertex of a frame's path; None: it is none.
    """

    ball: mi.UInt32
    sine: mi.Float
    refracted: mi.Bool
    inside: mi.Bool
    is_first: mi.Bool | None

    @staticmethod
    def none(compares: bool) -> Met:
        return Met(mi.UInt32(0), mi.Float(0), mi.Bool(False), mi.Bool(False),
                   mi.Bool(False) if compares else None)

    def after(self, si: mi.SurfaceInteraction3f, sample: mi.BSDFSample3f, balls: Balls,
              sought: mi.Bool, active: mi.Bool) -> Met:
        """Behind the next surface.

        Args:
            sought: of the origin, before it.
        """
        row, cosine = balls.row(si.shape, active), si.wi.z
        bounces, passes = (mi.has_flag(sample.sampled_type, flag) for flag in (
            mi.BSDFFlags.DeltaReflection, mi.BSDFFlags.DeltaTransmission))
        meets = sought & (row != 0) & (cosine > 0) & (bounces | passes)
        leaves = active & self.inside & (row == self.ball) & (cosine < 0) & passes
        sine = dr.sqrt(dr.maximum(1 - dr.square(cosine), 0))
        return Met(dr.select(meets | leaves, row, 0), dr.select(meets, sine, self.sine),
                   meets & passes | leaves, meets & passes, self.is_first)


@dataclass
class Shown:
    """A mirror, beside panes, that a path has met since its origin, before all else.

    mirror: which, from 1; 0: none. behind: whether from inside of a slab. sought: whether light was
    looked for in mirrors from the origin.
    """

    mirror: mi.UInt32
    behind: mi.Bool
    sought: mi.Bool

    @staticmethod
    def none() -> Shown:
        return Shown(mi.UInt32(0), mi.Bool(False), mi.Bool(False))

    def after(self, si: mi.SurfaceInteraction3f, sample: mi.BSDFSample3f, mirrors: Mirrors,
              before: Gone, goes: mi.Bool, active: mi.Bool) -> tuple[Shown, mi.Bool, mi.Bool]:
        """Behind a surface; whether that is the mirror; and whether light sampling would come by
        the same way still.

        Args:
            before: what the path has gone through. goes: whether it goes through this, too.
        """
        bounces = active & mi.has_flag(sample.sampled_type, mi.BSDFFlags.DeltaReflection)
        row, none_yet = mirrors.row_at(si, bounces), self.mirror == 0
        reflects = bounces & (row != 0) & none_yet & self.sought & ~before.any
        behind = before.inside != 0
        thickness, _ = mirrors.slab(row - 1, reflects)
        reflects &= (thickness == 0) | ((si.wi.z < 0) == behind)
        reflects &= (thickness > 0) | ~behind
        leaves = goes & ~none_yet & self.behind & behind
        same = reflects | leaves | (goes & none_yet)
        return (Shown(dr.select(reflects, row, self.mirror), dr.select(reflects, behind,
                                                                       self.behind), self.sought),
                reflects, same)


def found_light(scene: mi.Scene, si: mi.SurfaceInteraction3f, origin: Origin,
                surer: mi.Float | float = 1.0, balls: Balls | None = None,
                panes: Panes | None = None, mirrors: Mirrors | None = None) -> mi.Color3f:
    """Radiance of what a direction met, weighed against light sampling.

    Args:
        surer: how many times the density of light sampling counts, as of `strata.py`.
    """
    reference, by = dr.zeros(mi.Interaction3f), origin.by
    reference.p, bent = mi.Point3f(origin.p), mi.Bool(False)
    if balls is not None:
        assert by is not None
        bent = by.ball != 0
        reference.p = dr.select(bent, balls.place(by.ball - 1, bent)[0], reference.p)
    hit = mi.DirectionSample3f(scene, si, reference)
    emitter_pdf = scene.pdf_emitter_direction(reference, hit, ~origin.from_delta)
    if origin.share is not None:
        surer = surer * origin.share
    density = surer * emitter_pdf
    if origin.gone is not None and panes is not None:
        through, is_sky = mi.Float(1), ~si.is_valid()
        if panes.slabs is not None:
            through = density_through(origin.gone, origin.p, hit, is_sky, panes.slabs,
                                      emitter_pdf > 0)
        if origin.shown is not None:
            assert mirrors is not None
            in_mirror = origin.shown.mirror != 0
            _, shown = mirrors.unfolded(origin.shown.mirror - 1, hit.d, hit.dist, is_sky, hit.n,
                                        in_mirror & origin.shown.behind)
            shown = dr.select(origin.gone.inside == 0, shown / mirrors.count, 0)
            through = dr.select(in_mirror, shown, through)
        density = density * through
    if balls is not None:
        assert by is not None
        density = dr.select(bent, balls.density(origin.p, hit, si, emitter_pdf, by.ball - 1,
                                                by.sine, by.refracted, by.is_first, bent), density)
    return power_heuristic(origin.pdf, density) * hit.emitter.eval(si)
