"""Light that a drawn direction runs into, weighed against light sampling where it was drawn.

Weights of multiple importance sampling are of a vertex and a direction. What a path does on its way
without being turned by chance changes neither: straight on through a mask or a pane (`panes.py`) it
has left the same vertex in the same direction; by a flat mirror (`mirrors.py`) it has left that
vertex's image.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr

from onespp.render.mitsuba.variant import mi

from .mirrors import Mirrors
from .panes import goes_through
from .strata import power_heuristic


@dataclass
class Origin:
    """The last vertex that turned a path by chance, as its direction has left it.

    p: the vertex, or its image in a mirror. pdf: the BSDF's density of the direction. from_delta:
    whether no other direction was possible, so that light sampling could not have found it. sought:
    whether light was looked for in mirrors from there, and the path has met nothing since; None
    where there are no mirrors. share: by how much densities of light sampling count; None where
    they always do in full.
    """

    p: mi.Point3f
    pdf: mi.Float
    from_delta: mi.Bool
    sought: mi.Bool | None
    share: mi.Float | None

    @staticmethod
    def camera(mirrors: Mirrors | None) -> Origin:
        """Of a camera's ray."""
        several = mirrors is not None and mirrors.count > 1
        return Origin(mi.Point3f(0), mi.Float(1), mi.Bool(True),
                      None if mirrors is None else mi.Bool(False),
                      mi.Float(1) if several else None)

    def begun(self, begins: mi.Bool) -> Origin:
        """That of the camera where a path begins."""
        return Origin(self.p, dr.select(begins, 1, self.pdf), self.from_delta | begins,
                      None if self.sought is None else self.sought & ~begins, self.share)

    def after(self, si: mi.SurfaceInteraction3f, sample: mi.BSDFSample3f, clear: mi.UInt32 | None,
              mirrors: Mirrors | None, seeks: mi.Bool,
              active: mi.Bool) -> tuple[Origin, mi.Bool]:
        """Behind a surface, and whether it is the one before it still.

        Args:
            clear: of `MitsubaScene`; mirrors: None where that is not.
            seeks: whether light was looked for in mirrors from here.
        """
        is_delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        p, is_same, sought, share = self.p, mi.Bool(False), None, None
        if clear is not None:
            is_same = goes_through(sample, si.shape, clear, active)
        elif mirrors is not None:
            assert self.sought is not None
            row = mirrors.row(si.shape, active)
            is_same = is_delta & self.sought & (row != 0)
            p, sought = mirrors.image(row - 1, self.p, is_same), seeks & ~is_delta
            if self.share is not None:
                share = dr.select(is_same, mi.Float(1 / mirrors.count), 1)
        return Origin(dr.select(is_same, p, si.p), dr.select(is_same, self.pdf, sample.pdf),
                      dr.select(is_same, self.from_delta, is_delta), sought, share), is_same


def found_light(scene: mi.Scene, si: mi.SurfaceInteraction3f, origin: Origin,
                surer: mi.Float | float = 1.0) -> mi.Color3f:
    """Radiance of what a direction met, weighed against light sampling.

    Args:
        surer: how many times the density of light sampling counts, as of `strata.py`.
    """
    reference = dr.zeros(mi.Interaction3f)
    reference.p = origin.p
    hit = mi.DirectionSample3f(scene, si, reference)
    emitter_pdf = scene.pdf_emitter_direction(reference, hit, ~origin.from_delta)
    if origin.share is not None:
        surer = surer * origin.share
    return power_heuristic(origin.pdf, surer * emitter_pdf) * hit.emitter.eval(si)
