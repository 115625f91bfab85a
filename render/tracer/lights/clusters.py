"""Many lights as a bounded number of clusters, each with one of its lights to speak for it.

Symbols: rho_e, the row of what light e would give some points of the scene, as shares of the light
there; n_e its length; c_e(x) what it would give at x.

Lights whose rows are alike differ by a factor. With r the light of a cluster C whose row is nearest
in direction to that of all of C, and s = sum_e rho_e . rho_r / n_r^2,

    c_C(x) = s c_r(x)

stands for the light of all of C, where strata are picked and in U. A cluster that is picked sends
its ray to one of its lights: up to `MEMBERS` of them, evenly spread over C, are compared as in
`candidates.py`, and e counts for

    |C| / m  sum_i l(c_i) / l(c_e)    (m compared),

so that light keeps its mean whatever r is, and the cost of a pixel does not depend on how many
lights there are. That c_C is not quite the sum of c_e is told by visibility, not by noise of U.

Clusters are those of k-means on rho_e / n_e, weighted by n_e, from the centres that are farthest
from those before, by weight. Unlike any by place, they know what is large, far or behind a wall.

Source: Hasan, Pellacini and Bala 2007, "Matrix row-column sampling for the many-light problem";
differs: k-means instead of their division, and lights are picked within a cluster, without bias.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import numpy as np

from onespp.render.host.aligned import owned
from onespp.render.mitsuba.variant import mi

from .reservoir import offered
from .strata import light_point
from .sun import Sun

MOST_CLUSTERS = 96
MEMBERS = 8
_ROUNDS = 10
_FAINTEST = 1e-6  # of the largest n_e, in whose place it is


@dataclass
class Clusters:
    """Of each stratum.

    scale: s. first, count: where its lights are in `members`, words as of a stratum; of what is no
    cluster, one: itself.
    """

    scale: mi.Float
    first: mi.UInt32
    count: mi.UInt32
    members: mi.UInt32

    @staticmethod
    def of(lights: list[np.ndarray], scales: np.ndarray) -> Clusters:
        """Of the words of each stratum's lights."""
        count = np.array([len(words) for words in lights])
        return Clusters(owned(mi.Float, scales.astype(np.float32)),
                        owned(mi.UInt32, (np.cumsum(count) - count).astype(np.uint32)),
                        owned(mi.UInt32, count.astype(np.uint32)),
                        owned(mi.UInt32, np.concatenate(lights).astype(np.uint32)))


@dr.syntax
def light_of_cluster(clusters: Clusters, stratum: mi.UInt32, scene: mi.Scene,
                     si: mi.SurfaceInteraction3f, place: mi.Point2f, random: mi.Point2f,
                     active: mi.Bool, sun: Sun | None) -> tuple[mi.UInt32, mi.Float]:
    """One of a cluster's lights, as a word, and how many times its contribution at `place` counts.

    Args:
        stratum: the cluster, by number. random: in [0, 1)^2.
    """
    first = dr.gather(mi.UInt32, clusters.first, stratum, active)
    count = dr.gather(mi.UInt32, clusters.count, stratum, active)
    compared = dr.minimum(count, MEMBERS)
    apart, left = mi.Float(count) / dr.maximum(compared, 1), mi.Float(random.y)
    total, kept, kept_luminance = mi.Float(0), mi.UInt32(0), mi.Float(0)
    i = mi.UInt32(0)
    while dr.hint(i < compared, max_iterations=MEMBERS, label="cluster"):
        member = dr.minimum(mi.UInt32(apart * (i + random.x)), count - 1)
        word = dr.gather(mi.UInt32, clusters.members, first + member, active)
        luminance = mi.luminance(light_point(scene, si, word, place, active, sun).c)
        total += luminance
        taken, left = offered(left, luminance, total)
        kept = dr.select(taken, word, kept)
        kept_luminance = dr.select(taken, luminance, kept_luminance)
        i += 1
    return kept, dr.select(total > 0, apart * total / kept_luminance, 0)


def clustered(rows: np.ndarray, alone: np.ndarray,
              count: int) -> list[tuple[np.ndarray, float]]:
    """The lights of each cluster, that which speaks for it first, and its s; `count` at most.

    Args:
        rows: (lights, points) rho. alone: (lights,) bool, those that are a cluster by themselves,
            fewer than `count`.
    """
    lone, others = np.flatnonzero(alone), np.flatnonzero(~alone)
    length = np.linalg.norm(rows[others], axis=1)
    direction = rows[others] / np.maximum(length, 1e-30)[:, None]
    weight = np.maximum(length, _FAINTEST * max(length.max(), 1e-30))
    cluster = _k_means(direction, weight, count - len(lone))
    found = [(np.array([e]), 1.0) for e in lone]
    for c in np.unique(cluster):
        members = np.flatnonzero(cluster == c)
        together = rows[others[members]].sum(0)
        first = members[np.argmax(direction[members] @ together)]
        s = direction[first] @ together / weight[first] if length[first] > 0 else len(members)
        found.append((others[[first, *members[members != first]]], float(s)))
    return found


def _k_means(points: np.ndarray, weight: np.ndarray, count: int) -> np.ndarray:
    """The cluster of each of (n, d) points."""
    nearest = np.full(len(points), np.inf)
    centres = []
    for _ in range(min(count, len(points))):
        centre = points[np.argmax(weight * nearest)] if centres else points[np.argmax(weight)]
        centres.append(centre)
        nearest = np.minimum(nearest, np.square(points - centre).sum(1))
    centres = np.array(centres)
    for _ in range(_ROUNDS):
        share = weight * (_nearest(points, centres) == np.arange(len(centres))[:, None])
        mass = share.sum(1, keepdims=True)
        centres = np.where(mass > 0, share @ points / np.maximum(mass, 1e-300), centres)
    return _nearest(points, centres)


def _nearest(points: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """(n,) int, the centre of each of (n, d) points."""
    return np.argmin(np.square(centres).sum(1) - 2 * points @ centres.T, axis=1)
