"""Lights in a few groups, such that those of one group seldom shine on the same place.

A visibility for each group is noise only where two of its lights meet. With u_e the luminance that
emitter e would give a point of the image if nothing were in its way, the share of light that may be
told wrongly there is at most the sum over pairs of a group of

    2 u_e u_f / (sum_e u_e)^2,

and lights are shared out so that the mean of it, over some points of some frames of the scene, is
small: the strongest first, each to where it adds least, then moved while that helps. The groups are
the scene's: they are the same in all of its frames, at any size, so that a group has a history.
"""

from __future__ import annotations

import drjit as dr
import numpy as np

from onespp.render.channels import MOST_GROUPS
from onespp.render.host.aligned import aligned
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi

from .camera_rays import pixel_rays
from .lights import GRID, LightGroups, contribution

_HEIGHT, _WIDTH = 18, 32
_FRAMES = 4  # of the scene that are looked at
_ROUNDS = 10


def find_groups(stage: MitsubaScene) -> LightGroups | None:
    """The groups of a scene's lights, None for one light. May move the stage."""
    count = len(stage.mi_scene.emitters())
    if count < 2:
        return None
    if count <= MOST_GROUPS:
        groups = np.arange(count)
    else:
        last = stage.description.frames - 1
        at = sorted({round(last * i / (_FRAMES - 1)) for i in range(_FRAMES)})
        groups = share_out(np.concatenate([_luminances(stage, i) for i in at], axis=1))
    sizes = np.bincount(groups)
    return LightGroups(aligned(mi.UInt32, groups.astype(np.uint32)), tuple(map(int, sizes)))


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


def _luminances(stage: MitsubaScene, index: int) -> np.ndarray:
    """(emitters, points) of what each light would give points of a frame."""
    stage.set_frame(index)
    scene = stage.mi_scene
    emitters, points = len(scene.emitters()), _HEIGHT * _WIDTH
    lane = dr.arange(mi.UInt32, emitters * points)
    emitter, point = lane // points, lane % points
    row = point // _WIDTH
    with dr.suspend_grad():
        ray, _ = pixel_rays(stage, _HEIGHT, _WIDTH).at(
            mi.Float(point - row * _WIDTH) + 0.5, mi.Float(row) + 0.5)
        si = scene.ray_intersect(ray)
        total = mi.Float(0)
        for cell in (5, 6, 9, 10):  # the middle of the light
            c, _ = contribution(scene, si, emitter * (GRID * GRID) + cell, mi.Point2f(0.5),
                                si.is_valid())
            total += mi.luminance(c)
    return total.numpy().astype(np.float64).reshape(emitters, points)
