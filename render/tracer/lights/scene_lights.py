"""What is fixed about a scene's lights: how finely each is cut, and which group it is in.

**Strata.** Up to `FEW` lights are cut into 4 x 4 strata each. Where there are more, each is cut
into one at first, and those that give most for each of their strata, as a mean over points of the
scene, are cut more finely while there are strata left, `MOST_STRATA` in all. So a pixel costs what
it costs with a few lights, and the sky or a large lamp among many small ones keeps its 16. A light
at a point or from one direction has one. The sun of a sky is a light (`sun.py`). Of more than
`MOST_CLUSTERS` lights some speak for others (`clusters.py`), and a cluster has one stratum.

**Groups.** Those of one group seldom shine on the same place: a visibility for each group is noise
only where two of its lights meet. With u_e the luminance that light e would give a point of the
image if nothing were in its way, the share of light that may be told wrongly there is at most the
sum over pairs of a group of

    2 u_e u_f / (sum_e u_e)^2,

and lights are shared out so that the mean of it, over some points of some frames of the scene, is
small: the strongest first, each to where it adds least, then moved while that helps. The groups are
the scene's: they are the same in all of its frames, at any size, so that a group has a history.
"""

from __future__ import annotations

import drjit as dr
import numpy as np

from onespp.render.channels import MOST_GROUPS
from onespp.render.host.aligned import owned
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.camera_rays import pixel_rays

from .clusters import MOST_CLUSTERS, Clusters, clustered
from .resampling import Lights
from .strata import light_point, stratum_word
from .sun import SUN_BIT, Sun, find_sun

FEW = 8
MOST_STRATA = 128

_HEIGHT, _WIDTH = 18, 32
_FRAMES = 4  # of the scene that are looked at
_ROUNDS = 10


def find_lights(stage: MitsubaScene) -> Lights:
    """The strata of a scene's lights, in groups where it has several. May move the stage."""
    emitters, sun = stage.mi_scene.emitters(), find_sun(stage.mi_scene)
    delta = np.array([mi.has_flag(e.flags(), mi.EmitterFlags.Delta) for e in emitters]
                     + [False] * (sun is not None), bool)
    lights, count = 256 * np.arange(len(emitters)), len(delta)
    if sun is not None:
        lights = np.append(lights, lights[sun.emitter.numpy()[0]] + SUN_BIT)
    clusters = [(np.array([e]), 1.0) for e in range(count)]
    luminances = np.zeros((count, 0))
    if count > min(FEW, MOST_GROUPS):
        last = stage.description.frames - 1
        at = sorted({round(last * i / (_FRAMES - 1)) for i in range(_FRAMES)})
        luminances = np.concatenate([_luminances(stage, i, lights, sun) for i in at], axis=1)
    if count > MOST_CLUSTERS:
        shares = luminances / np.maximum(luminances.sum(0), 1e-30)
        endless = np.array([e.is_environment() for e in emitters] + [True] * (sun is not None))
        clusters = clustered(shares, endless, MOST_CLUSTERS)
        luminances = np.stack([luminances[e].sum(0) for e, _ in clusters])
    stratum, group, sizes, speaking = _in_strata(lights, clusters, luminances, delta)
    environment = next((i for i, e in enumerate(emitters) if e.is_environment()), len(emitters))
    is_sky = stratum.numpy() >> 7 == 2 * environment  # without `SUN_BIT`
    of_sky = np.bincount(group.numpy()[is_sky], minlength=len(sizes))
    return Lights(stratum, group, sizes, tuple(map(int, of_sky)), max(1, len(emitters)),
                  dr.opaque(mi.UInt32, environment), sun, speaking,
                  frozenset(s.bsdf().ptr for s in stage.mi_scene.shapes()))


def _in_strata(lights: np.ndarray, clusters: list[tuple[np.ndarray, float]],
               luminances: np.ndarray, delta: np.ndarray,
               ) -> tuple[mi.UInt32, mi.UInt32, tuple[int, ...], Clusters | None]:
    """`stratum`, `group`, `sizes` and `clusters` of `Lights`, from words without cells, of
    `clustered`, with (clusters, points) luminances, if these are known; delta: of lights."""
    count = len(clusters)
    whole = np.array([len(e) > 1 or delta[e[0]] for e, _ in clusters])
    halvings = np.where(whole, 0, 2) if count <= FEW else cut(luminances, whole)
    groups = np.arange(count) if count <= MOST_GROUPS else share_out(luminances)
    words = [[stratum_word(lights[e], n, cell) for cell in range(4**n)]
             for (e, _), n in zip(clusters, halvings)]
    first = [word[0] for of_cluster in words for word in of_cluster]
    group = np.repeat(groups, 4**halvings)
    sizes = np.bincount(group) if count > 1 else ()
    speaking = None
    if count < len(lights):
        speaking = Clusters.of([word for of_cluster in words for word in of_cluster],
                               np.repeat([s for _, s in clusters], 4**halvings))
    return (owned(mi.UInt32, np.array(first, np.uint32)),
            owned(mi.UInt32, group.astype(np.uint32)), tuple(map(int, sizes)), speaking)


def cut(luminances: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """How often the sides of each light are halved, (lights,) 0, 1 or 2, of (lights, points)
    luminances.

    Args:
        delta: (lights,) bool, those at a point or from one direction: 0.
    """
    given = (luminances / np.maximum(luminances.sum(0), 1e-30)).mean(1)
    halvings = np.zeros(len(given), int)
    left = MOST_STRATA - len(given)
    while True:
        strata = 4**halvings
        finer = np.where(~delta & (halvings < 2) & (3 * strata <= left), given / strata, 0)
        light = int(np.argmax(finer))
        if finer[light] <= 0:
            return halvings
        left -= 3 * strata[light]
        halvings[light] += 1


def share_out(luminances: np.ndarray, count: int = MOST_GROUPS) -> np.ndarray:
    """Group of each light, (lights,) int, of (lights, points) luminances; no group is empty."""
    share = luminances / np.maximum(luminances.sum(0), 1e-30)
    together = share @ share.T
    np.fill_diagonal(together, 0)
    order = np.argsort(-share.sum(1), kind="stable")
    groups = np.full(len(share), -1)
    groups[order[:count]] = range(count)

    def best(e: int) -> int:
        return int(np.argmin([together[e, groups == g].sum() for g in range(count)]))

    for e in order[count:]:
        groups[e] = best(e)
    for _ in range(_ROUNDS):
        before = groups.copy()
        for e in order:
            if (groups == groups[e]).sum() > 1:
                groups[e] = best(e)
        if (before == groups).all():
            break
    return groups


def _luminances(stage: MitsubaScene, index: int, lights: np.ndarray,
                sun: Sun | None) -> np.ndarray:
    """(lights, points) of what each light would give points of a frame."""
    stage.set_frame(index)
    scene = stage.mi_scene
    points = _HEIGHT * _WIDTH
    lane = dr.arange(mi.UInt32, len(lights) * points)
    light, point = dr.gather(mi.UInt32, mi.UInt32(lights), lane // points), lane % points
    row = point // _WIDTH
    with dr.suspend_grad():
        ray, _ = pixel_rays(stage, _HEIGHT, _WIDTH).at(
            mi.Float(point - row * _WIDTH) + 0.5, mi.Float(row) + 0.5)
        si = scene.ray_intersect(ray)
        total = mi.Float(0)
        for cell in (5, 6, 9, 10):  # the middle of the light
            point = light_point(scene, si, stratum_word(light, 2, cell), mi.Point2f(0.5),
                                si.is_valid(), sun)
            total += mi.luminance(point.c)
    return total.numpy().astype(np.float64).reshape(len(lights), points)
